"""True objective against CPU seconds and solves: the cantilever by rules, from a uniform start and by levels."""

from collections.abc import Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np

from mpmtop.arrays import Array
from mpmtop.optimizers import GCMMA, MMA, OptimalityCriteria, Stage, UpdateRule, continuation
from mpmtop.problem import design_problem
from mpmtop.scene import Scene
from reference_fem.reanalyse import build_judge
from validation.bodies.scenes import SPACING, H, cantilever
from validation.methods.analyser import MOVE

RULES: dict[str, UpdateRule] = {
    "GCMMA": GCMMA(MOVE),
    "GCMMA, warm": GCMMA(MOVE, warm_start=True),
    "GCMMA, one solve": GCMMA(MOVE, max_inner=1),
    "MMA, move limit 0.05": MMA(0.05),
    "MMA, move limit 0.2": MMA(0.2),
    "optimality criteria": OptimalityCriteria(0.2),
}
APART = 1.25
"""Of designs that are judged, the number of iterations by that of the one before."""


@dataclass(frozen=True, eq=False)
class Track:
    """Designs that a run came through: CPU seconds and solves up to each, operators of all levels included, its own
    objective and the true one (k,)."""

    seconds: Array
    solves: Array
    own: Array
    true: Array

    def seconds_to(self, objective: float) -> float:
        """CPU seconds up to the first whose true objective is no larger, NaN if none is."""
        return float(np.append(self.seconds[self.true <= objective], np.nan)[0])

    def solves_to(self, objective: float) -> float:
        """Solves up to it, NaN if there is none."""
        return float(np.append(self.solves[self.true <= objective], np.nan)[0])


def track(nx: int, levels: Sequence[int], rule: UpdateRule, iterations: Sequence[int], order: int) -> Track:
    """The cantilever with nx points along it, after those with `levels` along it, coarsest first, so many iterations
    each; its designs judged by elements of an order, one for each point. The filter's radius is the paper's length."""
    began = process_time()
    scene = cantilever()
    problems = [design_problem(scene, 2 * SPACING * 80 / n * H, 2) for n in (*levels, nx)]
    stages = [Stage(p, rule, lambda history: False, last) for p, last in zip(problems, iterations, strict=True)]
    kept: list[Kept] = []
    due = 0.0
    for iterate in continuation(stages):
        if iterate.stage == len(levels) and (iterate.iteration >= due or iterate.outcome != "running"):
            due = APART * iterate.iteration
            spent = process_time() - began
            kept.append((spent, iterate.solves, iterate.objective, iterate.evaluation.rho))
    points = problems[-1].model.points
    return judged(scene, kept, points.x, points.half_length, order)


Kept = tuple[float, int, float, Array]
"""CPU seconds and solves up to a design, its own objective, its physical densities (p,)."""


def judged(scene: Scene, kept: Sequence[Kept], x: Array, half_length: Array, order: int = 2) -> Track:
    """What a run has kept, with the true objectives of its designs, which own rectangles at x (p, 2)."""
    seconds, solves, own, rho = zip(*kept, strict=True)
    judge = build_judge(scene, x, half_length, split=1, order=order)
    return Track(np.array(seconds), np.array(solves), np.array(own), np.array([judge(r).compliance for r in rho]))
