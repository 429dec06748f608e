"""The objective along a line of designs, and what a lazy adjoint loses."""

import numpy as np
import pandas as pd
import pytest

from validation.bodies.large import GIMP, SPLINE, STRETCHED, TENT, TOTAL
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.studies.large_deformation.figures import line_figure
from validation.studies.large_deformation.smooth import PART, SAMPLES, lazy_loss, line
from validation.studies.large_deformation.tolerances import RTOL


@pytest.mark.slow
def test_smoothness(report: Report, lock: Lock) -> None:
    """The objective along a line of designs

    A cantilever of 20 x 10 on cells of 2 x 2 with 200 points, whose tip goes down by some 15 % of the length in four
    steps. Point moduli change along a line, by a fifth in all; the end compliance and its exact derivative are taken
    at sixty places, or at the middle twenty, among which the benchmark has found the tent's largest jump. A jump is
    what the objective changes by, between two of them, beyond the integral of the derivative. The "consistent
    sensitivities" of the paper are those of a function; is there one?
    """
    largest, change, _ = _record(report, lock, "line", PART, (0, 10, 19))
    report.found(
        f"Along a third of a line of designs the tent's objective jumps by up to {largest[TENT]:.1e} of itself, where "
        f"it changes by {change[TENT]:.1e} in all; GIMP's largest jump is {largest[GIMP]:.0e}."
    )
    report.so(
        "Optimise with GIMP on a fixed background: the tent's exact gradient is not that of its objective's trend."
    )


@pytest.mark.benchmark
def test_smoothness_finer(report: Report, lock: Lock) -> None:
    """The whole line of designs

    All sixty places. A difference quotient whose sign is not that of the exact derivative on either side sends a line
    search the wrong way.
    """
    *_, wrong = _record(report, lock, "whole_line", slice(None), (0, SAMPLES // 2, SAMPLES - 1))
    report.check(
        "tent, all places: share of difference quotients of the wrong sign", wrong[TENT], source="for comparison"
    )


Found = dict[str, float]


def _record(report: Report, lock: Lock, name: str, part: slice, locked: tuple[int, ...]) -> tuple[Found, Found, Found]:
    """Figure, table and claims of a part of the line: largest jump, change and share of wrong signs by method."""
    lines = {method: line(method, part) for method in (TOTAL, TENT, GIMP)}
    places = "all places" if part == slice(None) else "the middle third"
    report.figure(name, line_figure(lines), "End compliance along the line, by its value at the start; and the jumps.")
    largest = {method: float(np.abs(found.jumps).max()) for method, found in lines.items()}
    change = {method: float(np.ptp(found.J) / np.mean(found.J)) for method, found in lines.items()}
    wrong = {
        method: float(np.mean(np.sign(np.diff(found.J)) != np.sign(found.slope[:-1] + found.slope[1:])))
        for method, found in lines.items()
    }
    table = pd.DataFrame({"largest jump": largest, "change of J along the line": change, "wrong sign": wrong})
    report.table(
        name,
        table.rename_axis("method").map(lambda value: value if value > 1e-9 else 0.0),
        "Jumps and the whole change, by the mean of J; part of the difference quotients whose sign is not that of the "
        "exact derivative.",
        2,
        percent=["wrong sign"],
    )
    none = report.check(
        f"total Lagrange, {places}: largest jump below 1e-9",
        largest[TOTAL] < 1e-9,
        True,
        source="nothing crosses",
        why="Newton's tolerance and the cubic rule's error",
    )
    smooth = report.check(
        f"GIMP on the fixed background, {places}: largest jump",
        float(f"{largest[GIMP]:.1e}"),
        at_most=1e-6,
        source="weights with a continuous gradient",
        why="what kinks of the derivative can leave between two places",
    )
    jumps = report.check(
        f"tent, {places}: largest jump",
        largest[TENT],
        at_least=1e-4,
        source="a point that crosses changes its cell's stiffness at once",
        why="a hundred times the bound for GIMP",
    )
    lock({f"{method}, {k}": float(found.J[k]) for method, found in lines.items() for k in locked}, rtol=RTOL)
    assert none and smooth and jumps
    return largest, change, wrong


@pytest.mark.slow
def test_lazy_adjoint(report: Report, lock: Lock) -> None:
    """What a lazy adjoint loses

    The adjoint of the load steps with the weights of every step taken as given, where in truth they depend on all
    displacements before: |lazy - exact| / |exact| of the gradient by the points' moduli, in eight steps. The exact one
    agrees with a complex step to ten digits (tests).
    """
    methods = (TOTAL, TENT, GIMP, STRETCHED, SPLINE)
    loss = {method: lazy_loss(method) for method in methods}
    table = pd.DataFrame.from_dict(loss, orient="index").rename_axis("method")
    report.table("lazy", table, "Relative error of a lazy gradient.", 2, percent=list(table.columns))
    none = report.check(
        "total Lagrange: what a lazy adjoint loses", loss[TOTAL]["end compliance"], 0.0, source="nothing moves"
    )
    moving = [value for method in methods[1:] for value in loss[method].values()]
    some = report.check(
        "updated frame: least that a lazy adjoint loses, all methods and objectives",
        min(moving),
        at_least=1e-2,
        source="weights depend on earlier displacements",
        why="an optimiser's line search would notice one per cent",
    )
    report.found(
        f"An adjoint that takes the weights as given misses {min(moving):.0%} to {max(moving):.0%} of the gradient."
    )
    lock({f"{m}, {name}": value for m in methods[1:] for name, value in loss[m].items()}, rtol=1e-5)
    assert none and some
