"""A beam bent to 80 % of its length by h, points per cell and number of steps; and a slender one by load."""

from functools import cache
from typing import NamedTuple

import numpy as np

from mpmtop.arrays import Array
from mpmtop.large_deformation.model import Model
from mpmtop.large_deformation.steps import Trajectory, trajectory
from validation.bodies.large import (
    GIMP,
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
"""Shear and the stretch of the length are left, 0.6 (d / L)^2 = 0.15 % at small load."""
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
    """Deflections (4,) by the arm at LOADS, by method, the elastica's first."""
    arm, levels = 19.5, np.array(LOADS) / LOADS[-1]
    found = {"elastica": np.array([elastica(load)[1] for load in LOADS])}
    found[Q2] = deflections_of_elements(elements_of(SLENDER, 1.0), levels) / arm
    for method in (TOTAL, TENT, GIMP, SPLINE):
        model = points_of(SLENDER, 0.5, 2, 10, method)
        found[method] = deflections(model, solid(model))[np.rint(10 * levels).astype(int) - 1] / arm
    return found
