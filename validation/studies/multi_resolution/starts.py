"""Every resolution from several starts by two rules: a spread in the place of one run."""

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from mpmtop.optimizers import GCMMA, SingleStepGCMMA, UpdateRule, optimize
from mpmtop.points import MaterialPoints
from reference_fem.reanalyse import Judge, build_judge
from validation.bodies.scenes import H, changed, distributed_load
from validation.bodies.starts import cosines
from validation.methods.analyser import JOBS, MOVE, Optimisation
from validation.studies.multi_resolution.resolutions import FINE, leaves, overlapping, remapped, standard

RULES: dict[str, UpdateRule] = {"GCMMA": GCMMA(move=MOVE), "GCMMA, single step": SingleStepGCMMA(move=MOVE)}
SEEDS = tuple(range(6))
"""Starts: 0 is the uniform one."""
LENGTH, SPACINGS = "radius h", "radius of three own spacings"
"""What is the same at every resolution: a length, or a number of the finest spacings."""
RADII: dict[str, dict[str, float]] = {
    LENGTH: dict.fromkeys(("low", "multi, quadtree", "multi, paper", "high"), H),
    SPACINGS: {"low": 1.0 * H} | dict.fromkeys(("multi, quadtree", "multi, paper", "high"), 3 * FINE),
}
SOFT = 1e-4
"""E_min / E0 of the fine reference, as in the sweep of radii: a load that hangs on void has a finite compliance."""


class Outcome(NamedTuple):
    """One run: compliance by its own analysis and by the fine reference, and its iterations."""

    own: float
    true: float
    iterations: int


class Case(NamedTuple):
    """A run: resolution, filter radius [h], rule, seed of the start."""

    resolution: str
    radius: float
    rule: str
    seed: int


@cache
def points() -> dict[str, MaterialPoints]:
    """The points of every resolution."""
    return {name: tree.points() for name, tree in leaves().items()} | {"multi, paper": overlapping()}


@cache
def judge() -> Judge:
    """A biquadratic element for each of the high resolution's points, on void of `SOFT`: some designs hang on it."""
    high = points()["high"]
    return build_judge(changed(distributed_load(), contrast=SOFT), high.x, high.half_length, split=1)


def outcome(case: Case) -> Outcome:
    """One run; a function of the module, for joblib."""
    analyser = standard(points()[case.resolution], case.radius)
    iterates = optimize(analyser.problem, RULES[case.rule], start=cosines(case.seed), max_iterations=300)
    run = Optimisation.collect(iterates, analyser)
    return Outcome(run.final, judge()(remapped(run.design, points()["high"])).compliance, run.iterations)


def computed(filtered: str) -> dict[Case, Outcome]:
    """Every resolution by every rule from every start, with one of the filters."""
    cases = [Case(name, radius, rule, k) for name, radius in RADII[filtered].items() for rule in RULES for k in SEEDS]
    return dict(zip(cases, Parallel(n_jobs=JOBS)(delayed(outcome)(case) for case in cases), strict=True))


class Spread(NamedTuple):
    """Best, mean, median, worst and standard deviation of some runs."""

    best: float
    mean: float
    median: float
    worst: float
    deviation: float

    @classmethod
    def of(cls, values: Sequence[float]) -> "Spread":
        """Of so many values."""
        mean, deviation = float(np.mean(values)), float(np.std(values, ddof=1))
        return cls(min(values), mean, float(np.median(values)), max(values), deviation)


Found = dict[str, dict[str, Spread]]
"""By resolution, of the "own" and of the "true" compliance."""


def spreads(done: dict[Case, Outcome]) -> Found:
    """Over the runs of each resolution."""
    names = dict.fromkeys(case.resolution for case in done)
    return {
        name: {
            kind: Spread.of([getattr(o, kind) for case, o in done.items() if case.resolution == name])
            for kind in ("own", "true")
        }
        for name in names
    }


def tabulated(filtered: str, found: Found) -> pd.DataFrame:
    """A row for each resolution."""
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for name, of in found.items():
        own, true = of["own"], of["true"]
        rows[filtered, name] = {
            "radius [h]": RADII[filtered][name],
            "own: best": own.best,
            "own: mean": own.mean,
            "own: deviation": own.deviation,
            "true: best": true.best,
            "true: median": true.median,
            "true: worst": true.worst,
            "true over own, medians": true.median / own.median,
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis(["filter", "resolution"])
