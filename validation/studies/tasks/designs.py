"""What the sections have in common: a run by elements, its densities, and what the fine reference says of them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mpmtop.arrays import Array
from mpmtop.optimizers import Iterate
from mpmtop.scene import Scene
from reference_fem.reanalyse import Judge, build_judge, judge_criteria, thresholded
from reference_fem.simp import DesignProblem, Evaluation

RTOL = 1e-3
"""Of an optimum that stops at changes of 1e-4 or of 0.01 of a density: rounding may move the stop by an iteration."""


@dataclass(frozen=True, eq=False)
class Designed:
    """The end of a run by finite elements, one density for each."""

    scene: Scene
    problem: DesignProblem
    last: Iterate[Evaluation]

    @property
    def x(self) -> Array:
        """Centres of the elements (e, 2)."""
        return self.problem.model.centres

    @cached_property
    def half_length(self) -> Array:
        """Half of the elements' sides (e, 2): they are squares."""
        return np.repeat(np.sqrt(self.problem.model.area)[:, None] / 2, 2, axis=1)

    @property
    def rho(self) -> Array:
        """Densities (e,)."""
        return self.last.evaluation.rho

    @property
    def grayness(self) -> float:
        """4 mean(rho (1 - rho)): 0 of black and white, 1 of grey."""
        return grayness(self.rho)

    @cached_property
    def black(self) -> Array:
        """The densities (e,) cut to 0 and 1 at the same volume."""
        return thresholded(self.rho, self.problem.model.area)

    def judge(self, scene: Scene | None = None) -> Judge:
        """The fine reference for all designs on these elements; of another scene on the body if one is given."""
        return build_judge(scene or self.scene, self.x, self.half_length)


def judged(judge: Judge, rho: Array) -> Array:
    """Objectives (k,) of densities (e,) by the fine reference."""
    return judge_criteria(judge, rho, judge(rho)).objectives


def grayness(rho: Array) -> float:
    """4 mean(rho (1 - rho)) of densities on elements of one size."""
    return float(4 * np.mean(rho * (1 - rho)))
