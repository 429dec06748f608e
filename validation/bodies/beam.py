"""Timoshenko's cantilever: its closed form, and its analyses under the exact tractions."""

from typing import NamedTuple

import numpy as np

from mpmtop.arrays import Array
from mpmtop.body import Body, Material, Support
from mpmtop.crossing import Crossing
from mpmtop.equilibrium import equilibrium
from mpmtop.loads import PositionLoad
from mpmtop.region import Rectangle
from mpmtop.shape_functions import ShapeFunction
from reference_fem import elasticity
from validation.bodies.crossing import points_model
from validation.measures.outcome import Measure, Outcome, of_elements, of_points
from validation.measures.probe import displacement_at

BEAM = Material(young=1.0, poisson=0.3, plane="stress")
"""That of the study; every function of the closed form takes another one, of plane strain as well."""


SLENDER = 4
"""Length of Timoshenko's cantilever over its depth."""


def in_plane(material: Material) -> tuple[float, float]:
    """E and nu of plane stress, E / (1 - nu^2) and nu / (1 - nu) in plane strain: Hooke's law in the plane is alike."""
    E, nu = material.young, material.poisson
    return (E, nu) if material.plane == "stress" else (E / (1 - nu**2), nu / (1 - nu))


class BeamFields(NamedTuple):
    """u (p, 2) and stress (p, 3) in Voigt order."""

    u: Array
    stress: Array


def beam(x: Array, depth: float, material: Material = BEAM) -> BeamFields:
    """Timoshenko's cantilever at x (p, 2): 0 <= X <= L = 4 depth, 0 <= Y <= depth, unit force down at X = L.

    With y = Y - depth/2, I = depth^3 / 12, c = depth/2, and E and nu as `in_plane` gives them:

        u_x = y / 6EI ((6L - 3X) X + (2 + nu)(y^2 - c^2)),   sigma_xx = (L - X) y / I,  sigma_yy = 0,
        u_y = -1 / 6EI (3 nu y^2 (L - X) + (4 + 5 nu) c^2 X + (3L - X) X^2),  sigma_xy = -(c^2 - y^2) / 2I.

    The point (0, depth/2) stays, and (0, 0) and (0, depth) stay in x. Source: Timoshenko and Goodier, Theory of
    Elasticity, Sect. 21, with this clamp as in Augarde and Deeks (2008), Finite Elem. Anal. Des. 44:595.
    """
    (E, nu), L, c, i = in_plane(material), SLENDER * depth, depth / 2, depth**3 / 12
    X, y = x[:, 0], x[:, 1] - c
    u_x = y / (6 * E * i) * ((6 * L - 3 * X) * X + (2 + nu) * (y**2 - c**2))
    u_y = -(3 * nu * y**2 * (L - X) + (4 + 5 * nu) * c**2 * X + (3 * L - X) * X**2) / (6 * E * i)
    stress = np.stack([(L - X) * y / i, np.zeros_like(X), -(c**2 - y**2) / (2 * i)], axis=1)
    return BeamFields(np.stack([u_x, u_y], axis=1), stress)


def beam_energy(depth: float, material: Material = BEAM) -> float:
    """Strain energy: bending L^3 / 6EI and shear 6 (1 + nu) L / 5 E depth."""
    (E, nu), L, i = in_plane(material), SLENDER * depth, depth**3 / 12
    return L**3 / (6 * E * i) + 6 * (1 + nu) * L / (5 * E * depth)


def beam_body(n: int, material: Material = BEAM) -> Body:
    """The beam, n deep and n even, on the supports of its closed form and under its tractions."""
    at_left = [
        Support(Rectangle((0.0, y), (0.0, y)), fixed) for y, fixed in ((n / 2, (True, True)), (n, (True, False)))
    ]
    tractions = tuple(
        PositionLoad((x, y), (fx, fy))
        for (x, y), (fx, fy) in zip(*(a.tolist() for a in beam_tractions(n)), strict=True)
    )
    return Body(Rectangle((0.0, 0.0), (float(SLENDER * n), float(n))), tuple(at_left), tractions, material)


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


def tip_error(at: Array, n: int, material: Material = BEAM) -> float:
    """Relative error of the tip's deflection, negative if too stiff, by displacements (3, 2) at `beam_places`.

    A rigid motion off the closed form's supports is removed: a B-spline's coefficient, which a support holds, is not
    the value there.
    """
    base, top, tip = at
    rotation = -(top[0] - base[0]) / (n / 2)
    deflection = tip[1] - base[1] - rotation * SLENDER * n
    return float(deflection / beam(beam_places(n), n, material).u[2, 1]) - 1


def beam_errors(at: Array, energy: float, n: int, material: Material = BEAM) -> dict[str, float]:
    """Errors by displacements (3, 2) at `beam_places` and the strain energy."""
    return {
        "tip displacement": abs(tip_error(at, n, material)),
        "strain energy": abs(energy / beam_energy(n, material) - 1),
    }


def beam_places(n: int) -> Array:
    """Middle and top of the clamped end, middle of the loaded one (3, 2)."""
    return np.array([(0.0, n / 2), (0.0, n), (SLENDER * n, n / 2)])


def beam_points(n: int, shape_function: ShapeFunction, ppc: int, crossing: Crossing) -> Measure:
    """Timoshenko's cantilever with n cells over its depth."""
    model = points_model(beam_body(n), shape_function, ppc, crossing)
    state = equilibrium(model, np.ones(len(model.points.x)))

    def outcome() -> Outcome:
        at = model.at(beam_places(n)).displacement(state.u)
        return of_points(model, beam_errors(at, float(model.f_ext @ state.u) / 2, n))

    return outcome


def beam_elements(n: int, order: int) -> Measure:
    """Timoshenko's cantilever with n elements over its depth."""
    model = elasticity.discretise(beam_body(n), 1.0, order)
    u = elasticity.solve(model, np.ones(len(model.area)))
    at = displacement_at(model, u, beam_places(n))
    return lambda: of_elements(model, beam_errors(at, float(model.f_ext @ u) / 2, n))
