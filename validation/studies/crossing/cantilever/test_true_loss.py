"""What designs optimised with crossing have lost in truth, and the paper's numbers."""

import pandas as pd
import pytest

from mpmtop.arrays import Array
from mpmtop.crossing import Crossing, moved
from mpmtop.page.numbers import changed
from reference_fem.reanalyse import Judge
from validation import paper
from validation.bodies.scenes import cantilever
from validation.bodies.sliced_beam import beam_rises
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.methods.analyser import Analyser, Optimisation
from validation.methods.judging import UNCERTAIN, own_error
from validation.paper import compare, under_a_pattern
from validation.studies.crossing.cantilever.calibration import NAMES, REPRODUCTION, RTOL_OPTIMUM, Calibration

# points are moved off the clamp and over grid lines on purpose
pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

LITTLE = max(paper.OPTIMUM_SCATTER.values())
"""Of the compliance: a loss that rule and start make as well."""


@pytest.mark.slow
def test_true_loss(
    report: Report,
    lock: Lock,
    calibrations: dict[str, Calibration],
    uncrossed: Analyser,
    still: Optimisation,
    runs: dict[tuple[str, str], Optimisation],
    judge: Judge,
) -> None:
    """What the designs have lost in truth

    The paper compares each optimum by the analysis that made it: the **apparent** loss, which mixes the worse design
    with the error of its analysis. Analysed again without crossing, and on the fine reference, only the design is left.
    The wave shows that the apparent loss may also hide a true one.
    """
    best = judge(still.design.at(uncrossed.x)).compliance
    rows = losses(calibrations, uncrossed, still, runs, judge)
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis(["crossing", "method"])
    report.table(
        "true_loss",
        table,
        f"Loss against the design optimised without crossing ({best:.5g} on the fine reference), by three analyses.",
        4,
    )
    crossing = str(calibrations[REPRODUCTION].crossing)
    crossed = runs[REPRODUCTION, "standard"].design
    judged = rows[crossing, "standard"]["compliance, fine reference"]
    report.check(
        f"the judge's own error: true compliance of standard MPM's design, {crossing}, with elements half as wide",
        own_error(cantilever(), crossed, judged),
        source=UNCERTAIN,
        unit="%",
    )
    standard, gimp = rows[crossing, "standard"], rows[crossing, "GIMP"]
    holds = [
        report.check(
            f"optimum of standard over that of GIMP, own analyses, {crossing}",
            runs[REPRODUCTION, "standard"].final / runs[REPRODUCTION, "GIMP"].final,
            at_least=1.0,
            source=paper.STANDARD_HIGHER,
        ),
        report.check(
            f"optimum of standard over that of GIMP, fine reference, {crossing}",
            standard["compliance, fine reference"] / gimp["compliance, fine reference"],
            at_least=1.0,
            source=paper.STANDARD_HIGHER,
        ),
        report.check(
            f"apparent loss of GIMP, {crossing}",
            gimp["apparent loss"],
            at_most=0.05,
            source="half of standard's",
            unit="%",
        ),
    ]
    report.check(
        f"true loss of optimality, standard, {crossing}",
        standard["fine reference"],
        source="for comparison: the paper judges no design by another analysis",
        unit="%",
    )
    report.check(
        f"true loss of optimality, GIMP, {crossing}", gimp["fine reference"], source="for comparison", unit="%"
    )
    tell(report, calibrations[REPRODUCTION].crossing, rows)
    show(report, crossing, still, runs, rows, judge, uncrossed.x)
    compare_families(report, calibrations, rows)
    lock({f"{c}, {name}": row["compliance, fine reference"] for (c, name), row in rows.items()}, rtol=RTOL_OPTIMUM)
    assert all(holds)


def losses(
    calibrations: dict[str, Calibration],
    uncrossed: Analyser,
    still: Optimisation,
    runs: dict[tuple[str, str], Optimisation],
    judge: Judge,
) -> dict[tuple[str, str], dict[str, float]]:
    """By crossing and method, what each analysis says that the design has lost."""
    best = judge(still.design.at(uncrossed.x)).compliance
    rows = {}
    for (family, name), run in runs.items():
        fine = judge(run.design.at(uncrossed.x)).compliance
        rows[str(calibrations[family].crossing), name] = {
            "apparent loss": run.final / still.final - 1,
            "without crossing": uncrossed.compliance(run.design) / still.final - 1,
            "fine reference": fine / best - 1,
            "compliance, fine reference": fine,
        }
    return rows


def tell(report: Report, crossing: Crossing, rows: dict[tuple[str, str], dict[str, float]]) -> None:
    """What came out of the reproduction, and what follows."""
    standard, gimp = rows[str(crossing), "standard"], rows[str(crossing), "GIMP"]
    spline = rows[str(crossing), "quadratic B-spline"]
    worst = max(row["fine reference"] for row in (standard, gimp, spline))
    verdict = "hardly suffer" if worst < LITTLE else "suffer"
    report.found(
        f"Compliance designs {verdict}. {moved(crossing)}, against the seeded design their true compliance is "
        f"{changed(standard['fine reference'])} with standard MPM, {changed(gimp['fine reference'])} with GIMP, "
        f"{changed(spline['fine reference'])} with quadratic B-splines; the methods themselves report "
        f"{standard['apparent loss']:+.1%}, {gimp['apparent loss']:+.1%} and {spline['apparent loss']:+.1%}.",
        front="Points have crossed cells",
    )
    order = sorted((row["fine reference"], name) for name, row in (("standard MPM", standard), ("GIMP", gimp)))
    report.so(
        f"For compliance keep points as seeded; if they have crossed, take {order[0][1]} rather than {order[1][1]}"
        + (", or quadratic B-splines" if spline["fine reference"] < order[0][0] else "")
        + ", and judge the final design by a finer analysis (`reference_fem.reanalyse`).",
        front="What to do",
    )


def compare_families(
    report: Report, calibrations: dict[str, Calibration], rows: dict[tuple[str, str], dict[str, float]]
) -> None:
    """Whether standard's design is the worse one in every family."""
    excess = {
        str(c): rows[str(c), "standard"]["fine reference"] - rows[str(c), "GIMP"]["fine reference"]
        for c, _ in calibrations.values()
    }
    for label, more in excess.items():
        report.check(f"true loss of optimality, standard less GIMP, {label}", more, source="for comparison", unit="%")
    worse = [label for label, more in excess.items() if more < 0]
    report.text(
        "On the fine reference standard's design is the worse one, as by the own analyses"
        + (f", but for {', '.join(worse)}: there GIMP's is the worse." if worse else ", in every family.")
    )


def show(
    report: Report,
    crossing: str,
    still: Optimisation,
    runs: dict[tuple[str, str], Optimisation],
    rows: dict[tuple[str, str], dict[str, float]],
    judge: Judge,
    x: Array,
) -> None:
    """The reproduction's designs, and what the judge finds of them cut to black and white, at its points x (p, 2)."""
    named = {"standard": "MPM, crossed", "GIMP": "GIMP, crossed", "quadratic B-spline": "B-spline, crossed"}
    for name, shown in named.items():
        run = runs[REPRODUCTION, name]
        report.design(
            f"design_{shown.partition(',')[0]}",
            *(run.design.x, run.design.half_length, run.design.rho),
            body="Cantilever",
            method=shown,
            measure="compliance [F²/E0]",
            own=run.final,
            true=rows[crossing, name]["compliance, fine reference"],
            front=True,
        )
    cut = {shown: runs[REPRODUCTION, name].design.black_and_white() for name, shown in named.items()}
    cut["MPM, as seeded"] = still.design.black_and_white()
    black = {name: judge(design.at(x)).compliance for name, design in cut.items()}
    true = {shown: rows[crossing, name]["compliance, fine reference"] for name, shown in named.items()}
    true["MPM, as seeded"] = judge(still.design.at(x)).compliance
    report.table(
        "thresholded",
        pd.DataFrame({"fine reference": true, "cut to black and white": black}).rename_axis("design of"),
        f"The same designs cut to black and white at their volume, compliance on the fine reference, {crossing}.",
        4,
    )


@pytest.mark.slow
def test_numbers_of_the_paper(
    report: Report,
    calibrations: dict[str, Calibration],
    still: Optimisation,
    runs: dict[tuple[str, str], Optimisation],
) -> None:
    """Every number of Sect. 5.2.1

    Of the calibrated member of every family: none is chosen by what comes out. Compliances are compared as they are,
    since the uncrossed one was calibrated (cantilever study); increases to the paper's own percentages, which its own
    compliances do not give (errata: +8.9 % and +3.5 %).
    """
    scatter = paper.OPTIMUM_SCATTER["cantilever, mid-height"]
    for family, (crossing, rise) in calibrations.items():
        final = {name: runs[family, name].final for name in NAMES}
        reason = reason_of(crossing)
        compare(report, under_a_pattern(str(crossing), rise, final, still.final, scatter, reason))


def reason_of(crossing: Crossing) -> str:
    """What the beam in slices says of a pattern."""
    beam = beam_rises(crossing)
    return (
        f"a beam cut into slices, softer where material is missing from a cell, rises by {beam['standard']:.1%} "
        f"(standard) and {beam['GIMP']:.1%} (GIMP) under this pattern: it decides (page of open choices)"
    )
