"""Points that cross by themselves beside points that are pushed, and the cost of load steps."""

import pandas as pd
import pytest

from validation.bodies.large import GIMP, TENT
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.studies.large_deformation.crossings import induced_crossing, real_crossing
from validation.studies.large_deformation.figures import crossing_figure
from validation.studies.large_deformation.smooth import cost


@pytest.mark.slow
def test_crossing(report: Report, lock: Lock) -> None:
    """Induced crossing beside real crossing

    The paper pushes points over cell boundaries and leaves the body where it is; here the body bends and they cross by
    themselves, most of them in the first step. The bent beam above, in eight steps: at every step the points that have
    left their cells, and the error of tip and stress against biquadratic elements, which are asked for the stress at
    the points' places in the undeformed body. Beside them the same points at small strain, a growing
    number of them pushed over the next boundary. In the total frame points move, but their weights stay.
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
    report.check(
        "real crossing, full load: stress error of the tent by GIMP's",
        last[TENT].stress / last[GIMP].stress,
        source="for comparison",
    )
    report.check(
        "induced crossing, at its worst: stress error of the tent by GIMP's",
        pushed[TENT].stress / pushed[GIMP].stress,
        source="for comparison",
    )
    report.found(
        f"Once {last[TENT].share:.0%} of the points have crossed by themselves the tent's stress is off by "
        f"{last[TENT].stress:.0%} and its tip by {abs(last[TENT].tip):.1%}, GIMP's by {last[GIMP].stress:.0%} and "
        f"{abs(last[GIMP].tip):.1%}; with {pushed[TENT].share:.0%} of them pushed at small strain, "
        f"{pushed[TENT].stress:.0%} and {abs(pushed[TENT].tip):.1%} beside {pushed[GIMP].stress:.0%} and "
        f"{abs(pushed[GIMP].tip):.1%}."
    )
    lock({f"{m}, {k}": v for m, step in last.items() for k, v in step._asdict().items()}, rtol=1e-4)


def test_cost(report: Report) -> None:
    """Cost

    CPU seconds of the load steps, of their gradient and of one linear analysis of the same points, side by side: the
    cantilever of the line of designs on cells of half the side, 800 points by GIMP, four steps.
    """
    spent, newton = cost()
    ratio = spent["gradient"] / spent["forward"]
    table = pd.DataFrame.from_dict({"CPU seconds": spent}, orient="columns").rename_axis("what")
    report.timed.table("cost", table, f"Median CPU seconds; {newton} Newton steps in all.", 3)
    report.timing(
        "gradient by forward",
        ratio,
        at_most=0.4,
        source="one factorisation a step, beside one for each Newton step",
        why="four to eight Newton steps a step, and the second derivatives of the weights",
    )
    report.timing(
        "forward by one linear analysis", spent["forward"] / spent["linear analysis"], source="for comparison"
    )
