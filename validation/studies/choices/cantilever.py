"""Cantilevers by the choices that the paper leaves open: load, filter radius, update rule, start, crossing."""

from typing import NamedTuple

import numpy as np
from joblib import Parallel, delayed

from mpmtop.crossing import Crossing
from mpmtop.optimizers import GCMMA, MMA, SingleStepGCMMA, UpdateRule, optimize
from validation.bodies.scenes import SPACING, TipLoad, cantilever
from validation.bodies.starts import cosines
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


class Base(NamedTuple):
    """A cantilever: where the force acts, filter radius in point spacings, update rule by name."""

    load: TipLoad
    radius: float
    rule: str = "GCMMA"


BASES = (Base("mid-height", 3.0), Base("bottom corner", 2.3))
"""The study's own cantilever, and the second: the radius among `RADII` that brings it nearest to 83.57."""


def build(base: Base, name: str = "standard", crossing: Crossing | None = None) -> Analyser:
    """The cantilever by a method."""
    return material_points(SHAPE_FUNCTIONS[name], name, crossing)(cantilever(base.load, base.radius * SPACING))


def optimise(base: Base, name: str = "standard", crossing: Crossing | None = None, seed: int = 0) -> Optimisation:
    """One run."""
    analyser = build(base, name, crossing)
    return Optimisation.collect(
        optimize(analyser.problem, RULES[base.rule], start=cosines(seed), max_iterations=300), analyser
    )


def tip(base: Base, name: str, crossing: Crossing | None = None) -> float:
    """Tip displacement of the solid."""
    analyser = build(base, name, crossing)
    return float(analyser.problem.analyse(np.ones(len(analyser.x))).objective)


def optima(cases: list[tuple[Base, str, Crossing | None, int]]) -> list[Optimisation]:
    """Every case: base, method, crossing, seed of the start."""
    return Parallel(n_jobs=JOBS)(delayed(optimise)(*case) for case in cases)
