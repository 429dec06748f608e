"""The finite element model: against scikit-fem itself, an independent code, identities."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from skfem import Basis, ElementQuad1, ElementQuad2, ElementVector, MeshQuad, asm, condense
from skfem import solve as skfem_solve
from skfem.assembly import BilinearForm
from skfem.helpers import ddot, eye, sym_grad, trace

from mpmtop.arrays import Array, Mask
from mpmtop.body import Body, Material, Support
from mpmtop.errors import EmptyDomain, InvalidScene, LoadOutsideBody, NotConverged, UnsupportedBody
from mpmtop.loads import PointLoad, PositionLoad
from mpmtop.region import Rectangle
from reference_fem import elasticity, factorise
from reference_fem.adjoint import unit_work
from reference_fem.boundary import nodal_forces
from reference_fem.elasticity import discretise, gauss_points, solve, stress, von_mises
from reference_fem.mesh import lattice, vector_basis
from tests.reference_fem.bodies import LEFT, FixedPositions, LShape, Plane, cantilever, densities
from validation.bodies.scenes import changed


@pytest.mark.parametrize("plane", ["strain", "stress"])
@pytest.mark.parametrize("order", [1, 2])
def test_equals_plain_scikit_fem(order: int, plane: Plane) -> None:
    """The map, the order of elimination and the own solve give what asm, condense and solve give."""
    material = Material(young=7.0, poisson=0.3, plane=plane)
    scene = cantilever(PositionLoad((40, 20), (0.5, -1)), material=material)
    model = discretise(scene.body, 1.0 if order == 2 else 0.5, order)
    young = 7 * densities(len(model.area)) ** 3
    u = solve(model, young)

    nu = material.poisson
    lam = nu / ((1 + nu) * (1 - 2 * nu)) if plane == "strain" else nu / (1 - nu**2)

    @BilinearForm
    def form(u: Any, v: Any, w: Any) -> Array:
        e = sym_grad(u)
        return w["young"] * ddot(lam * eye(trace(e), 2) + e / (1 + nu), sym_grad(v))

    mesh = MeshQuad.init_tensor(np.linspace(0, 40, 80 // order + 1), np.linspace(0, 20, 40 // order + 1))
    basis = Basis(mesh, ElementVector((ElementQuad1, ElementQuad2)[order - 1]()))  # its own, higher, quadrature
    K = asm(form, basis, young=np.broadcast_to(young[:, None], basis.dx.shape))
    corner = np.flatnonzero(np.all(np.isclose(basis.doflocs.T, [40, 20]), axis=1))
    f = np.zeros(basis.N)
    f[corner] = [0.5, -1]
    direct = skfem_solve(*condense(K, f, D=basis.get_dofs(lambda x: np.isclose(x[0], 0)).all()))
    assert np.allclose(model.f_ext, f, rtol=0, atol=1e-14)
    difference = model.stiffness(young) - K[model.free][:, model.free]
    assert abs(difference).max() < 1e-12 * abs(K).max()  # sums of tens of products, and another quadrature
    # two direct solves differ by round-off, 1e-16, times the condition number, 1e7 with moduli from 0.008 to 1
    assert model.f_ext @ u == pytest.approx(f @ direct, rel=1e-9)
    assert np.linalg.norm(u - direct) < 1e-9 * np.linalg.norm(direct)


@pytest.mark.parametrize("order", [1, 2])
def test_elimination_does_not_change_the_answer(monkeypatch: pytest.MonkeyPatch, order: int) -> None:
    """Banded Cholesky, sparse Cholesky and SuperLU, each in its own order, are three ways to the same u."""
    body = cantilever().body
    banded = discretise(body, 1.0, order)
    monkeypatch.setattr(factorise, "BANDED_ENTRIES", 0)
    nested = discretise(body, 1.0, order)
    assert isinstance(banded.factorise, factorise.BandedCholesky)
    assert isinstance(nested.factorise, factorise.NestedCholesky)
    superlu = replace(nested, factorise=factorise.minimum_degree_superlu)
    for young in (densities(len(banded.area)), np.ones(len(banded.area))):  # each factors twice
        u = solve(superlu, young)
        for model in (banded, nested):
            # condition number 1e6 at unit round-off 1e-16
            assert np.allclose(solve(model, young), u, rtol=0, atol=1e-9 * abs(u).max())


@pytest.mark.parametrize("plane", ["strain", "stress"])
@pytest.mark.parametrize("order", [1, 2])
def test_patch(order: int, plane: Plane) -> None:
    """A linear displacement gives the constant stress of the written-out law, and no force on inner nodes."""
    material = Material(young=3.0, poisson=0.25, plane=plane)
    model = discretise(Body(LShape(), (LEFT,), material=material), (1.0, 0.5), order)
    a = np.array([[1e-3, 4e-4], [-2e-4, 5e-4]])  # grad u
    u = np.zeros(model.basis.N)
    for c, dofs in enumerate(model.basis.split_indices()):
        u[dofs] = a[c] @ model.basis.doflocs[:, dofs]
    shear = 3.0 / (2 * 1.25) * (a[0, 1] + a[1, 0])
    nu, xx, yy = (0.25, a[0, 0], a[1, 1])
    if plane == "strain":
        factor = 3.0 / ((1 + nu) * (1 - 2 * nu))
        normal = factor * ((1 - nu) * xx + nu * yy), factor * (nu * xx + (1 - nu) * yy)
        zz = factor * nu * (xx + yy)
    else:
        factor = 3.0 / (1 - nu**2)
        normal, zz = (factor * (xx + nu * yy), factor * (nu * xx + yy)), 0.0
    young = np.full(len(model.area), 3.0)
    for reference in (elasticity.ELEMENT_CENTRE, gauss_points(model)):
        sigma = stress(model, u, young, reference)
        # coordinates up to 10 over sides of 0.5 lose two digits of sixteen
        assert np.allclose(sigma, [*normal, shear, zz], rtol=0, atol=1e-12 * abs(sigma).max())
    K = model.stiffness(young)
    x, f = model.basis.doflocs[:, model.free], K @ u[model.free]
    touched = np.isin(x[0], x[0].min()) | (x[0] <= 1.0)  # next to the held edge, whose columns are not in K
    inside = ~touched & (x[1] > 0) & (x[1] < 10) & (x[0] < 10) & ~((x[0] >= 4) & (x[1] >= 4))
    assert np.count_nonzero(inside) > 50
    assert np.abs(f[inside]).max() < 1e-12 * np.abs(f).max()


def test_von_mises() -> None:
    """Uniaxial stress gives itself, shear sqrt(3) times itself, pressure nothing."""
    sigma = np.array([[2.0, 0, 0, 0], [0, 0, 1, 0], [5, 5, 0, 5]])
    assert von_mises(sigma) == pytest.approx([2, np.sqrt(3), 0], abs=1e-15)


@pytest.mark.parametrize("order", [1, 2])
def test_energy_identities(order: int) -> None:
    """Clapeyron, integral of sigma:eps = f.u, from stresses at Gauss points; sum dC/dlnE = -C from unit energies."""
    model = discretise(cantilever().body, 1.0, order)
    young = densities(len(model.area)) ** 3
    u = solve(model, young)
    sigma = stress(model, u, young, gauss_points(model))
    basis = Basis(model.basis.mesh, model.basis.elem, intorder=2 * order)
    strain = np.asarray(sym_grad(basis.interpolate(u)))
    work = np.sum(
        (sigma[..., 0] * strain[0, 0] + sigma[..., 1] * strain[1, 1] + 2 * sigma[..., 2] * strain[0, 1]) * basis.dx
    )
    # round-off of the solve, 1e-16, times the condition number, 1e7 with moduli from 0.008 to 1
    assert work == pytest.approx(model.f_ext @ u, rel=1e-9)
    assert young @ unit_work(model, u, u) == pytest.approx(
        work, rel=1e-10
    )  # no solve, but elements move 100 times their strain


def test_independent_material_point_code() -> None:
    """Compliance from Kratos MPM: points at the 2 x 2 positions +-h/4, cells of side 1, E = 1e6, plane strain.

    With the points' weights equal to the Gauss weights of bilinear elements its grid is this mesh.
    """
    column = FixedPositions(np.column_stack([np.full(40, 39.75), np.arange(0.25, 20, 0.5)]))
    model = discretise(cantilever(column, material=Material(young=1e6)).body, 1.0)
    compliance = model.f_ext @ solve(model, np.full(800, 1e6))
    # printed to twelve digits; the direct solves of two programs leave 1e-11
    assert compliance == pytest.approx(3.40685100860e-05, rel=2e-11)


def test_l_shape() -> None:
    """Cells outside a callable domain are absent, and with them their nodes."""
    body = Body(LShape(), (Support(Rectangle((0, 10), (4, 10))),), (PointLoad((10, 4), (0, -1)),))
    model = discretise(body, 0.5)
    assert len(model.area) == 400 - 144
    assert model.area.sum() == pytest.approx(64)  # 100 - 36
    assert model.basis.mesh.nvertices == 21 * 21 - 12 * 12
    assert np.all(LShape().contains(model.centres))
    assert len(model.free) == 2 * (21 * 21 - 12 * 12 - 9)
    assert model.f_ext @ solve(model, np.ones(256)) > 0


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("x", [(0, 0), (40, 20), (40, 0), (17, 20), (13, 7.5), (3, 4), (3.3, 4.8)])
def test_load_keeps_force_and_moment(order: int, x: tuple[float, float]) -> None:
    """At corners, edges and inside: the nodal forces have the force and the moment of the load."""
    basis = vector_basis(lattice((np.zeros(2), np.array([40.0, 20.0])), np.ones(2)), order)
    f = nodal_forces(basis, np.array([x], float), np.array([[2.0, -1.0]]))
    f_x, f_y = (np.where(np.isin(np.arange(basis.N), dofs), f, 0) for dofs in basis.split_indices())
    # sums of a few numbers of order 1 at coordinates of order 40
    assert (f_x.sum(), f_y.sum()) == pytest.approx((2, -1), abs=1e-13)
    assert basis.doflocs[0] @ f_y - basis.doflocs[1] @ f_x == pytest.approx(-x[0] - 2 * x[1], abs=1e-11)


def test_errors_name_cause() -> None:
    scene = cantilever()
    with pytest.raises(InvalidScene, match="divide"):
        discretise(scene.body, 0.7)
    with pytest.raises(InvalidScene, match="positive"):
        discretise(scene.body, -1.0)
    with pytest.raises(InvalidScene, match="order 3"):
        discretise(scene.body, 1.0, order=3)
    with pytest.raises(EmptyDomain, match="smaller"):
        discretise(changed(scene, domain=Ring()).body, 40.0)
    with pytest.raises(UnsupportedBody, match="no node"):
        discretise(changed(scene, supports=(Support(Rectangle((0.2, 0.2), (0.8, 0.8))),)).body, 1.0)
    with pytest.raises(UnsupportedBody, match="rigidly"):
        discretise(changed(scene, supports=(Support(LEFT.region, fixed=(True, False)),)).body, 1.0)
    with pytest.raises(UnsupportedBody, match="rigidly"):  # a hinge
        discretise(changed(scene, supports=(Support(Rectangle((0, 0), (0, 0))),)).body, 1.0)
    with pytest.raises(LoadOutsideBody, match="no element"):
        discretise(cantilever(FixedPositions(np.array([[50.0, 0.0]]))).body, 1.0)


@dataclass(frozen=True)
class Ring:
    """The part of a 40 x 40 box beyond 15 from its centre."""

    bounds = np.zeros(2), np.full(2, 40.0)

    def contains(self, x: Array, tol: float = 0.0) -> Mask:
        return np.hypot(*(x - 20).T) >= 15 - tol


@pytest.mark.parametrize("entries", [0, factorise.BANDED_ENTRIES])
def test_void_carries_no_load(monkeypatch: pytest.MonkeyPatch, entries: int) -> None:
    """Without any stiffness the matrix is singular, in either factorisation, and the error says so."""
    monkeypatch.setattr(factorise, "BANDED_ENTRIES", entries)
    model = discretise(cantilever().body, 1.0)
    with pytest.raises(UnsupportedBody, match="contrast"):
        solve(model, np.where(model.centres[:, 0] < 20, 1.0, 0.0))


def test_solution_is_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    """A solve that is off by a part in 1e6 does not pass."""
    model = discretise(cantilever().body, 1.0)
    wrong = replace(model, factorise=lambda K: lambda f: (1 + 1e-6) * model.factorise(K)(f))
    with pytest.raises(NotConverged, match="residual"):
        solve(wrong, np.ones(800))
