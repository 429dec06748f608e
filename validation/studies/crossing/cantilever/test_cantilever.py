"""Cell crossing: cantilever (Figs. 12, 13)

Compliance with induced crossing. The paper shifts points in x by amounts it does not give. Here three families of
shifts are each **calibrated on one number of the paper**, the tip displacement of the solid with standard MPM (+13.8
%), and **predict the other three**: GIMP's tip displacement and both optimised compliances. Everything else is the
cantilever without crossing: force at mid-height, filter radius 3 point spacings, 40 % of the volume, h = F = E0 = 1.

Densities live on the points' places in the body, before the shift; there the filter measures, and there a design is
drawn and judged. A shift disturbs the analysis only. So every design can be analysed again without crossing, and on the
**fine reference**: what it has lost in truth, beside what its own analysis claims.
"""

from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from mpmtop.arrays import Array, Mask
from mpmtop.points import seed
from reference_fem import elasticity
from reference_fem.reanalyse import Judge, build_judge
from validation import paper
from validation.bodies.crossing import FAMILIES, Crossing, moved
from validation.bodies.scenes import SPACING, H, cantilever
from validation.bodies.sketch import CALIBRATED, CHOSEN, opening
from validation.harness.lock import Lock
from validation.harness.progress import ShowProgress
from validation.harness.report import Report
from validation.harness.show import changed
from validation.measures.drawing import draw_design, draw_points
from validation.methods.analyser import METHODS, SHAPE_FUNCTIONS, Analyser, Optimisation, material_points
from validation.paper import Compared, compare

# points are moved off the clamp and over grid lines on purpose
pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

ASKED = "What does crossing do to designs of low compliance: by the method that makes them, and in truth?"

RTOL_OPTIMUM = 2e-3
"""As for the cantilever without crossing: a hundred iterations amplify another processor's rounding to a few 1e-4."""
RTOL_ANALYSIS = 1e-8
"""One analysis of a given design: condition number 1e5 times rounding 1e-16, with three digits to spare."""

RTOL_COMPLIANCE, RTOL_RISE = 0.0125, 0.1
"""Agreement with the paper: an optimum to what it scatters by update rule and start (1.2 %, study of open choices); a
rise to a tenth, being itself what crossing makes."""

REPRODUCTION = "periodic(n, 0.26)"
"""The family whose stress field has the paper's periodic overshoots; its runs are shown in full."""
NAMES = ("standard", "GIMP")


class Calibration(NamedTuple):
    """The member of a family nearest to the paper's +13.8 %, and the rise of the tip displacement by method."""

    crossing: Crossing
    rise: dict[str, float]


def tip(name: str, crossing: Crossing | None = None) -> float:
    """Tip displacement of the solid, equal to its compliance under the unit force."""
    analyser = material_points(SHAPE_FUNCTIONS[name], name, crossing)(cantilever())
    return float(analyser.problem.analyse(np.ones(len(analyser.x))).objective)


@pytest.fixture(scope="module")
def calibrations() -> dict[str, Calibration]:
    still = {name: tip(name) for name in NAMES}
    target = paper.CANTILEVER_CROSSING_TIP_STANDARD.value
    chosen = {}
    for family, members in FAMILIES.items():
        rises = [tip("standard", member) / still["standard"] - 1 for member in members]
        best = int(np.argmin(np.abs(np.array(rises) - target)))
        gimp = tip("GIMP", members[best]) / still["GIMP"] - 1
        chosen[family] = Calibration(members[best], {"standard": rises[best], "GIMP": gimp})
    return chosen


@pytest.fixture(scope="module")
def uncrossed() -> Analyser:
    return METHODS["standard"](cantilever())


@pytest.fixture(scope="module")
def still(uncrossed: Analyser) -> Optimisation:
    """The optimum without crossing; standard and GIMP are one."""
    return Optimisation.of(uncrossed)


@pytest.fixture(scope="module")
def runs(calibrations: dict[str, Calibration], progress: ShowProgress) -> dict[tuple[str, str], Optimisation]:
    """Optimisations by family and method; the reproduction also with the B-splines."""
    cases = [(f, name) for f in FAMILIES for name in (SHAPE_FUNCTIONS if f == REPRODUCTION else NAMES)]
    return {
        (family, name): Optimisation.of(
            material_points(SHAPE_FUNCTIONS[name], name, calibrations[family].crossing)(cantilever())
        )
        for family, name in progress(cases, "crossed optimisations")
    }


@pytest.fixture(scope="module")
def judge(uncrossed: Analyser) -> Judge:
    return build_judge(cantilever(), uncrossed.x, uncrossed.half_length, split=1)


@pytest.mark.slow
def test_calibration(
    report: Report,
    lock: Lock,
    calibrations: dict[str, Calibration],
    still: Optimisation,
    runs: dict[tuple[str, str], Optimisation],
) -> None:
    """One parameter calibrated, three numbers predicted

    In each family the member is chosen whose tip displacement with standard MPM comes nearest to +13.8 %; the numbers
    of columns and waves are whole, so the calibration is met to about a per cent of the displacement. The optima are
    relative to the uncrossed optimum of the same scene, in the paper as here. Random shifts are left to the study of
    shape functions: their scatter exceeds what is to be predicted.
    """
    stated = {
        "tip, GIMP": paper.CANTILEVER_CROSSING_TIP_GIMP.value,
        "optimum, standard": paper.CANTILEVER_CROSSING_STANDARD.value / paper.CANTILEVER_COMPLIANCE.value - 1,
        "optimum, GIMP": paper.CANTILEVER_CROSSING_GIMP.value / paper.CANTILEVER_COMPLIANCE.value - 1,
    }
    target = paper.CANTILEVER_CROSSING_TIP_STANDARD.value
    rows: dict[str, dict[str, Any]] = {"paper": {"member": "not stated", "tip, standard (calibrated)": target} | stated}
    for family, (crossing, rise) in calibrations.items():
        predicted = {"tip, GIMP": rise["GIMP"]}
        predicted |= {f"optimum, {name}": runs[family, name].final / still.final - 1 for name in NAMES}
        error = np.sqrt(np.mean([(predicted[key] - stated[key]) ** 2 for key in stated]))
        rows[family] = {"member": str(crossing), "tip, standard (calibrated)": rise["standard"]} | predicted
        rows[family]["prediction error (RMS)"] = float(error)
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("family")
    report.table("calibration", table, "Rises by crossing, of the solid's tip displacement and of the optimum.", 3)
    errors = table["prediction error (RMS)"].astype(float)
    ratios = [float(rows[f]["optimum, standard"] / rows[f]["tip, standard (calibrated)"]) for f in calibrations]
    report.text(
        f"Least prediction error: {errors.idxmin()}, {errors.min():.3f}. GIMP's tip displacement below +1.8 % together "
        "with +13.8 % for standard MPM is met where neighbouring points move almost alike (wave), so that their "
        "domains leave hardly a gap; where single columns jump, GIMP counts the gap they leave and the overlap they "
        f"make. In the paper standard's optimum rises by {stated['optimum, standard'] / target:.2f} of its tip "
        f"displacement; here by {min(ratios):.2f} to {max(ratios):.2f}."
    )
    scene = cantilever()
    domain = scene.body.domain
    moved = calibrations[REPRODUCTION].crossing(seed(domain, (SPACING, SPACING)), domain)
    choices = {"load": CHOSEN, "filter radius": CALIBRATED, "E_min / E0": CHOSEN, "rho_min": CHOSEN}
    note = f"Points as crossed by {calibrations[REPRODUCTION].crossing}: one column in every so many cells."
    opening(report, scene, choices, points=moved, note=note)
    wave = calibrations["wave(n, 0.26)"]
    report.check(
        f"tip displacement of the solid, GIMP, {wave.crossing}: predicted",
        wave.rise["GIMP"],
        at_most=paper.CANTILEVER_CROSSING_TIP_GIMP.value,
        source=paper.CANTILEVER_CROSSING_TIP_GIMP,
        why="the paper's bound",
    )
    met = report.check(
        "calibrated tip displacement, standard, furthest of any family with a whole number: distance from +13.8 %",
        max(abs(calibrations[f].rise["standard"] - target) for f in (REPRODUCTION, "wave(n, 0.26)")),
        at_most=0.02,
        source="our bound on the calibration",
    )
    lock({f"{f}, {name}": c.rise[name] for f, c in calibrations.items() for name in NAMES}, rtol=1e-6)
    assert met


def solid_stress(name: str, crossing: Crossing | None) -> tuple[Analyser, Array]:
    """Method and von Mises stress (p,) of the solid."""
    analyser = material_points(SHAPE_FUNCTIONS[name], name, crossing)(cantilever())
    return analyser, analyser.solid_von_mises(analyser.problem.analyse(np.ones(len(analyser.x))))


@pytest.mark.slow
def test_stress_field(
    report: Report, lock: Lock, calibrations: dict[str, Calibration], uncrossed: Analyser, judge: Judge
) -> None:
    """Periodic overshoots of the stress (Fig. 12)

    In the cell that keeps one column of points the tent's stiffness is halved, so strain and stress there rise; the
    cell with three columns is too stiff. GIMP spreads what has crossed over both cells.
    """
    crossing = calibrations[REPRODUCTION].crossing
    fields = {name: solid_stress(name, crossing)[1] for name in SHAPE_FUNCTIONS}
    x = uncrossed.x
    exact = elasticity.von_mises(
        elasticity.stress(judge.model, judge(np.ones(len(x))).u, np.ones(len(judge.owner)))
    ).ravel()
    exact = np.bincount(judge.owner, exact) / np.bincount(judge.owner)  # mean over the elements of each point
    inner = (x[:, 0] > 4 * H) & (x[:, 0] < 36 * H)
    # the row nearest to the upper edge, where bending stress is largest and varies slowly
    top = np.flatnonzero(np.isclose(x[:, 1], x[:, 1].max()) & inner)
    top = top[np.argsort(x[top, 0])]
    rows = {
        name: {
            "RMS error": np.sqrt(np.sum((field - exact)[inner] ** 2) / np.sum(exact[inner] ** 2)),
            "largest overshoot, top row": (field / exact)[top].max() - 1,
            "largest undershoot, top row": (field / exact)[top].min() - 1,
        }
        for name, field in fields.items()
    }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("shape function")
    report.table("stress", table, "Von Mises stress over the fine reference's, more than 4 h from clamp and load.", 3)
    over = "largest overshoot, top row"
    holds = [
        report.check(
            "largest overshoot of the von Mises stress in the top row, standard",
            rows["standard"][over],
            at_least=0.2,
            source=paper.OVERSHOOTS,
            why="our reading: a fifth is seen in a figure; without crossing it is a hundredth",
        ),
        report.check(
            "largest overshoot of the von Mises stress in the top row, GIMP over standard",
            rows["GIMP"][over] / rows["standard"][over],
            at_most=0.5,
            source=paper.OVERSHOOTS_MITIGATED,
            why="our reading of mitigated: at most half is left",
        ),
    ]
    figure, axes = plt.subplots(3, 1, figsize=(5.4, 8.4))
    limit = float(np.percentile(fields["GIMP"], 99.5))
    for ax, name in zip(axes, NAMES, strict=False):
        drawn = draw_points(
            ax, x, uncrossed.half_length, fields[name], vmin=0, vmax=limit, label="von Mises stress [F/h]"
        )
        ax.set(title=name)
        figure.colorbar(drawn, ax=ax, label="[F/h]", extend="max")
    for name in SHAPE_FUNCTIONS:
        axes[2].plot(x[top, 0], fields[name][top], linewidth=1.2, label=name)
    axes[2].plot(x[top, 0], exact[top], color="0.5", linestyle="-", linewidth=1, label="fine reference")
    axes[2].set(xlabel="x / h", ylabel="von Mises stress [F/h]", title="top row of points", ylim=(0, None))
    axes[2].legend(fontsize="x-small")
    report.figure(
        "stress", figure, f"Von Mises stress of the solid, {crossing}; points drawn at their place in the body."
    )
    lock({f"{name}, {k}": float(v) for name, row in rows.items() for k, v in row.items()}, rtol=1e-6)
    assert all(holds)


def in_soft_cells(crossing: Crossing) -> Mask:
    """Which points (p,) share their cell, after crossing, with fewer than the four of an undisturbed one."""
    body = cantilever().body.domain
    cell = np.floor(crossing(seed(body, (SPACING, SPACING)), body).x / H + 1e-9)
    _, inverse, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    return count[inverse.ravel()] < 4


@pytest.mark.slow
def test_optimisation(
    report: Report,
    lock: Lock,
    calibrations: dict[str, Calibration],
    still: Optimisation,
    runs: dict[tuple[str, str], Optimisation],
) -> None:
    """Optimised with crossing (Fig. 13)

    The gradients are those of the disturbed analysis, exactly, as the paper says: the derivative along a random
    direction is that of differences. What is optimised is wrong. Cells that have lost points are soft, there the
    optimiser sees strain energy and puts material: vertical struts at the crossed boundaries, as far as the filter,
    whose radius is 1.5 cells, lets them be. **Strut measure**: mean density of the points in cells that have lost
    points, over the mean of all.
    """
    crossing = calibrations[REPRODUCTION].crossing
    soft = in_soft_cells(crossing)
    shown = {"standard, no crossing": still} | {name: runs[REPRODUCTION, name] for name in SHAPE_FUNCTIONS}
    rows = {
        name: {
            "compliance": run.final,
            "over uncrossed": run.final / still.final,
            "iterations": run.iterations,
            "solves": run.solves[-1],
            "volume fraction": run.volume[-1],
            "grayness": run.design.grayness,
            "strut measure": float(run.design.rho[soft].mean() / run.design.rho.mean()),
        }
        for name, run in shown.items()
    }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("method")
    report.table("optimisation", table, f"Optimised with {crossing}, each compliance by the method's own analysis.")
    struts = {name: row["strut measure"] for name, row in rows.items()}
    holds = [
        report.check(
            "strut measure, standard with crossing over without",
            struts["standard"] / struts["standard, no crossing"],
            at_least=1.02,
            source=paper.STRUTS,
            why="more than another path of the optimiser makes, 0.5 % by B-splines without crossing",
        ),
        report.check(
            "derivative of compliance along a random direction, gradient against differences, relative, with crossing",
            max(gradient_error(name, crossing) for name in NAMES),
            at_most=1e-6,
            source=paper.CONSISTENT,
            why="central differences: step squared, 1e-8, times third derivatives",
        ),
    ]
    report.check(
        "excess of the strut measure over that without crossing, GIMP over standard",
        (struts["GIMP"] - struts["standard, no crossing"]) / (struts["standard"] - struts["standard, no crossing"]),
        at_most=0.5,
        source=paper.GIMP_ALIGNS,
        why="our reading of aligns: nearer to the design without crossing than to that of standard",
        reason="columns that jump alone leave gaps which GIMP counts too: in the solid its tip rises by "
        f"{calibrations[REPRODUCTION].rise['GIMP']:.1%}, under the wave, where neighbours move alike, by "
        f"{calibrations['wave(n, 0.26)'].rise['GIMP']:.1%} (first table)",
    )
    draw_optimisation(report, shown, crossing)
    lock({f"optimised compliance, {name}": row["compliance"] for name, row in rows.items()}, rtol=RTOL_OPTIMUM)
    assert all(holds)


def gradient_error(name: str, crossing: Crossing) -> float:
    """Relative difference of g.d to (J(x + t d) - J(x - t d)) / 2t, from the uniform design, d random, t = 1e-4."""
    problem = material_points(SHAPE_FUNCTIONS[name], name, crossing)(cantilever()).problem
    x, t = problem.x0, 1e-4
    direction = np.random.default_rng(13).uniform(-1, 1, len(x))
    gradient = problem.gradient(problem.evaluate(x))[0] @ direction
    plus, minus = (float(problem.evaluate(x + sign * t * direction).objective) for sign in (1, -1))
    return abs((plus - minus) / (2 * t) / float(gradient) - 1)


def draw_optimisation(report: Report, shown: dict[str, Optimisation], crossing: Crossing) -> None:
    figure, axes = plt.subplots(3, 2, figsize=(7.0, 6.2), sharex=True, sharey=True)
    for ax, (name, run) in zip(axes.flat, shown.items(), strict=False):
        draw_design(ax, run.design.x, run.design.half_length, run.design.rho)
        ax.set(title=f"{name}: {run.final:.5g}")
        ax.label_outer()
    axes[1, 1].xaxis.set_tick_params(labelbottom=True)
    axes[1, 1].set(xlabel="x / h")
    axes[2, 1].set_axis_off()
    report.figure("layouts", figure, f"Designs and compliance by the method that made them, {crossing}.")

    figure, (top, bottom) = plt.subplots(2, 1, figsize=(5.0, 5.4), height_ratios=(1, 1))
    for name, run in shown.items():
        top.semilogy(run.objective, label=name)
    top.set(xlabel="iteration", ylabel="compliance [F²/E0]", yticks=(80, 100, 200, 400))
    top.set_yticklabels(["80", "100", "200", "400"])
    top.minorticks_off()
    top.legend()
    for name in ("standard, no crossing", *NAMES):
        design = shown[name].design
        columns, column = np.unique(np.round(design.x[:, 0], 6), return_inverse=True)
        # the line style of the history above
        style = list(shown).index(name)
        cycle = plt.rcParams["axes.prop_cycle"].by_key()
        bottom.plot(
            columns,
            np.bincount(column, design.rho) / np.bincount(column),
            color=cycle["color"][style],
            linestyle=cycle["linestyle"][style],
        )
    bottom.set(xlabel="x / h", ylabel="mean density of column")
    report.figure(
        "history", figure, "Compliance by iteration; mean density of each column of points: peaks are struts."
    )


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
    rows = {}
    for (family, name), run in runs.items():
        fine = judge(run.design.at(uncrossed.x)).compliance
        rows[str(calibrations[family].crossing), name] = {
            "apparent loss": run.final / still.final - 1,
            "without crossing": uncrossed.compliance(run.design) / still.final - 1,
            "fine reference": fine / best - 1,
            "compliance, fine reference": fine,
        }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis(["crossing", "method"])
    report.table(
        "true_loss",
        table,
        f"Loss against the design optimised without crossing ({best:.5g} on the fine reference), by three analyses.",
        4,
    )
    crossing = str(calibrations[REPRODUCTION].crossing)
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
    spline = rows[crossing, "quadratic B-spline"]
    named = {"standard": "MPM, crossed", "GIMP": "GIMP, crossed", "quadratic B-spline": "B-spline, crossed"}
    report.found(
        f"{moved(calibrations[REPRODUCTION].crossing)}, the true compliance of designs is "
        f"{changed(standard['fine reference'])} with standard MPM, {changed(gimp['fine reference'])} with GIMP, "
        f"{changed(spline['fine reference'])} with quadratic B-splines; the methods themselves report "
        f"{standard['apparent loss']:+.1%}, {gimp['apparent loss']:+.1%} and {spline['apparent loss']:+.1%}.",
        front="Points have crossed cells",
    )
    order = sorted((row["fine reference"], name) for name, row in (("standard MPM", standard), ("GIMP", gimp)))
    report.so(
        f"Keep points as seeded where you can; if they have crossed, take {order[0][1]} rather than {order[1][1]}"
        + (", or quadratic B-splines" if spline["fine reference"] < order[0][0] else "")
        + ", and judge the final design by a finer analysis (`reference_fem.reanalyse`).",
        front="What to do",
    )
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
    black = {name: judge(design.at(uncrossed.x)).compliance for name, design in cut.items()}
    true = {shown: rows[crossing, name]["compliance, fine reference"] for name, shown in named.items()}
    true["MPM, as seeded"] = best
    report.table(
        "thresholded",
        pd.DataFrame({"fine reference": true, "cut to black and white": black}).rename_axis("design of"),
        f"The same designs cut to black and white at their volume, compliance on the fine reference, {crossing}.",
        4,
    )
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
    lock({f"{c}, {name}": row["compliance, fine reference"] for (c, name), row in rows.items()}, rtol=RTOL_OPTIMUM)
    assert all(holds)


@pytest.mark.slow
def test_numbers_of_the_paper(
    report: Report,
    calibrations: dict[str, Calibration],
    still: Optimisation,
    runs: dict[tuple[str, str], Optimisation],
) -> None:
    """Every number of Sect. 5.2.1

    Compliances are compared as they are, since the uncrossed one was calibrated (cantilever study); increases to the
    paper's own percentages, which its own compliances do not give (errata: +8.9 % and +3.5 %).
    """
    crossing, rise = calibrations[REPRODUCTION]
    final = {name: runs[REPRODUCTION, name].final for name in NAMES}
    shift = str(crossing)
    compliance = f"{RTOL_COMPLIANCE:.2%}: what the optimum scatters by update rule and start"
    tenth = f"{RTOL_RISE:.0%} of it: a rise is what crossing makes"
    spread = [runs[family, "standard"].final / still.final - 1 for family in calibrations]
    depends = (
        "the pattern is ours: calibrated on one number, the families raise the optimum of standard by "
        f"{min(spread):.1%} to {max(spread):.1%}"
    )
    base = f"the optimum without crossing is {still.final / paper.CANTILEVER_COMPLIANCE.value - 1:+.1%} off already; "
    compare(
        report,
        (
            Compared(
                "rise of the tip displacement of the solid, standard",
                paper.CANTILEVER_CROSSING_TIP_STANDARD,
                rise["standard"],
                f"{shift}, chosen for it",
                RTOL_RISE,
                tenth,
            ),
            Compared(
                "rise of the tip displacement of the solid, GIMP",
                paper.CANTILEVER_CROSSING_TIP_GIMP,
                rise["GIMP"],
                shift,
                None,
                "the paper's bound",
                "a column that jumps alone leaves a gap and makes an overlap, and GIMP counts both; under the wave, "
                f"where neighbours move alike, it rises by {calibrations['wave(n, 0.26)'].rise['GIMP']:.1%}",
            ),
            Compared(
                "optimum, standard",
                paper.CANTILEVER_CROSSING_STANDARD,
                final["standard"],
                shift,
                RTOL_COMPLIANCE,
                compliance,
                base + depends,
            ),
            Compared(
                "optimum, GIMP",
                paper.CANTILEVER_CROSSING_GIMP,
                final["GIMP"],
                shift,
                RTOL_COMPLIANCE,
                compliance,
                base + f"its rise is {final['GIMP'] / still.final - 1:.1%}, the paper's own numbers give "
                f"{paper.CANTILEVER_CROSSING_GIMP.value / paper.CANTILEVER_COMPLIANCE.value - 1:.1%}",
            ),
            Compared(
                "rise of the optimum, standard",
                paper.CANTILEVER_CROSSING_STANDARD_INCREASE,
                final["standard"] / still.final - 1,
                shift,
                RTOL_RISE,
                tenth,
                depends,
            ),
            Compared(
                "rise of the optimum, GIMP",
                paper.CANTILEVER_CROSSING_GIMP_INCREASE,
                final["GIMP"] / still.final - 1,
                shift,
                RTOL_RISE,
                tenth,
                depends,
            ),
        ),
    )
