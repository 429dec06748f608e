"""Points that cross by themselves beside points that are pushed, and the cost of load steps."""

import pandas as pd
import pytest

from validation.bodies.large import GIMP, TENT
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.studies.large_deformation.costs import STEPS, Spent, spent
from validation.studies.large_deformation.crossings import induced_crossing, real_crossing
from validation.studies.large_deformation.figures import crossing_figure

ASKED_OF = 3200
"""Points, 80 x 40, whose seconds are asked about."""


@pytest.mark.slow
def test_crossing(report: Report, lock: Lock) -> None:
    """Induced crossing beside real crossing

    The paper pushes points over cell boundaries and leaves the body where it is; here the body bends and they cross by
    themselves, most of them in the first step. The bent beam above, in eight steps: at every step the points that have
    left their cells, and the error of tip and stress against biquadratic elements, which are asked for the stress at
    the points' places in the undeformed body. Beside them the same points at small strain, the columns before every
    eighth, fourth, second and each boundary pushed over it. In the total frame points move, but their weights stay.
    """
    found, induced = real_crossing(), induced_crossing()
    report.figure(
        "crossing",
        crossing_figure(found, induced),
        "Errors against the share of points that have crossed: by themselves, in a body that bends (left), and pushed "
        "at small strain (right).",
    )
    rows = [("by themselves", m, *step) for m, steps in found.items() for step in steps[1::2]]
    rows += [("pushed", m, *step) for m, steps in induced.items() for step in steps]
    columns = ["crossing", "method", "crossed", "error of the tip", "error of the stress"]
    report.table(
        "crossing", pd.DataFrame(rows, columns=columns), "Share of points crossed, and errors.", 3, percent=["crossed"]
    )
    last = {m: steps[-1] for m, steps in found.items()}
    pushed = {m: max(steps, key=lambda step: step.stress) for m, steps in induced.items()}
    least = {m: min(steps, key=lambda step: step.stress) for m, steps in induced.items()}
    report.check(
        "real crossing, full load: stress error of the tent by GIMP's",
        last[TENT].stress / last[GIMP].stress,
        source="for comparison",
    )
    report.check(
        "induced crossing, the worst of four ways: stress error of the tent by GIMP's",
        pushed[TENT].stress / pushed[GIMP].stress,
        source="for comparison",
    )
    report.found(
        f"Once {last[TENT].share:.0%} of the points have crossed by themselves the tent's stress is off by "
        f"{last[TENT].stress:.0%} and its tip by {abs(last[TENT].tip):.1%}, GIMP's by {last[GIMP].stress:.0%} and "
        f"{abs(last[GIMP].tip):.1%}. Of the four ways to push them at small strain (over every 8th, 4th, 2nd and each "
        f"boundary) the tent's stress is off by {least[TENT].stress:.0%} in the mildest and {pushed[TENT].stress:.0%} "
        f"in the worst, GIMP's by {least[GIMP].stress:.0%} to {pushed[GIMP].stress:.0%}."
    )
    lock({f"{m}, {k}": v for m, step in last.items() for k, v in step._asdict().items()}, rtol=1e-4)


@pytest.mark.slow
def test_cost(report: Report) -> None:
    """Cost

    CPU seconds of eight load steps by GIMP, of their gradient and of one linear analysis of the same points, side by
    side, by size: the cantilever of the line of designs, moduli other ones every time. Beside them the same levels by
    one bilinear element for each point, total Lagrange. The gradient's share is asked of 3,200 points and more.
    """
    _record(report, "cost", [spent(2.0, elements=True), spent(1.0, elements=True, repeats=1)])


@pytest.mark.benchmark
def test_cost_finer(report: Report) -> None:
    """Cost of more points

    The same of 3,200 and 12,800 points.
    """
    _record(report, "cost_finer", [spent(0.5, elements=True), spent(0.25, elements=True, repeats=1)])


def _record(report: Report, name: str, sizes: list[Spent]) -> None:
    columns = ["points", "linear analysis", "load steps", "gradient", "Newton steps", "elements", "linear, elements"]
    report.timed.table(name, pd.DataFrame(sizes, columns=columns), "CPU seconds; Newton steps of all load steps.", 3)
    for size in sizes:
        n = f"{size.points:,} points"
        report.timing(
            f"gradient by load steps, {n}",
            size.gradient / size.forward,
            # where calls cost as much as sums, a crowded machine decides
            at_most=0.4 if size.points >= ASKED_OF else None,
            source="one factorisation a step, beside one for each Newton step",
            why="three Newton steps and more, and second derivatives of the weights beside the assembly's pattern",
        )
        report.timing(
            f"load steps by {STEPS} times one linear analysis, {n}",
            size.forward / (STEPS * size.linear),
            source="for comparison",
        )
        if size.points == ASKED_OF:
            report.timing(
                f"load steps and gradient, {n}, CPU seconds",
                size.forward + size.gradient,
                at_most=3.0,
                source="what an optimisation of a hundred analyses can wait for: five minutes",
                why="asked of a machine of today",
            )
