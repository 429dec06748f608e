"""Work and precision: the analyses that are compared, with what they cost in numbers and in memory.

Every body is scaled so that a cell of the grid, or an element, has the side h = 1, and `n` counts them along a side
that stays in proportion: displacements under given forces do not change, as E h^0 in the plane, and stresses are taken
times the side.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from skfem import CellBasis, LinearForm, MeshQuad

from mpmtop.equilibrium import Model, discretise, equilibrium
from mpmtop.gcmma import Problem
from mpmtop.material import simp, tangent
from mpmtop.optimize import optimize
from mpmtop.points import MaterialPoints, seed
from mpmtop.problem import DesignProblem
from mpmtop.region import Polygon
from mpmtop.scene import Array, Difference, Index, Material, PointLoad, Rectangle, RegionLoad, Scene, Support
from mpmtop.shape_functions import ShapeFunction, gimp, tent
from mpmtop.transfer import Transfer, transfer
from reference_fem import elasticity
from reference_fem.boundary import Locate, locate_in_lattice, locate_in_mesh, nodal_forces
from reference_fem.elasticity import FemModel, fem_model, minimum_degree_elimination
from reference_fem.mesh import domain_lattice, lattice, vector_basis
from reference_fem.reanalyse import Judge, Judgement, build_judge
from reference_fem.simp import design_problem
from validation import manufactured
from validation.crossing import Crossing
from validation.methods import PAPER_RULE, Design
from validation.scenes import cantilever

INSIDE = 1e-9
"""Positions on the edge of the body are taken this far within it [h]: a cell on the other side holds no point."""
CLAMP = Support(Rectangle((-np.inf, -np.inf), (0.0, np.inf)))


class Outcome(NamedTuple):
    """Errors by name, unknowns, nonzeros of K (both triangles) and bytes of the operators an analysis reads: weights of
    the points and the map from moduli to K, or element matrices and that map; the factor is not among them."""

    errors: dict[str, float]
    unknowns: int
    nonzeros: int
    stored: int


Measure = Callable[[], Outcome]
"""Takes the errors of an analysis that has been made: what it costs is no part of the method."""
MpmAnalysis = Callable[[int, ShapeFunction, int, Crossing], Measure]
FemAnalysis = Callable[[int, int], Measure]


def stored_bytes(*held: Any) -> int:
    """Bytes of all arrays and sparse matrices in the objects, which may be nested dataclasses."""
    total = 0
    for item in held:
        if isinstance(item, np.ndarray):
            total += item.nbytes
        elif sp.issparse(item):
            total += item.data.nbytes + item.indices.nbytes + item.indptr.nbytes
        elif hasattr(item, "__dataclass_fields__"):
            total += stored_bytes(*vars(item).values())
    return total


def of_points(model: Model, errors: dict[str, float]) -> Outcome:
    """Outcome of an analysis by material points."""
    K = model.stiffness
    stored = stored_bytes(model.transfer, K, model.ghost)
    return Outcome(errors, len(K.dof), 2 * len(K.row) - len(K.dof), stored)


def of_elements(model: FemModel, errors: dict[str, float]) -> Outcome:
    """Outcome of an analysis by finite elements."""
    stored = stored_bytes(model.stiffness, model.matrices, model.shape)
    return Outcome(errors, len(model.free), len(model.stiffness.indices), stored)


def points_model(
    scene: Scene, shape_function: ShapeFunction, ppc: int, crossing: Crossing, ghost: float = 0.0
) -> Model:
    """The scene on cells of size 1 with ppc x ppc points in each, moved by `crossing`."""
    points = crossing(seed(scene.domain, (1 / ppc, 1 / ppc)), scene.domain)
    return discretise(scene, 1.0, points=points, shape_function=shape_function, ghost=ghost)


@dataclass(frozen=True, eq=False)
class Probe:
    """Positions (k, 2) in the body of a model where its displacement and strain are wanted, or where forces act."""

    operators: Transfer
    place: Index  # of the operators' nodes among the model's
    k: int

    def displacement(self, u: Array) -> Array:
        """(k, 2), of nodal displacements u (2a,) of the model."""
        return self.operators.interpolate(self._nodal(u))[: self.k]

    def strain(self, u: Array) -> Array:
        """(k, 3), Voigt."""
        return self.operators.strain(self._nodal(u))[: self.k]

    def force(self, forces: Array, a: int) -> Array:
        """Nodal forces (2a,) of forces (k, 2) at the positions, for a model of a nodes."""
        f = np.zeros((a, 2))
        f[self.place] = self.operators.N_matrix[: self.k].T @ forces
        return f.ravel()

    def _nodal(self, u: Array) -> Array:
        return u.reshape(-1, 2)[self.place].ravel()


def probe(model: Model, x: Array, half_length: float = INSIDE / 10) -> Probe:
    """Probe at x (k, 2) within the body, as points with domains of the given half-length [h] would be."""
    # the outermost points are there, too: they tell the B-splines where the body ends
    outermost = np.concatenate([model.points.x.argmin(axis=0), model.points.x.argmax(axis=0)])
    at = np.vstack([x, model.points.x[outermost]])
    probed = MaterialPoints(at, np.ones(len(at)), np.full_like(at, half_length))
    operators = transfer(model.grid, probed, model.shape_function)
    if not np.all(np.isin(operators.nodes, model.transfer.nodes)):
        raise ValueError("a probe lies where no material point of the model reaches")
    return Probe(operators, np.searchsorted(model.transfer.nodes, operators.nodes), len(x))


def square_points(n: int, shape_function: ShapeFunction, ppc: int, crossing: Crossing) -> Measure:
    """The manufactured solution with n cells per side."""
    done = manufactured.analysis(n, shape_function, crossing, ppc=ppc)

    def outcome() -> Outcome:
        touched = sp.csr_array((done.operators.N_matrix != 0).astype(float))
        inner = touched[:, np.unique(done.inside // 2)]
        # from the pattern: a product of the values could lose an entry to rounding
        nonzeros = 4 * (inner.T @ inner).nnz
        stored = stored_bytes(done.operators, done.VDB)
        return Outcome(done.errors._asdict(), len(done.inside), nonzeros, stored)

    return outcome


def square_elements(n: int, order: int) -> Measure:
    """The manufactured solution with n elements per side."""
    done = manufactured.finite_elements(n, order)
    return lambda: of_elements(done.model, done.errors._asdict())


BEAM = Material(young=1.0, poisson=0.3, plane="stress")
SLENDER = 4
"""Length of Timoshenko's cantilever over its depth."""


class BeamFields(NamedTuple):
    """u (p, 2) and stress (p, 3) in Voigt order."""

    u: Array
    stress: Array


def beam(x: Array, depth: float) -> BeamFields:
    """Timoshenko's cantilever at x (p, 2): 0 <= X <= L = 4 depth, 0 <= Y <= depth, unit force down at X = L.

    With y = Y - depth/2, I = depth^3 / 12, c = depth/2, in plane stress:

        u_x = y / 6EI ((6L - 3X) X + (2 + nu)(y^2 - c^2)),   sigma_xx = (L - X) y / I,  sigma_yy = 0,
        u_y = -1 / 6EI (3 nu y^2 (L - X) + (4 + 5 nu) c^2 X + (3L - X) X^2),  sigma_xy = -(c^2 - y^2) / 2I.

    The point (0, depth/2) stays, and (0, 0) and (0, depth) stay in x. Source: Timoshenko and Goodier, Theory of
    Elasticity, Sect. 21, with this clamp as in Augarde and Deeks (2008), Finite Elem. Anal. Des. 44:595.
    """
    E, nu, L, c, i = BEAM.young, BEAM.poisson, SLENDER * depth, depth / 2, depth**3 / 12
    X, y = x[:, 0], x[:, 1] - c
    u_x = y / (6 * E * i) * ((6 * L - 3 * X) * X + (2 + nu) * (y**2 - c**2))
    u_y = -(3 * nu * y**2 * (L - X) + (4 + 5 * nu) * c**2 * X + (3 * L - X) * X**2) / (6 * E * i)
    stress = np.stack([(L - X) * y / i, np.zeros_like(X), -(c**2 - y**2) / (2 * i)], axis=1)
    return BeamFields(np.stack([u_x, u_y], axis=1), stress)


def beam_energy(depth: float) -> float:
    """Strain energy: bending L^3 / 6EI and shear 6 (1 + nu) L / 5 E depth."""
    E, nu, L, i = BEAM.young, BEAM.poisson, SLENDER * depth, depth**3 / 12
    return L**3 / (6 * E * i) + 6 * (1 + nu) * L / (5 * E * depth)


def beam_scene(n: int) -> Scene:
    """The beam, n deep and n even, on the supports of its closed form. Its tractions replace the load."""
    at_left = [
        Support(Rectangle((0.0, y), (0.0, y)), fixed) for y, fixed in ((n / 2, (True, True)), (n, (True, False)))
    ]
    body = Rectangle((0.0, 0.0), (float(SLENDER * n), float(n)))
    return Scene("Timoshenko's cantilever", body, tuple(at_left), (PointLoad((n, n / 2), (0, -1), 0),), 1.0, BEAM)


def beam_tractions(n: int) -> tuple[Array, Array]:
    """Gauss points (k, 2) on both ends, three in each half of a cell, and the forces (k, 2) of the exact tractions."""
    node, weight = np.polynomial.legendre.leggauss(3)
    y = ((np.arange(2 * n)[:, None] + (1 + node) / 2) / 2).ravel()
    ends = []
    for X, outward in ((0.0, -1.0), (float(SLENDER * n), 1.0)):
        x = np.stack([np.full_like(y, X), y], axis=1)
        traction = outward * beam(x, n).stress[:, [0, 2]]
        ends.append((x, traction * np.tile(weight / 4, 2 * n)[:, None]))
    x, force = (np.concatenate(part) for part in zip(*ends, strict=True))
    return x, force


def beam_errors(at: Array, energy: float, n: int) -> dict[str, float]:
    """Errors by displacements (3, 2) at `beam_places`, a rigid motion off the closed form's supports removed: a
    B-spline's coefficient, which a support holds, is not the value there."""
    exact = beam(beam_places(n), n).u
    base, top, tip = at
    rotation = -(top[0] - base[0]) / (n / 2)
    deflection = tip[1] - base[1] - rotation * SLENDER * n
    return {
        "tip displacement": abs(float(deflection / exact[2, 1]) - 1),
        "strain energy": abs(energy / beam_energy(n) - 1),
    }


def beam_places(n: int) -> Array:
    """Middle and top of the clamped end, middle of the loaded one (3, 2)."""
    return np.array([(0.0, n / 2), (0.0, n), (SLENDER * n, n / 2)])


def within(x: Array, scene: Scene) -> Array:
    """Positions (k, 2) at least INSIDE from the sides of the domain's box."""
    lower, upper = scene.domain.bounds
    return np.clip(x, lower + INSIDE, upper - INSIDE)


def beam_points(n: int, shape_function: ShapeFunction, ppc: int, crossing: Crossing) -> Measure:
    """Timoshenko's cantilever with n cells over its depth."""
    scene = beam_scene(n)
    model = points_model(scene, shape_function, ppc, crossing)
    x, forces = beam_tractions(n)
    f = probe(model, within(x, scene)).force(forces, len(model.transfer.nodes))
    model = replace(model, f_ext=f)
    state = equilibrium(model, np.ones(len(model.points.x)))

    def outcome() -> Outcome:
        at = probe(model, within(beam_places(n), scene)).displacement(state.u)
        return of_points(model, beam_errors(at, float(f @ state.u) / 2, n))

    return outcome


def beam_elements(n: int, order: int) -> Measure:
    """Timoshenko's cantilever with n elements over its depth."""
    scene = beam_scene(n)
    basis = vector_basis(lattice(scene.domain.bounds, np.ones(2)), order)
    model = fem_model(scene, basis, nodal_forces(basis, *beam_tractions(n)))
    u = elasticity.solve(model, np.ones(len(model.area)))
    at = displacement_at(model, u, beam_places(n))
    return lambda: of_elements(model, beam_errors(at, float(model.f_ext @ u) / 2, n))


def displacement_at(model: FemModel, u: Array, x: Array) -> Array:
    """Displacements (k, 2) at nodes x (k, 2)."""
    found = []
    for dofs in model.basis.split_indices():
        distance = np.hypot(*(model.basis.doflocs[:, dofs][:, None] - x.T[:, :, None]))
        found.append(u[dofs[distance.argmin(axis=1)]])
    return np.stack(found, axis=1)


COOK = Material(young=1.0, poisson=1 / 3, plane="stress")
COOK_CORNERS = np.array([(0.0, 0.0), (48.0, 44.0), (48.0, 60.0), (0.0, 44.0)])
COOK_TIP = np.array([(48.0, 52.0)])
COOK_REFERENCE = 23.96
"""Displacement at (48, 52) in common use."""


def cook_scene(scale: float, spacing: float = 1.0) -> Scene:
    """Cook's membrane, clamped at its left edge, a unit force up on the last column of points."""
    corners = tuple((float(x), float(y)) for x, y in COOK_CORNERS * scale)
    last = RegionLoad(Rectangle((48 * scale - spacing, 0.0), (48 * scale, np.inf)), (0.0, 1.0))
    return Scene("Cook's membrane", Polygon(corners), (CLAMP,), (last,), 1.0, COOK)


def cook_points(n: int, shape_function: ShapeFunction, ppc: int, crossing: Crossing, ghost: float = 0.01) -> Measure:
    """Cook's membrane on n cells along x; the slanted edges cut cells. Ghost penalty for tent and GIMP."""
    scale = n / 48
    scene = cook_scene(scale, 1 / ppc)
    model = points_model(scene, shape_function, ppc, crossing, ghost if shape_function in (tent, gimp) else 0.0)
    state = equilibrium(model, np.ones(len(model.points.x)))

    def outcome() -> Outcome:
        tip = probe(model, within(COOK_TIP * scale, scene)).displacement(state.u)[0, 1]
        return of_points(model, {"tip displacement": abs(float(tip) / cook_reference() - 1)})

    return outcome


def cook_mesh(xi: Array, eta: Array) -> MeshQuad:
    """Quads of the membrane between lines xi from left to right and eta from bottom to top, both from 0 to 1."""
    square = MeshQuad.init_tensor(xi, eta)
    s, t = square.p
    return MeshQuad(np.stack([48 * s, 44 * s + t * (44 - 28 * s)]), square.t)


def cook_solution(mesh: MeshQuad, order: int) -> tuple[FemModel, float]:
    """Model and displacement at (48, 52), under a uniform shear of resultant one on the right edge."""
    basis = vector_basis(mesh, order)
    y = np.unique(mesh.p[1, np.isclose(mesh.p[0], 48.0)])
    node, weight = np.polynomial.legendre.leggauss(3)
    at = (y[:-1, None] + np.diff(y)[:, None] * (1 + node) / 2).ravel()
    force = np.outer((np.diff(y)[:, None] * weight / 2).ravel() / 16, [0.0, 1.0])
    f = nodal_forces(basis, np.stack([np.full_like(at, 48.0), at], axis=1), force, locate_in_mesh)
    model = fem_model(cook_scene(1.0), basis, f, minimum_degree_elimination)
    u = elasticity.solve(model, np.ones(len(model.area)))
    return model, float(displacement_at(model, u, COOK_TIP)[0, 1])


def cook_elements(n: int, order: int) -> Measure:
    """Cook's membrane by n x n quads."""
    lines = np.linspace(0, 1, n + 1)
    model, tip = cook_solution(cook_mesh(lines, lines), order)
    return lambda: of_elements(model, {"tip displacement": abs(tip / cook_reference() - 1)})


@cache
def cook_reference(n: int = 48) -> float:
    """Displacement at (48, 52) by n x n biquadratic elements that crowd towards the corners of the clamped edge."""
    t = np.linspace(0, 1, n + 1)
    return cook_solution(cook_mesh(t**2, t**2 * (3 - 2 * t)), 2)[1]


BRACKET_SIDE = 50.0
"""Side of the L-bracket in units of its own h; its arms are 20 wide."""
BRACKET = Material(young=1.0, poisson=0.3, plane="strain")
ALONG = (np.arange(96) + 0.382) / 96
PATH = np.stack([4 + 12 * ALONG, 33 + 4 * ALONG], axis=1)
"""Positions (96, 2) [h] on a line from (4h, 33h) to (16h, 37h) across the vertical arm, away from the corner at
(20h, 20h). It is oblique and its positions lie on no line of any grid, so that no place within a cell is preferred."""


def bracket_scene(n: int) -> Scene:
    """The L-bracket, n cells or elements along its side, n a multiple of five; a unit force down is spread over the
    last 10h x 10h of the lower arm, the same for every discretisation."""
    size, corner = float(n), 0.4 * n
    return Scene(
        "L-bracket",
        Difference(Rectangle((0.0, 0.0), (size, size)), Rectangle((corner, corner), (size, size))),
        (Support(Rectangle((-np.inf, size), (np.inf, np.inf))),),
        (RegionLoad(Rectangle((0.8 * n, 0.2 * n), (size, corner)), (0.0, -1.0)),),
        1.0,
        BRACKET,
    )


def path_error(stress: Array) -> dict[str, float]:
    """Root of the sum of |error|^2 over that of |stress|^2 for stresses (96, 3) on a bracket of side one."""
    expected, components = bracket_reference(), (1, 1, 2)
    return {
        "stress on the path": float(
            np.sqrt(np.sum((stress - expected) ** 2 * components) / np.sum(expected**2 * components))
        )
    }


def bracket_points(n: int, shape_function: ShapeFunction, ppc: int, crossing: Crossing) -> Measure:
    """Stress on the path of the L-bracket, as points of the model's own size would have it there."""
    model = points_model(bracket_scene(n), shape_function, ppc, crossing)
    state = equilibrium(model, np.ones(len(model.points.x)))

    def outcome() -> Outcome:
        strain = probe(model, PATH * n / BRACKET_SIDE, 0.5 / ppc).strain(state.u)
        return of_points(model, path_error(n * strain @ model.D))

    return outcome


def bracket_solution(n: int, mesh: MeshQuad, order: int) -> tuple[FemModel, Array]:
    """Model of the bracket on a mesh with lines at the edges of the loaded part, and stress (96, 3) on the path."""
    scene, basis = bracket_scene(n), vector_basis(mesh, order)
    loaded = scene.loads[0].region.contains(mesh.p[:, mesh.t].mean(axis=1).T)  # type: ignore[union-attr]
    part = CellBasis(mesh, basis.elem, intorder=2 * order, elements=np.flatnonzero(loaded), dofs=basis.dofs)
    f = LinearForm(lambda v, w: -v[1]).assemble(part) / part.dx.sum()
    graded = np.ptp(np.diff(np.unique(mesh.p[0]))) > INSIDE
    model = fem_model(scene, basis, f, *([minimum_degree_elimination] if graded else []))
    u = elasticity.solve(model, np.ones(len(model.area)))
    x = PATH * n / BRACKET_SIDE
    return model, n * strain_at(model, u, x, (locate_in_mesh if graded else locate_in_lattice)) @ tangent(BRACKET)


def strain_at(model: FemModel, u: Array, x: Array, locate: Locate) -> Array:
    """Strains (k, 3), Voigt, at x (k, 2)."""
    basis = model.basis
    cell, reference = locate(basis, x)
    grad = np.zeros((2, 2, len(x)))
    for i in range(basis.Nbfun):
        function = basis.elem.gbasis(basis.mapping, reference[:, :, None], i, tind=cell)[0]
        grad += function.grad[..., 0] * u[basis.element_dofs[i, cell]]
    return np.stack([grad[0, 0], grad[1, 1], grad[0, 1] + grad[1, 0]], axis=1)


def bracket_elements(n: int, order: int) -> Measure:
    """The same by elements of side 1."""
    model, stress = bracket_solution(n, domain_lattice(bracket_scene(n), np.ones(2)), order)
    return lambda: of_elements(model, path_error(stress))


@cache
def bracket_reference(per_h: float = 1) -> Array:
    """Stress (96, 3) by biquadratic elements of side h / per_h, halved fourteen times towards the corner's lines."""
    corner = 0.4 * BRACKET_SIDE
    near = 0.5 ** np.arange(1, 15) / per_h
    lines = np.linspace(0, BRACKET_SIDE, round(BRACKET_SIDE * per_h) + 1)
    lines = np.sort(np.concatenate([lines, corner - near, corner + near]))
    mesh = MeshQuad.init_tensor(lines, lines)
    scene = bracket_scene(round(BRACKET_SIDE))
    kept = np.flatnonzero(scene.domain.contains(mesh.p[:, mesh.t].mean(axis=1).T))
    return bracket_solution(round(BRACKET_SIDE), mesh.restrict(kept), 2)[1]


FIELD_SPACING = 0.5
"""Side of the squares on which the optimised field is constant [h]."""


def tip_scene(per_h: float = 1.0) -> Scene:
    """The cantilever of 40h x 20h with 1/per_h as the unit of length; the force is spread over the last 2h x 4h at
    mid-height, the same for every discretisation."""
    patch = RegionLoad(Rectangle((38 * per_h, 8 * per_h), (40 * per_h, 12 * per_h)), (0.0, -1.0))
    domain = Rectangle((0.0, 0.0), (40 * per_h, 20 * per_h))
    radius = 3 * FIELD_SPACING * per_h
    return replace(
        cantilever(), name="cantilever, load on a patch", domain=domain, loads=(patch,), filter_radius=radius
    )


def optimised(problem: Problem[Any], iterations: int = 40) -> Array:
    """Physical densities (p,) after so many iterations of the paper's loop, or when it stops."""
    for iterate in optimize(problem, PAPER_RULE, max_iterations=iterations):
        last = iterate
    return last.evaluation.rho


@cache
def field() -> Design:
    """The fixed field: the cantilever after 40 iterations, one density for each of 80 x 40 points."""
    points = seed(tip_scene().domain, (FIELD_SPACING, FIELD_SPACING))
    model = discretise(tip_scene(), 1.0, points=points, shape_function=tent)
    return Design(points.x, points.half_length, optimised(DesignProblem(model)))


@cache
def field_compliance(split: int, order: int = 2) -> Judgement:
    """The field on split x split elements for each of its squares."""
    design = field()
    return build_judge(tip_scene(), design.x, design.half_length, split, order)(design.rho)


def field_points(n: int, shape_function: ShapeFunction, ppc: int, crossing: Crossing) -> Measure:
    """Compliance of the field on cells of size h / n, its squares' densities given to the points seeded in them."""
    scene = tip_scene(n)
    seeded = seed(scene.domain, (1 / ppc, 1 / ppc))
    column, row = np.floor(seeded.x / (FIELD_SPACING * n)).astype(int).T
    rho = field().rho[column * round(20 / FIELD_SPACING) + row]
    model = points_model(scene, shape_function, ppc, crossing)
    state = equilibrium(model, scene.material.young * simp(rho, scene.penal, scene.contrast)[0])
    return lambda: of_points(model, field_error(float(model.f_ext @ state.u)))


def field_elements(n: int, order: int) -> Measure:
    """The same on n x n elements for each square of the field."""
    design = field()
    judge = build_judge(tip_scene(), design.x, design.half_length, n, order)
    compliance = judge(design.rho).compliance
    return lambda: of_elements(judge.model, field_error(compliance))


def field_error(compliance: float) -> dict[str, float]:
    """Relative error of a compliance of the field, by the reference of 2 x 2 biquadratic elements for each square."""
    return {"compliance": abs(compliance / field_compliance(2).compliance - 1)}


class Optimised(NamedTuple):
    """An optimisation's design, the unknowns and nonzeros of K of its analyses, and its objective as it sees it."""

    design: Design
    unknowns: int
    nonzeros: int
    objective: float


def optimised_points(per_h: float, ppc: int) -> Optimised:
    """40 iterations by the tent on cells of size h / per_h with ppc x ppc points each, filter radius 1.5h."""
    model = discretise(tip_scene(), 1 / per_h, ppc, tent)
    problem = DesignProblem(model)
    rho = optimised(problem)
    cost = of_points(model, {})
    design = Design(model.points.x, model.points.half_length, rho)
    return Optimised(design, cost.unknowns, cost.nonzeros, float(problem.analyse(rho).objective))


def optimised_elements(size: float) -> Optimised:
    """40 iterations by bilinear elements of a size [h], one density for each."""
    problem = design_problem(tip_scene(), size)
    rho = optimised(problem)
    cost = of_elements(problem.model, {})
    design = Design(problem.model.centres, np.full_like(problem.model.centres, size / 2), rho)
    return Optimised(design, cost.unknowns, cost.nonzeros, float(problem.analyse(rho).objective))


def true_compliance(designs: Mapping[Any, Design], pitch: float = 0.5) -> dict[Any, float]:
    """Compliance of each design by biquadratic elements no wider than `pitch` [h], one judge for each spacing."""
    judges: dict[float, Judge] = {}
    positions: dict[float, Array] = {}
    found = {}
    for name, design in designs.items():
        spacing = round(2 * float(design.half_length.min()), 9)
        if spacing not in judges:
            split = int(np.ceil(spacing / pitch - 1e-9))
            judges[spacing] = build_judge(tip_scene(), design.x, design.half_length, split)
            positions[spacing] = design.x
        found[name] = judges[spacing](design.at(positions[spacing])).compliance
    return found


@dataclass(frozen=True)
class Quantity:
    """What is computed by both methods: levels n of the grids and of the elements of both orders.

    `cells` of the grid at a level, and which points per cell the level `admits`; a level is run while points times
    nodes of a point are at most `weights`.
    """

    name: str
    points: MpmAnalysis
    elements: FemAnalysis
    levels: tuple[int, ...]
    element_levels: Mapping[int, tuple[int, ...]]
    arrangements: tuple[Crossing, ...]
    cells: Callable[[int], float]
    weights: int
    admits: Callable[[int, int], bool] = lambda n, ppc: True
