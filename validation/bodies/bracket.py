"""Stress on a path of the L-bracket."""

from functools import cache

import numpy as np
from skfem import CellBasis, LinearForm, MeshQuad

from mpmtop.arrays import Array
from mpmtop.body import Body, Material, Support
from mpmtop.crossing import Crossing
from mpmtop.equilibrium import equilibrium
from mpmtop.loads import RegionLoad
from mpmtop.material import tangent
from mpmtop.region import Difference, Rectangle
from mpmtop.shape_functions import ShapeFunction
from reference_fem import elasticity
from reference_fem.boundary import locate_in_lattice, locate_in_mesh
from reference_fem.elasticity import FemModel, fem_model, minimum_degree_elimination
from reference_fem.mesh import GEOMETRY_TOLERANCE, domain_lattice, vector_basis
from validation.bodies.crossing import points_model
from validation.measures.outcome import Measure, Outcome, of_elements, of_points
from validation.measures.probe import strain_at

BRACKET_SIDE = 50.0
"""Side of the L-bracket in units of its own h; its arms are 20 wide."""


BRACKET = Material(young=1.0, poisson=0.3, plane="strain")


ALONG = (np.arange(96) + 0.382) / 96


PATH = np.stack([4 + 12 * ALONG, 33 + 4 * ALONG], axis=1)
"""Positions (96, 2) [h] on a line from (4h, 33h) to (16h, 37h) across the vertical arm, away from the corner at
(20h, 20h). It is oblique and its positions lie on no line of any grid, so that no place within a cell is preferred."""


def bracket_body(n: int) -> Body:
    """The L-bracket, n cells or elements along its side, n a multiple of five; a unit force down is spread over the
    last 10h x 10h of the lower arm, the same for every discretisation."""
    size, corner = float(n), 0.4 * n
    return Body(
        Difference(Rectangle((0.0, 0.0), (size, size)), Rectangle((corner, corner), (size, size))),
        (Support(Rectangle((-np.inf, size), (np.inf, np.inf))),),
        (RegionLoad(loaded_part(n), (0.0, -1.0)),),
        BRACKET,
    )


def loaded_part(n: int) -> Rectangle:
    """The last 10h x 10h of the lower arm."""
    return Rectangle((0.8 * n, 0.2 * n), (float(n), 0.4 * n))


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
    model = points_model(bracket_body(n), shape_function, ppc, crossing)
    state = equilibrium(model, np.ones(len(model.points.x)))

    def outcome() -> Outcome:
        strain = model.at(PATH * n / BRACKET_SIDE, 0.5 / ppc).strain(state.u)
        return of_points(model, path_error(n * strain @ model.D))

    return outcome


def bracket_solution(n: int, mesh: MeshQuad, order: int) -> tuple[FemModel, Array]:
    """Model of the bracket on a mesh with lines at the edges of the loaded part, and stress (96, 3) on the path."""
    body, basis = bracket_body(n), vector_basis(mesh, order)
    loaded = loaded_part(n).contains(mesh.p[:, mesh.t].mean(axis=1).T)
    part = CellBasis(mesh, basis.elem, intorder=2 * order, elements=np.flatnonzero(loaded), dofs=basis.dofs)
    f = LinearForm(lambda v, w: -v[1]).assemble(part) / part.dx.sum()
    graded = np.ptp(np.diff(np.unique(mesh.p[0]))) > GEOMETRY_TOLERANCE
    model = fem_model(body, basis, f, *([minimum_degree_elimination] if graded else []))
    u = elasticity.solve(model, np.ones(len(model.area)))
    x = PATH * n / BRACKET_SIDE
    return model, n * strain_at(model, u, x, (locate_in_mesh if graded else locate_in_lattice)) @ tangent(BRACKET)


def bracket_elements(n: int, order: int) -> Measure:
    """The same by elements of side 1."""
    model, stress = bracket_solution(n, domain_lattice(bracket_body(n).domain, np.ones(2)), order)
    return lambda: of_elements(model, path_error(stress))


@cache
def bracket_reference(per_h: float = 1) -> Array:
    """Stress (96, 3) by biquadratic elements of side h / per_h, halved ten times towards the corner's lines."""
    corner = 0.4 * BRACKET_SIDE
    near = 0.5 ** np.arange(1, 11) / per_h
    lines = np.linspace(0, BRACKET_SIDE, round(BRACKET_SIDE * per_h) + 1)
    lines = np.sort(np.concatenate([lines, corner - near, corner + near]))
    mesh = MeshQuad.init_tensor(lines, lines)
    domain = bracket_body(round(BRACKET_SIDE)).domain
    kept = np.flatnonzero(domain.contains(mesh.p[:, mesh.t].mean(axis=1).T))
    return bracket_solution(round(BRACKET_SIDE), mesh.restrict(kept), 2)[1]
