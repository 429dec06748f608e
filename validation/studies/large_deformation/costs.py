"""CPU seconds of load steps by GIMP, of their gradient, of one linear analysis, and of elements, by size."""

import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np

from mpmtop.equilibrium import equilibrium
from mpmtop.grid import Grid
from mpmtop.large_deformation.model import discretise
from mpmtop.large_deformation.objectives import EndCompliance, gradient
from mpmtop.large_deformation.steps import trajectory
from mpmtop.model import discretise as discretise_small
from mpmtop.shape_functions import gimp
from reference_fem import elasticity
from reference_fem.large_deformation import load_steps
from validation.bodies.large import GIMP, METHODS, elements_of
from validation.studies.large_deformation.smooth import moduli, short

STEPS = 8
REPEATS = 3
Found = TypeVar("Found")


class Spent(NamedTuple):
    """CPU seconds, medians; Newton steps of all load steps; NaN where elements are left out."""

    points: int
    linear: float
    forward: float
    gradient: float
    newton: int
    elements: float
    linear_elements: float


def spent(h: float, *, elements: bool, repeats: int = REPEATS) -> Spent:
    """The cantilever of the line of designs on cells of side h, 2 x 2 points in each, with other moduli every time: no
    step has the stencils of one before, as in an optimisation. Elements: a bilinear one for each point."""
    cells = np.rint([40 / h, 46 / h]).astype(int)
    model = discretise(short(), steps=STEPS, grid=Grid((-8.0, -20.0), (h, h), (cells[0], cells[1])), **METHODS[GIMP])
    small = discretise_small(short(), h, 2, shape_function=gimp)
    E, direction = moduli(model)
    times, newton = [], 0
    for k in range(repeats):
        E_k = E + k * direction
        path, forward = _timed(partial(trajectory, model, E_k))
        _, back = _timed(partial(gradient, EndCompliance(), model, path, E_k))
        _, linear = _timed(partial(equilibrium, small, E_k))
        times.append((linear, forward, back))
        newton = sum(path.newton_steps)
    by_elements = by_linear = float("nan")
    if elements:
        fem = elements_of(short(), h / 2, 1)
        field = E[0] * np.ones(len(fem.fem.area))
        levels = np.arange(1, STEPS + 1) / STEPS
        by_elements = _timed(lambda: list(load_steps(fem, field, levels)))[1]
        by_linear = _timed(lambda: elasticity.solve(fem.fem, field))[1]
    linear, forward, back = (float(np.median(each)) for each in zip(*times, strict=True))
    return Spent(len(E), linear, forward, back, newton, by_elements, by_linear)


def _timed(call: Callable[[], Found]) -> tuple[Found, float]:
    start = time.process_time()
    found = call()
    return found, time.process_time() - start
