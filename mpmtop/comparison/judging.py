"""Every design in truth: judged by biquadratic elements, one for each point, grey and cut to black and white."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mpmtop.arrays import Array
from mpmtop.comparison.asked import Asked
from mpmtop.comparison.methods import in_large_deformation
from mpmtop.errors import NotConverged, UnsupportedBody
from mpmtop.points import MaterialPoints
from reference_fem import simp
from reference_fem.reanalyse import build_judge, judge_criteria, owners

NO_EQUILIBRIUM = (NotConverged, UnsupportedBody)
"""What the judge says of a design whose load hangs on void: black and white ones do where a bar is too thin."""
FINER = 2
"""Elements along a point's side by which the judge's own error is told."""


class Truth(NamedTuple):
    """Objective, the largest of the constraints g <= 0 that the scene states beside the volume fraction, 0 if there are
    none, and the largest work of the loads in any case; not a number where the judge finds no equilibrium."""

    objective: float
    violation: float
    work: float


NOTHING = Truth(np.nan, 0.0, np.nan)


Judging = Callable[[Array], Truth]


def judge_of(asked: Asked, at: MaterialPoints, split: int = 1) -> Judging:
    """Judge for densities (p,) of points that own rectangles; `split` elements along each of their sides."""
    if asked.load_steps is not None:
        return _in_load_steps(asked, at)
    judge = build_judge(asked.scene, at.x, at.half_length, split=split)

    def judged(rho: Array) -> Truth:
        try:
            judgement = judge(rho)
            found = judge_criteria(judge, rho, judgement)
        except NO_EQUILIBRIUM:
            return NOTHING
        work = max(float(m.force(rho[judge.owner]) @ s.u) for m, s in zip(judge.models, judgement.states, strict=True))
        return Truth(found.objective, float(np.max(found.constraints, initial=0.0)), work)

    return judged


def _in_load_steps(asked: Asked, at: MaterialPoints) -> Judging:
    problem = in_large_deformation(simp.design_problem(asked.scene, asked.spacing, 2))
    owner = owners(problem.model.fem.centres, at.x, at.half_length)

    def judged(rho: Array) -> Truth:
        try:
            work = float(problem.analyse(rho[owner]).objective)
        except NO_EQUILIBRIUM:
            return NOTHING
        return Truth(work, 0.0, work)

    return judged


def cut_truth(asked: Asked, grey: Truth, cut: Truth) -> Truth:
    """The truth of a design in black and white; nothing where its load hangs on void.

    Loads that do 1 / sqrt(contrast) times the work that they do on the grey design hang on material as soft as that:
    what little bears them is void, and what is computed of it is rounding.
    """
    hangs = not cut.work * np.sqrt(asked.scene.design.contrast) <= grey.work
    return NOTHING if hangs else cut
