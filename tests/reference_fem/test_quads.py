"""The finite element model on quads of any shape: patch, scikit-fem itself, Kirsch's plate, loads, optimisation."""

from typing import Any

import numpy as np
import pytest
from skfem import (
    Basis,
    ElementQuad1,
    ElementQuad2,
    ElementVector,
    FacetBasis,
    Functional,
    LinearForm,
    MeshQuad,
    asm,
    condense,
)
from skfem import solve as skfem_solve
from skfem.assembly import BilinearForm
from skfem.helpers import ddot, dot, eye, sym_grad, trace

from mpmtop.arrays import Array
from mpmtop.body import Body, Material, Support
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.errors import InvalidScene, LoadOutsideBody
from mpmtop.loads import PositionLoad, RegionLoad
from mpmtop.optimizers import GCMMA, optimize
from mpmtop.region import Circle, Difference, Rectangle
from reference_fem.boundary import locate_in_mesh, nodal_forces
from reference_fem.elasticity import ELEMENT_CENTRE, FemModel, discretise, gauss_points, solve, stress
from reference_fem.factorise import minimum_degree_superlu
from reference_fem.hole import around_hole
from reference_fem.mesh import element_centres, vector_basis
from reference_fem.simp import design_problem
from tests.reference_fem.bodies import Plane, densities, orders, planes
from tests.reference_fem.plates import cantilever, plate
from validation.measures.orders import observed_order
from validation.oracles.woodbury import State, exact_derivatives, finite_elements


@planes
@orders
def test_patch(order: int, plane: Plane) -> None:
    """A linear displacement gives the constant stress of the written-out law, and no force on inner nodes."""
    scene = cantilever(material=Material(3.0, 0.25, plane))
    model = discretise(scene.body, order=order, mesh=plate(3.0))
    basis, young = model.basis, np.full(len(model.area), 3.0)
    a = np.array([[1e-3, 4e-4], [-2e-4, 5e-4]])  # grad u
    u = np.zeros(basis.N)
    for c, dofs in enumerate(basis.split_indices()):
        u[dofs] = a[c] @ basis.doflocs[:, dofs]
    factor = 3.0 / (1.25 * 0.5) if plane == "strain" else 3.0 / (1 - 0.25**2)
    own, other = (0.75, 0.25) if plane == "strain" else (1.0, 0.25)
    xx, yy = factor * (own * a[0, 0] + other * a[1, 1]), factor * (other * a[0, 0] + own * a[1, 1])
    expected = [xx, yy, 3.0 / 2.5 * (a[0, 1] + a[1, 0]), 0.25 * (xx + yy) if plane == "strain" else 0]
    for reference in (ELEMENT_CENTRE, gauss_points(model)):
        # coordinates of 45 over sides of 1
        np.testing.assert_allclose(
            stress(model, u, young, reference),
            np.broadcast_to(expected, (len(model.area), reference.shape[1], 4)),
            rtol=0,
            atol=1e-11 * xx,
        )
    at_rest = np.ones(basis.N, bool)  # inside, and in no element with a held dof, whose columns are not in K
    at_rest[basis.get_dofs().all()] = False
    held = ~np.isin(basis.element_dofs, model.free)
    at_rest[basis.element_dofs[:, held.any(axis=0)]] = False
    force = model.stiffness(young) @ u[model.free]
    assert at_rest.sum() > 200
    # sums of tens of products, each of stiffnesses of all directions
    assert np.abs(force[at_rest[model.free]]).max() < 1e-12 * np.abs(force).max()


@planes
@orders
def test_equals_plain_scikit_fem(order: int, plane: Plane) -> None:
    """With the same Gauss rule, what asm, condense and solve give; finer rules change little."""
    scene = cantilever(PositionLoad((45, 30), (0.5, -1)), material=Material(7.0, 0.3, plane))
    mesh = plate(1.5 * order)
    model = discretise(scene.body, order=order, mesh=mesh)
    assert model.factorise is minimum_degree_superlu
    young = 7 * densities(len(model.area)) ** 3
    compliance = model.f_ext @ solve(model, young)
    nu = 0.3
    lam = nu / ((1 + nu) * (1 - 2 * nu)) if plane == "strain" else nu / (1 - nu**2)

    @BilinearForm
    def form(u: Any, v: Any, w: Any) -> Array:
        e = sym_grad(u)
        return w["young"] * ddot(lam * eye(trace(e), 2) + e / (1 + nu), sym_grad(v))

    for gauss, rel in ((order + 1, 1e-11), (order + 3, 1e-4)):
        basis = Basis(mesh, ElementVector((ElementQuad1, ElementQuad2)[order - 1]()), intorder=2 * gauss - 1)
        K = asm(form, basis, young=np.broadcast_to(young[:, None], basis.dx.shape))
        f = basis.probes(np.array([[45.0], [30.0]])).T @ [0.5, -1]
        np.testing.assert_allclose(model.f_ext, f, rtol=0, atol=1e-14)
        direct = skfem_solve(*condense(K, f, D=basis.get_dofs(lambda x: np.isclose(x[0], 0)).all()))
        if gauss == order + 1:
            difference = model.stiffness(young) - K[model.free][:, model.free]
            assert abs(difference).max() < 1e-12 * abs(K).max()  # sums of tens of products
        # two direct solves: round-off, 1e-16, times condition number, 1e5; two Gauss rules: the order of the elements'
        # distortion, 2e-5 here at moduli from 0.06 to 3.6
        assert compliance == pytest.approx(f @ direct, rel=rel)


@orders
def test_lattice_as_a_mesh(order: int) -> None:
    """Without any use of its being a lattice: the same stiffness, load, solution and gradient."""
    scene = cantilever(objective=PNormStress())
    lattice = design_problem(scene, 1.5, order)
    mesh = design_problem(scene, order=order, mesh=lattice.model.basis.mesh)
    assert np.array_equal(lattice.model.centres, mesh.model.centres) and np.array_equal(lattice.x0, mesh.x0)
    assert (lattice.H != mesh.H).nnz == 0
    np.testing.assert_allclose(lattice.model.f_ext, mesh.model.f_ext, rtol=0, atol=1e-14)  # bases of size one
    x = densities(len(lattice.x0))
    a, b = lattice.evaluate(x), mesh.evaluate(x)
    free = np.argsort(lattice.model.free), np.argsort(mesh.model.free)
    young = x**3
    K, other = (p.model.stiffness(young)[k][:, k] for p, k in zip((lattice, mesh), free, strict=True))
    assert abs(K - other).max() <= 1e-15 * abs(K).max()  # the same products
    # two factorisations: round-off times condition number, 1e5
    assert b.objective == pytest.approx(a.objective, rel=1e-11)
    np.testing.assert_allclose(b.u, a.u, rtol=0, atol=1e-11 * np.abs(a.u).max())
    gradient = lattice.gradient(a)[0]
    np.testing.assert_allclose(mesh.gradient(b)[0], gradient, rtol=0, atol=1e-11 * np.abs(gradient).max())


def kirsch_stress(x: Array) -> Array:
    """Stress (2, 2, ...) at x (2, ...) in an infinite plate with a hole of radius 1 under unit tension along x."""
    q, angle = 1 / np.sum(x**2, axis=0), np.arctan2(x[1], x[0])
    c2, s2, c4, s4 = np.cos(2 * angle), np.sin(2 * angle), np.cos(4 * angle), np.sin(4 * angle)
    xx = 1 - q * (1.5 * c2 + c4) + 1.5 * q**2 * c4
    yy = -q * (0.5 * c2 - c4) - 1.5 * q**2 * c4
    xy = -q * (0.5 * s2 + s4) + 1.5 * q**2 * s4
    return np.array([[xx, xy], [xy, yy]])


def kirsch_displacement(x: Array, plane: Plane) -> Array:
    """Its displacement (2, ...) for E = 1 and nu = 0.3 (Kolosov's constants), up to a rigid motion."""
    shear, kappa = 1 / 2.6, 1.8 if plane == "strain" else 2.7 / 1.3
    r, angle = np.hypot(*x), np.arctan2(x[1], x[0])
    c, s, c3, s3 = np.cos(angle), np.sin(angle), np.cos(3 * angle), np.sin(3 * angle)
    u = r * (kappa + 1) * c + 2 / r * ((1 + kappa) * c + c3) - 2 / r**3 * c3
    v = r * (kappa - 3) * s + 2 / r * ((1 - kappa) * s + s3) - 2 / r**3 * s3
    return np.array([u, v]) / (8 * shear)


def kirsch_plate(size: float, order: int, plane: Plane) -> tuple[FemModel, float]:
    """A square of side 6 cut out of that plate under the tractions it had there, and their exact work."""
    supports = [((-3.0, 0.0), (False, True)), ((3.0, 0.0), (False, True)), ((0.0, -3.0), (True, False))]  # by symmetry
    body = Body(
        Difference(Rectangle((-3, -3), (3, 3)), Circle((0, 0), 1)),
        tuple(Support(Rectangle(x, x), fixed) for x, fixed in supports),
        material=Material(1.0, 0.3, plane),
    )
    mesh = around_hole((-3, -3), (3, 3), (0, 0), 1.0, size)
    model = discretise(body, order=order, mesh=mesh)
    outer = mesh.facets_satisfying(lambda x: np.isclose(np.abs(x).max(axis=0), 3), boundaries_only=True)
    basis = FacetBasis(mesh, model.basis.elem, facets=outer, intorder=8)

    def traction(w: Any) -> Array:
        return np.einsum("ij...,j...->i...", kirsch_stress(w.x), w.n)

    f = asm(LinearForm(lambda v, w: dot(traction(w), v)), basis)
    work = asm(Functional(lambda w: dot(traction(w), kirsch_displacement(w.x, plane))), basis)
    return FemModel(**(vars(model) | {"f_ext": f})), float(work)


@planes
@orders
def test_kirsch(order: int, plane: Plane) -> None:
    """Compliance of an exact solution at second order, the chords' share of it included; stress concentration of 3.

    Biquadratic elements are of fourth order in energy, but the chords leave them the second.
    """
    error = []
    for size in (0.5, 0.25, 0.125)[: 4 - order]:
        model, work = kirsch_plate(size, order, plane)
        solid = np.ones(len(model.area))
        u = solve(model, solid)
        error.append(1 - model.f_ext @ u / work)
    assert 0 < error[-1] < 1e-3  # from below: the chords and the elements both make it stiffer
    # not yet asymptotic: the number of layers is rounded to a whole one
    assert observed_order(error[:-1], error[1:]) == pytest.approx(2, abs=0.12)
    corner = model.basis.mesh.p[:, model.basis.mesh.t[0]]
    on_chord = np.abs(np.hypot(*corner) - 1) < 1e-12  # elements begin on the inner side
    sigma = stress(model, u, solid, np.array([[0.0], [0.5]]))[on_chord, 0]
    # at the chords' middle; an element averages over its depth: of first order bilinear, of second biquadratic
    assert sigma[:, 0].max() == pytest.approx(3, rel=0.02)
    assert sigma[:, 1].min() == pytest.approx(-1, rel=0.02)


def test_strip_of_finite_width() -> None:
    """Howland (1930), Phil. Trans. R. Soc. A 229:49: 4.32 times the far stress for a hole half as wide as the strip."""
    ends = [Rectangle((x - 0.25, 0), (x + 0.25, 10)) for x in (0, 40)]
    body = Body(
        Difference(Rectangle((0, 0), (40, 10)), Circle((20, 5), 2.5)),
        (
            Support(Rectangle((20, 0), (20, 10)), (True, False)),
            Support(Rectangle((0, 5), (0, 5)), (False, True)),
            Support(Rectangle((40, 5), (40, 5)), (False, True)),
        ),
        (RegionLoad(ends[0], (-10, 0)), RegionLoad(ends[1], (10, 0))),
        Material(1.0, 0.3, "stress"),
    )
    model = discretise(body, order=2, mesh=around_hole((0, 0), (40, 10), (20, 5), 2.5, 0.5))
    solid = np.ones(len(model.area))
    edge = np.abs(np.hypot(*(model.basis.mesh.p[:, model.basis.mesh.t[0]].T - (20, 5)).T) - 2.5) < 1e-12
    sigma = stress(model, solve(model, solid), solid, np.array([[0.0], [0.5]]))[edge, 0]
    assert sigma[:, 0].max() == pytest.approx(4.32, rel=0.01)  # three digits, and the chord's middle


@orders
def test_load_keeps_force_and_moment(order: int) -> None:
    """At centres, nodes, edges, on the arc and anywhere inside: forces have the force and the moment of the load."""
    basis = vector_basis(plate(1.5), order)
    rng = np.random.default_rng(5)
    anywhere = rng.uniform((0, 0), (45, 30), (60, 2))
    on_arc = 15 + 10 * np.array([[1, 0], [0, -1], [np.cos(0.3), np.sin(0.3)]])
    nodes = basis.mesh.p.T[::40]
    between = basis.mesh.p[:, basis.mesh.facets].mean(axis=1).T[::40]
    inside = anywhere[~Circle((15, 15), 10).contains(anywhere)]
    for x in (*np.array([[0, 0], [45, 30], [45, 15], [17, 30]], float), *on_arc, *nodes, *between, *inside):
        f = nodal_forces(basis, x[None], np.array([[2.0, -1.0]]), locate_in_mesh)
        f_x, f_y = (np.where(np.isin(np.arange(basis.N), dofs), f, 0) for dofs in basis.split_indices())
        # sums of a few numbers of order 1 at coordinates of order 40
        assert (f_x.sum(), f_y.sum()) == pytest.approx((2, -1), abs=1e-13)
        assert basis.doflocs[0] @ f_y - basis.doflocs[1] @ f_x == pytest.approx(-x[0] - 2 * x[1], abs=1e-11)
        assert np.count_nonzero(np.abs(f) > 1e-12) <= 2 * (order + 1) ** 2


def test_centres_are_found_in_the_middle() -> None:
    """Each in its own element at (1/2, 1/2), all at once."""
    basis = vector_basis(plate(1.5), 1)
    cell, reference = locate_in_mesh(basis, element_centres(basis.mesh))
    assert np.array_equal(cell, np.arange(760))
    np.testing.assert_allclose(reference, 0.5, rtol=0, atol=1e-13)  # coordinates of 45 over sides of 0.5


def test_position_in_a_large_element_among_small_ones() -> None:
    """The nearest centre is not that of the element around it."""
    mesh = around_hole((0, 0), (12, 8), (4, 4), 0.5, 1.0)
    basis = vector_basis(mesh, 1)
    x = np.random.default_rng(0).uniform((0, 0), (12, 8), (2000, 2))
    x = x[np.hypot(*(x - 4).T) > 0.5]
    cell, reference = locate_in_mesh(basis, x)
    nearest = np.argmin(np.hypot(*(x[:, None] - element_centres(mesh)).T), axis=0)
    assert np.count_nonzero(nearest != cell) > 50
    assert reference.min() >= 0 and reference.max() <= 1
    np.testing.assert_allclose(basis.mapping.F(reference[:, :, None], cell)[:, :, 0].T, x, rtol=0, atol=1e-12)


@pytest.mark.parametrize("x", [(15.0, 15.0), (45.01, 15.0), (24.5, 15.0), (90.0, 90.0)])
def test_load_beside_the_mesh(x: tuple[float, float]) -> None:
    with pytest.raises(LoadOutsideBody, match="no element"):
        nodal_forces(vector_basis(plate(1.5), 1), np.array([(40, 10), x]), np.ones((2, 2)), locate_in_mesh)


@pytest.mark.parametrize("objective", [Compliance(), PNormStress(8.0, 0.5)], ids=["compliance", "p-norm"])
def test_gradient_is_that_of_a_complex_step(objective: Compliance | PNormStress) -> None:
    """With passive elements of both kinds, on quads of all shapes."""
    scene = cantilever(
        objective=objective,
        passive_solid=Circle((15, 15), 12),
        passive_void=Rectangle((36, 0), (45, 10)),
        volume_fraction=0.5,
    )
    p = design_problem(scene, mesh=plate(3.0))
    assert p.space.solid.any() and p.space.void.any()
    x = densities(len(p.x0))
    at = p.evaluate(x)
    exact = exact_derivatives(State.at(finite_elements(p), at.rho))
    # rounding times the condition number of a body with a void of contrast 1e-9, whose strains are large
    np.testing.assert_allclose(p.density_gradient(at), exact, rtol=0, atol=1e-9 * np.abs(exact).max())
    df0, dg = p.gradient(at)
    np.testing.assert_allclose(df0, p.H.T @ exact, rtol=0, atol=1e-9 * np.abs(df0).max())
    assert p.evaluate(x + 0.1).constraints - at.constraints == pytest.approx(0.1 * dg.sum(axis=1), abs=1e-14)


def test_optimisation() -> None:
    """Body-fitted and voxel meshes of the plate: beside each other at the start and after ten steps."""
    objectives = {}
    for name, p in (
        ("voxel", design_problem(cantilever(), 1.5)),
        ("fitted", design_problem(cantilever(), mesh=plate(1.5))),
    ):
        history = list(optimize(p, GCMMA(move=0.3), max_iterations=10, stop=lambda history: False))
        assert history[-1].objective < 0.5 * history[0].objective
        assert history[-1].constraints[0] < 1e-3
        objectives[name] = np.array([history[0].objective, history[-1].objective])
    # stairs of 1.5 on a hole of radius 10, and another weight for each element
    np.testing.assert_allclose(objectives["voxel"], objectives["fitted"], rtol=0.1)


def test_fingerprint_tells_meshes_apart() -> None:
    scene = cantilever()
    every = [design_problem(scene, mesh=plate(size)) for size in (3.0, 1.5)] + [design_problem(scene, 1.5)]
    assert len({p.fingerprint for p in every}) == 3
    assert design_problem(scene, mesh=plate(3.0)).fingerprint == every[0].fingerprint


def test_meshes_that_are_refused() -> None:
    mesh = plate(3.0)
    with pytest.raises(InvalidScene, match="one of the two"):
        discretise(cantilever().body, 3.0, mesh=mesh)
    with pytest.raises(InvalidScene, match="one of the two"):
        discretise(cantilever().body)
    folded = mesh.p.copy()
    folded[:, mesh.t[2, -1]] = mesh.p[:, mesh.t[0, -1]] - 0.01
    with pytest.raises(InvalidScene, match="not convex"):
        discretise(cantilever().body, mesh=MeshQuad(folded, mesh.t))
    with pytest.raises(InvalidScene, match="outside the domain"):
        discretise(cantilever().body, mesh=mesh.translated((0.0, 4.0)))
    with pytest.raises(InvalidScene, match="outside the domain"):
        discretise(cantilever().body, mesh=MeshQuad.init_tensor(np.linspace(0, 45, 46), np.linspace(0, 30, 31)))
