"""A beam bent to 80 % of its length by h, points per cell and number of steps; and a slender one by load."""

from functools import cache
from typing import NamedTuple

import numpy as np

from mpmtop.arrays import Array
from mpmtop.body import Body, Material, Support
from mpmtop.large_deformation.model import Model
from mpmtop.large_deformation.steps import Trajectory, trajectory
from mpmtop.loads import PositionLoad
from mpmtop.region import Rectangle
from reference_fem.elasticity import discretise
from reference_fem.large_deformation import LogarithmicLaw, large_model, load_steps
from validation.bodies.large import (
    GIMP,
    INF,
    Q2,
    SPLINE,
    TENT,
    TOTAL,
    beam,
    deflections,
    deflections_of_elements,
    elastica,
    elements_of,
    points_of,
)

BENT = beam(10.0, 0.2, 10.0, 0.5)
"""AMPLE's proportions and its 100 kN: P L^2 / EI = 10."""
SLENDER = beam(20.0, 0.0, 10.0, 1.0)
LOADS = (1.0, 2.0, 5.0, 10.0)


class Bent(NamedTuple):
    """Deflection of the load by its arm; most Newton steps and parts of a load step."""

    deflection: float
    newton: int
    parts: int


def solid(model: Model) -> Trajectory:
    """The trajectory of a body of solid material."""
    return trajectory(model, np.full(len(model.points.x), model.young))


@cache
def bent(method: str, h: float, ppc: int, steps: int) -> Bent:
    """The beam by a method."""
    model = points_of(BENT, h, ppc, steps, method)
    path = solid(model)
    return Bent(float(deflections(model, path)[-1]) / 9.75, max(path.newton_steps), max(path.parts))


@cache
def bent_elements(h: float, order: int = 2) -> float:
    """The same by finite elements: nothing depends on the steps."""
    return float(deflections_of_elements(elements_of(BENT, h, order), np.arange(1, 6) / 5)[-1]) / 9.75


def slender() -> dict[str, Array]:
    """Deflection (4,) by the arm at LOADS, by method."""
    found = {Q2: slender_elements(SLENDER)}
    for method in (TOTAL, TENT, GIMP, SPLINE):
        found[method] = slender_points(method)
    found[f"{GIMP}, background of 1e-7"] = slender_points(GIMP, alpha=1e-7)
    return found


def slender_elements(body: Body) -> Array:
    """By one biquadratic element over the depth."""
    arm = body.domain.bounds[1][0] - 0.5
    return deflections_of_elements(elements_of(body, 1.0), np.array(LOADS) / LOADS[-1]) / arm


def hair_elements() -> float:
    """Largest |relative difference| to the elastica, along and across, at LOADS: L / d = 100, nu = 0, the load at the
    middle of the tip, by biquadratic elements of 2 x 1."""
    L = 100.0
    tip = PositionLoad((L, 0.5), (0.0, -LOADS[-1] / 12 / L**2))
    clamp = Support(Rectangle((-INF, -INF), (0.0, INF)))
    body = Body(Rectangle((0.0, 0.0), (L, 1.0)), (clamp,), (tip,), Material(1.0, 0.0))
    model = large_model(discretise(body, (2.0, 1.0), 2), LogarithmicLaw(0.0))
    at = np.flatnonzero(np.all(np.isclose(model.basis.doflocs.T, [L, 0.5]), axis=1))
    path = load_steps(model, np.ones(len(model.fem.area)), np.array(LOADS) / LOADS[-1])
    return max(float(np.abs(-u[at] / L / elastica(load) - 1).max()) for load, u in zip(LOADS, path, strict=True))


def slender_points(method: str, **how: float) -> Array:
    """By 2 x 2 points per cell, two cells over the depth, ten steps."""
    model = points_of(SLENDER, 0.5, 2, 10, method, **how)
    return deflections(model, solid(model))[np.rint(LOADS).astype(int) - 1] / 19.5
