"""Points that cross by themselves, in a body that bends, beside points pushed over boundaries at small strain."""

from typing import NamedTuple

import numpy as np

from mpmtop.arrays import Array, Index
from mpmtop.equilibrium import equilibrium
from mpmtop.large_deformation.law import kirchhoff, stress
from mpmtop.large_deformation.model import Model
from mpmtop.large_deformation.step import State
from mpmtop.model import discretise
from mpmtop.points import MaterialPoints, seed
from mpmtop.shape_functions import ShapeFunction
from reference_fem import elasticity
from reference_fem.large_deformation import LargeModel, load_steps
from validation.bodies.large import GIMP, METHODS, SPLINE, TENT, TOTAL, deflections, elements_of, points_of
from validation.studies.large_deformation.levels import BENT, solid

STEPS = 8
H = 0.5
PUSH = 0.26
"""Of a cell: from a quarter before a boundary to a hundredth beyond it, the paper's."""
EVERY = (8, 4, 2, 1)
"""Boundaries between those that a column of points is pushed over."""
ENDS = 1.0
"""Clamp and load are singular: points this near to the ends are left out of the stress."""


class Crossed(NamedTuple):
    """Share of the points that have left their cells; error of the load's deflection, and of the stress, root of the
    mean square by that of the reference's."""

    share: float
    tip: float
    stress: float


def real_crossing() -> dict[str, list[Crossed]]:
    """The bent beam by 2 x 2 points, at every step; the stress is Kirchhoff's."""
    fem = elements_of(BENT, H / 2)  # its elements have their centres where the points are
    levels = np.arange(1, STEPS + 1) / STEPS
    u = list(load_steps(fem, np.ones(len(fem.fem.area)), levels))
    found = {}
    for method in (TOTAL, TENT, GIMP, SPLINE):
        model = points_of(BENT, H, 2, STEPS, method)
        order = _same_places(fem.fem.centres, model.points.x)
        path = solid(model)
        tips = deflections(model, path)
        found[method] = [
            Crossed(
                _left(model, path.states[n].x),
                float(tips[n - 1] * fem.fem.f_ext.sum() / -(fem.fem.f_ext @ u[n - 1]) - 1),
                _error(_tau(model, path.states[n]), _tau_of_elements(model, fem, u[n - 1])[order], model.points.x),
            )
            for n in range(1, STEPS + 1)
        ]
    return found


def induced_crossing() -> dict[str, list[Crossed]]:
    """The beam at small strain, columns of its points pushed over every eighth, fourth, second and each boundary."""
    fem = elements_of(BENT, H / 2).fem
    moduli = np.ones(len(fem.area))
    u = elasticity.solve(fem, moduli)
    points = seed(BENT.domain, (H / 2, H / 2))
    exact = elasticity.stress(fem, u, moduli)[:, 0, :3][_same_places(fem.centres, points.x)]
    compliance = float(fem.f_ext @ u)
    return {
        method: [_pushed(points, every, METHODS[method]["shape_function"], exact, compliance) for every in EVERY]
        for method in (TENT, GIMP, SPLINE)
    }


def _pushed(
    points: MaterialPoints, every: int, shape_function: ShapeFunction, exact: Array, compliance: float
) -> Crossed:
    x = points.x[:, 0]
    boundary = np.rint(x / H)  # the one ahead of a column that stands a quarter of a cell before it
    ahead = np.isclose(x, (boundary - 0.25) * H) & (boundary % every == 0)
    ahead &= x < BENT.domain.bounds[1][0] - ENDS  # the loaded points keep their number
    model = discretise(BENT, H, points=points.moved(np.outer(ahead, [PUSH * H, 0.0])), shape_function=shape_function)
    state = equilibrium(model, np.ones(len(x)))
    found = model.stress(state.moduli, state.strain)
    return Crossed(float(np.mean(ahead)), float(model.f_ext @ state.u) / compliance - 1, _error(found, exact, points.x))


def _same_places(centres: Array, x: Array) -> Index:
    """Which of the elements (e, 2) has its centre at each of the points x (p, 2)."""
    here, there = (np.lexsort(np.rint(8 * at / H).astype(int).T) for at in (x, centres))
    order = np.empty(len(x), dtype=np.intp)
    order[here] = there
    return order


def _tau(model: Model, state: State) -> Array:
    tau = kirchhoff(stress(model.law, state.F), state.F)
    return np.stack([tau[:, 0, 0], tau[:, 1, 1], tau[:, 0, 1]], axis=1)


def _tau_of_elements(model: Model, fem: LargeModel, u: Array) -> Array:
    """Kirchhoff stress (e, 3) at the elements' centres."""
    gradient = np.asarray(fem.fem.basis.interpolate(u).grad)[..., 0]  # (2, 2, e): the centre is its only point
    F = np.moveaxis(gradient, 2, 0) + np.eye(2)
    tau = kirchhoff(stress(model.law, F), F)
    return np.stack([tau[:, 0, 0], tau[:, 1, 1], tau[:, 0, 1]], axis=1)


def _error(found: Array, exact: Array, X: Array) -> float:
    inner = (X[:, 0] > ENDS) & (X[:, 0] < BENT.domain.bounds[1][0] - ENDS)
    weight = np.array([1.0, 1.0, 2.0])  # of the tensor's entries
    return float(np.sqrt(np.sum(weight * (found - exact)[inner] ** 2) / np.sum(weight * exact[inner] ** 2)))


def _left(model: Model, x: Array) -> float:
    start, end = (np.floor(model.grid.cell_coordinates(at)) for at in (model.points.x, x))
    return float(np.mean(np.any(start != end, axis=1)))
