"""Runs of a quantity at all levels, and what is read from them: settled errors, Pareto front, slopes."""

from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from mpmtop.crossing import Crossing, Uniform
from mpmtop.errors import NotConverged, UnsupportedBody
from mpmtop.solvers import SingularMatrix
from validation.harness.progress import ShowProgress
from validation.measures.outcome import Outcome
from validation.measures.timing import measured
from validation.methods.analyser import SHAPE_FUNCTIONS
from validation.studies.work_precision.quantity import Quantity

UNCROSSED = Uniform(0.0)
PPC = (1, 2, 3, 4)
CROSSED_PPC = (2, 3)
"""Points per cell and direction that are also run where they have crossed: an even number and an odd one."""
FEM = {1: "FEM Q1", 2: "FEM Q2"}
CASE = ["quantity", "method", "ppc", "points"]
MEANINGLESS = 1.0
"""An error of all of the quantity: K is singular but for rounding, which then makes the number."""


def refined(quantity: Quantity, progress: ShowProgress) -> pd.DataFrame:
    """All runs of a quantity that its weights allow: one row for each error, method and level that has a result."""
    cases = [
        (name, ppc, crossing, n)
        for name in SHAPE_FUNCTIONS
        for ppc in PPC
        for crossing in (UNCROSSED, *(quantity.crossings if ppc in CROSSED_PPC else ()))
        for n in quantity.levels
        if quantity.admits(n, ppc) and quantity.cells(n) * ppc**2 * stencil(name) <= quantity.weights
    ]
    rows = [row for case in progress(cases, quantity.name) for row in by_points(quantity, *case)]
    for order, levels in quantity.element_levels.items():
        for n in levels:
            measure, seconds = measured(partial(quantity.elements, n, order))
            rows += named(quantity, measure(), method=FEM[order], ppc=0, points="", n=n, seconds=seconds)
    frame = pd.DataFrame(rows)
    frame["stored"] /= 1e6
    return settled(frame)


def settled(frame: pd.DataFrame) -> pd.DataFrame:
    """The runs with their error as it counts for the front, `settled`.

    That of the level before it, lowered by order four, if it is less than that, which is luck; and the largest of the
    level and all finer ones. Infinite for a case of fewer than three levels, in which luck could not be told.
    """
    cases = frame.groupby(CASE, sort=False)
    lowered = cases["error"].shift() * (cases["unknowns"].shift() / frame["unknowns"]) ** 2
    counted = frame.assign(settled=np.fmax(frame["error"], lowered))
    counted["settled"] = counted.groupby(CASE, sort=False)["settled"].transform(lambda e: e[::-1].cummax()[::-1])
    counted.loc[cases["error"].transform("size") < 3, "settled"] = np.inf
    return counted


def stencil(name: str) -> int:
    """Nodes of nearly all points: GIMP's domains that lie in one cell, as most do, have those of the tent."""
    return {"quadratic B-spline": 9, "cubic B-spline": 16}.get(name, 4)


def by_points(quantity: Quantity, name: str, ppc: int, crossing: Crossing, n: int) -> list[dict[str, Any]]:
    """Rows of one analysis; none where K is singular, or so nearly that the error has no meaning."""
    try:
        measure, seconds = measured(partial(quantity.points, n, SHAPE_FUNCTIONS[name], ppc, crossing))
    except (SingularMatrix, UnsupportedBody, NotConverged):
        return []
    rows = named(quantity, measure(), method=name, ppc=ppc, points=label(crossing), n=n, seconds=seconds)
    return [row for row in rows if row["error"] < MEANINGLESS]


def named(quantity: Quantity, outcome: Outcome, **case: Any) -> list[dict[str, Any]]:
    """A row for each error of an analysis: the case, its cost and the error, as far as it is resolved."""
    cost = {"unknowns": outcome.unknowns, "nonzeros": outcome.nonzeros, "stored": outcome.stored}
    return [
        {"quantity": name, **case, **cost, "error": max(error, quantity.resolved)}
        for name, error in outcome.errors.items()
    ]


def label(crossing: Crossing) -> str:
    return "uncrossed" if crossing == UNCROSSED else str(crossing)


def of_arrangement(frame: pd.DataFrame, points: str) -> pd.DataFrame:
    """Runs of one arrangement of the points, and of the elements, which know none."""
    return frame[(frame["points"] == points) | (frame["ppc"] == 0)]


def front(frame: pd.DataFrame, cost: str) -> pd.DataFrame:
    """Runs that no other beats in cost and in settled error."""
    ordered = frame.sort_values([cost, "settled"])
    best = ordered["settled"].cummin().shift(fill_value=np.inf)
    return ordered[ordered["settled"] < best]


def slopes(frame: pd.DataFrame, cost: str = "unknowns") -> pd.Series:
    """Slope of log error by log cost over the last three levels of each case."""

    def slope(runs: pd.DataFrame) -> float:
        last = runs.tail(3)
        return float(np.polyfit(np.log(last[cost]), np.log(last["error"]), 1)[0]) if len(last) == 3 else np.nan

    return frame.groupby(CASE, sort=False)[[cost, "error"]].apply(slope)


def cheapest(frame: pd.DataFrame, cost: str, target: float) -> pd.Series | None:
    """The run of least cost whose error is settled below the target, if there is one."""
    reached = frame[frame["settled"] <= target]
    return None if reached.empty else reached.iloc[int(reached[cost].argmin())]
