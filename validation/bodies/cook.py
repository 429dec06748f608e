"""Cook's membrane."""

from functools import cache

import numpy as np
from skfem import MeshQuad

from mpmtop.arrays import Array
from mpmtop.body import Body, Material, Support
from mpmtop.crossing import Crossing
from mpmtop.equilibrium import equilibrium
from mpmtop.loads import RegionLoad
from mpmtop.region import Polygon, Rectangle
from mpmtop.shape_functions import ShapeFunction, gimp, tent
from reference_fem import elasticity
from reference_fem.boundary import locate_in_mesh, nodal_forces
from reference_fem.elasticity import FemModel, fem_model, minimum_degree_elimination
from reference_fem.mesh import vector_basis
from validation.bodies.crossing import points_model
from validation.measures.outcome import Measure, Outcome, of_elements, of_points
from validation.measures.probe import displacement_at

COOK = Material(young=1.0, poisson=1 / 3, plane="stress")


COOK_CORNERS = np.array([(0.0, 0.0), (48.0, 44.0), (48.0, 60.0), (0.0, 44.0)])


COOK_TIP = np.array([(48.0, 52.0)])


CLAMP = Support(Rectangle((-np.inf, -np.inf), (0.0, np.inf)))
COOK_REFERENCE = 23.96
"""Displacement at (48, 52) in common use."""


def cook_body(scale: float, spacing: float = 1.0) -> Body:
    """Cook's membrane, clamped at its left edge, a unit force up on the last column of points."""
    corners = tuple((float(x), float(y)) for x, y in COOK_CORNERS * scale)
    last = RegionLoad(Rectangle((48 * scale - spacing, 0.0), (48 * scale, np.inf)), (0.0, 1.0))
    return Body(Polygon(corners), (CLAMP,), (last,), COOK)


def cook_points(n: int, shape_function: ShapeFunction, ppc: int, crossing: Crossing, ghost: float = 0.01) -> Measure:
    """Cook's membrane on n cells along x; the slanted edges cut cells. Ghost penalty for tent and GIMP."""
    scale = n / 48
    body = cook_body(scale, 1 / ppc)
    model = points_model(body, shape_function, ppc, crossing, ghost if shape_function in (tent, gimp) else 0.0)
    state = equilibrium(model, np.ones(len(model.points.x)))

    def outcome() -> Outcome:
        tip = model.at(COOK_TIP * scale).displacement(state.u)[0, 1]
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
    model = fem_model(cook_body(1.0), basis, f, minimum_degree_elimination)
    u = elasticity.solve(model, np.ones(len(model.area)))
    return model, float(displacement_at(model, u, COOK_TIP)[0, 1])


def cook_elements(n: int, order: int) -> Measure:
    """Cook's membrane by n x n quads."""
    lines = np.linspace(0, 1, n + 1)
    model, tip = cook_solution(cook_mesh(lines, lines), order)
    return lambda: of_elements(model, {"tip displacement": abs(tip / cook_reference() - 1)})


@cache
def cook_reference(n: int = 32) -> float:
    """Displacement at (48, 52) by n x n biquadratic elements that crowd towards the corners of the clamped edge."""
    t = np.linspace(0, 1, n + 1)
    return cook_solution(cook_mesh(t**2, t**2 * (3 - 2 * t)), 2)[1]
