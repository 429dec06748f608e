"""Cantilevers by the choices that the paper leaves open: load, filter radius, update rule, start, crossing."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from joblib import Parallel, delayed

from mpmtop.arrays import Array
from mpmtop.optimizers import GCMMA, MMA, SingleStepGCMMA, UpdateRule, optimize
from validation.bodies.crossing import Bump, Crossing, Periodic, Uniform, Wave
from validation.bodies.scenes import SPACING, TipLoad, cantilever
from validation.methods.analyser import JOBS, MOVE, SHAPE_FUNCTIONS, Analyser, Optimisation, material_points

RULES: dict[str, UpdateRule] = {
    "GCMMA": GCMMA(move=MOVE),
    "GCMMA, warm": GCMMA(move=MOVE, warm_start=True),
    "GCMMA, single step": SingleStepGCMMA(move=MOVE),
    "MMA": MMA(move=MOVE),
}
RADII = (2.0, 2.2, 2.3, 2.5, 3.0)
"""Filter radii in point spacings."""
SEEDS = (0, 1, 2, 3)
"""Starts of the scatter: 0 is the uniform one."""
WAVES = 4
"""Cosines of a start."""
FAMILIES: dict[str, tuple[Crossing, ...]] = {
    "uniform(s)": tuple(Uniform(s) for s in (0.26, 0.3, 0.4, 0.5, 0.6, 0.7, 0.74)),
    "periodic(n, 0.26)": tuple(Periodic(n) for n in (2, 3, 4, 5, 6, 8)),
    "wave(n, 0.26)": tuple(Wave(n) for n in (5, 6, 7, 8, 9, 10, 12, 16, 20)),
    "bump(4, w, 0.26)": tuple(Bump(4, w) for w in (0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0)),
}
"""Members of each family; none wider than half the distance of the bumps, where their sum is next to a shift."""


class Base(NamedTuple):
    """A cantilever: where the force acts, filter radius in point spacings, update rule by name."""

    load: TipLoad
    radius: float
    rule: str = "GCMMA"


BASES = (Base("mid-height", 3.0), Base("bottom corner", 2.3))
"""The study's own cantilever, and the second: the radius among `RADII` that brings it nearest to 83.57."""


def start(seed: int, volume_fraction: float = 0.4) -> Callable[[Array], Array]:
    """Densities of a start as a function of the positions (n, 2), the same field on any points: the volume fraction
    times 1 plus cosines of random direction, wave length (10 h and more) and phase, of 1/2 at most in all."""
    rng = np.random.default_rng(seed)
    k, phase = rng.uniform(-2 * np.pi / 10, 2 * np.pi / 10, (2, WAVES)), rng.uniform(0, 2 * np.pi, WAVES)
    size = 0.5 * (seed > 0) / WAVES

    def field(x: Array) -> Array:
        return volume_fraction * (1 + size * np.sum(np.cos(x @ k + phase), axis=1))

    return field


def build(base: Base, name: str = "standard", crossing: Crossing | None = None) -> Analyser:
    """The cantilever by a method."""
    return material_points(SHAPE_FUNCTIONS[name], name, crossing)(cantilever(base.load, base.radius * SPACING))


def optimise(base: Base, name: str = "standard", crossing: Crossing | None = None, seed: int = 0) -> Optimisation:
    """One run."""
    analyser = build(base, name, crossing)
    return Optimisation.collect(
        optimize(analyser.problem, RULES[base.rule], start=start(seed), max_iterations=300), analyser
    )


def tip(base: Base, name: str, crossing: Crossing | None = None) -> float:
    """Tip displacement of the solid."""
    analyser = build(base, name, crossing)
    return float(analyser.problem.analyse(np.ones(len(analyser.x))).objective)


def optima(cases: list[tuple[Base, str, Crossing | None, int]]) -> list[Optimisation]:
    """Every case: base, method, crossing, seed of the start."""
    return Parallel(n_jobs=JOBS)(delayed(optimise)(*case) for case in cases)
