"""Three readings of a hole made of zero densities, by filter radius and update rule."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from mpmtop.arrays import Array
from mpmtop.optimizers import GCMMA, SingleStepGCMMA, UpdateRule, optimize
from mpmtop.points import seed
from mpmtop.scene import Scene
from mpmtop.shape_functions import tent
from validation import paper
from validation.bodies.scenes import HOLE, SPACING, perforated
from validation.methods.analyser import JOBS, MOVE, Analyser, Optimisation, material_points

RADII = (2.0, 2.4, 3.0)
"""Filter radii in point spacings: as for the brackets, and the study's own."""
RULES: dict[str, UpdateRule] = {"GCMMA": GCMMA(move=MOVE), "GCMMA, single step": SingleStepGCMMA(move=MOVE)}
ABSENT = "no points"
READINGS = ("filter passes over", "filter averages", "as a start")
"""Of zero density, for the paper's case 2."""
CASES = (ABSENT, *READINGS)
ITERATIONS = 500
ITERATIONS_OVER = "iterations over case 1's"


class Case(NamedTuple):
    """A reading, `ABSENT` for case 1."""

    reading: str
    radius: float
    rule: str


def build(case: Case) -> Analyser:
    """The perforated cantilever by standard MPM."""
    radius = case.radius * SPACING
    if case.reading != "as a start":
        scene = perforated(absent=case.reading == ABSENT, filter_radius=radius)
        return material_points(tent, "standard", filter_passive=case.reading == "filter averages")(scene)
    scene = perforated(absent=False, passive_void=None, filter_radius=radius)
    points = seed(scene.body.domain, (SPACING, SPACING)).x
    share = 1 - float(np.mean(HOLE.contains(points)))  # the same material as in case 1
    scene = perforated(absent=False, passive_void=None, filter_radius=radius, volume_fraction=0.4 * share)
    return material_points(tent, "standard")(scene)


def optimise(case: Case) -> Optimisation:
    """One run; zero density as a start is rho_min in the hole, its variables active."""
    analyser = build(case)
    scene: Scene = analyser.scene

    def emptied(x: Array) -> Array:
        return np.where(HOLE.contains(x), scene.design.rho_min, 0.4)

    start = emptied if case.reading == "as a start" else None
    iterates = optimize(analyser.problem, RULES[case.rule], start=start, max_iterations=ITERATIONS)
    return Optimisation.collect(iterates, analyser)


def computed() -> dict[Case, Optimisation]:
    """Every reading, radius and rule."""
    cases = [Case(reading, r, rule) for reading in CASES for r in RADII for rule in RULES]
    return dict(zip(cases, Parallel(n_jobs=JOBS)(delayed(optimise)(case) for case in cases), strict=True))


def tabulated(runs: dict[Case, Optimisation]) -> pd.DataFrame:
    """Each reading of case 2 beside case 1 of the same radius and rule."""
    rows = {}
    for case, run in runs.items():
        if case.reading == ABSENT:
            continue
        before = runs[case._replace(reading=ABSENT)]
        rows[case] = {
            "difference of compliance": run.final / before.final - 1,
            ITERATIONS_OVER: run.iterations / before.iterations,
            "largest density in the hole": float(run.design.rho[HOLE.contains(run.design.x)].max()),
        }
    table = pd.DataFrame.from_dict(rows, orient="index")
    table.index = pd.MultiIndex.from_tuples(rows, names=["zero density", "radius / spacing", "rule"])
    within = table["difference of compliance"].abs() <= paper.HOLE_DIFFERENCE.value
    slower = table[ITERATIONS_OVER] > 1
    table["within 1.4 %"] = np.where(within, "yes", "no")
    table["slower"] = np.where(slower, "yes", "no")
    return table
