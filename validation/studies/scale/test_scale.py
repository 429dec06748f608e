"""Scale: from thousands of points to millions

One iteration of the cantilever's optimisation by standard MPM, for compliance and for the p-norm of stress (p = 12,
q = 0.5), on ever finer grids: its phases per material point, how they grow, and memory. The filter's radius is three
point spacings at every size. Below `MULTIGRID_FROM` unknowns K is factored by Cholesky, from there on conjugate
gradients with geometric multigrid solve, to a residual of 3e-6; the p-norm asks for 1e-8 and for an adjoint, and its K
is factored at any size. Seconds of CPU, one thread, medians over iterations of GCMMA with one solve each, from the
uniform start: on the timings page up to 125,000 points; on the benchmark page to two millions, each size in a process
of its own, whose largest memory is given.
"""

from collections.abc import Callable, Iterable
from functools import partial

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from mpmtop.solvers import MULTIGRID_FROM, SPARSE_FROM, BandedCholesky, MultigridCG, SparseCholesky
from validation.bodies.scenes import cantilever
from validation.bodies.sketch import CHOSEN, opening
from validation.harness.progress import ShowProgress
from validation.harness.report import Report
from validation.studies.scale.sizes import (
    OBJECTIVES,
    PHASES,
    ChosenBy,
    Measurement,
    alone,
    elapsed,
    exponents,
    iteration_seconds,
    measurement,
    run_of,
)

SOURCES = {"load": CHOSEN, "filter radius": CHOSEN, "E_min / E0": CHOSEN, "rho_min": CHOSEN}
"""Of the parameters that are not the paper's."""
ASKED = "How do time and memory of an iteration grow, up to millions of points?"

FOUND = (
    "An iteration of 2,000,000 points takes {CPU seconds of an iteration, median; 2,000,000 points, 100 iterations} s "
    "of CPU in a run of 100 for compliance, {CPU seconds of an iteration, largest; 2,000,000 points, 100 iterations} s "
    "at most, and {peak memory [GiB]; 2,000,000 points, 100 iterations} GiB; a run's time grows with the power "
    "{exponent of a whole run} of the number of points, from 500,000 on.",
    "The first iterations, before members form, grow with the power {exponent of an iteration, compliance} from "
    "125,000 points on, {exponent of an iteration, p-norm} for the p-norm of stress, of which 2,000,000 points take "
    "{CPU seconds of an iteration, 2,000,000 points, p-norm, median} s.",
)
SIZES = (80, 200, 500)
LARGE = (500, 1000, 1416, 2000)
"""Points along the cantilever: 3,200, 20,000 and 125,000 points; to 500,000, 1,002,528 and 2,000,000."""
BRACKET = 1580
"""Points along the L-bracket, 1,597,696 in all."""
LINEAR = 1.1
"""Largest exponent of what counts as linear growth: 125,000 points still fit the processor's cache in part, and the
filter's Fourier transform grows as n log n, an exponent of 1.07 here."""
TOLERANCE = 1e-6


Runs = dict[tuple[str, int], Measurement]
"""By objective and points along the cantilever."""


def measured(sizes: tuple[int, ...], run: Callable[[str, int], Measurement], progress: ShowProgress) -> Runs:
    cases = [(objective, nx) for objective in OBJECTIVES for nx in sizes]
    return {case: run(*case) for case in progress(cases, "sizes")}


def recorded(report: Report, runs: Runs, fit_from: int) -> dict[str, dict[str, float]]:
    """Tables and figure of the phases; the exponents of each objective's phases from a size on."""
    fitted = {}
    figure, axes = plt.subplots(1, len(OBJECTIVES), figsize=(8.6, 3.6), sharey=True)
    for ax, objective in zip(axes, OBJECTIVES, strict=True):
        of_objective = [run for (name, _), run in runs.items() if name == objective]
        points = np.array([run.points for run in of_objective])
        seconds = {phase: np.array([run.median[phase] for run in of_objective]) for phase in PHASES}
        total = np.array([np.median(run.totals) for run in of_objective])
        built = {name: np.array([run.built[name] for run in of_objective]) for name in of_objective[0].built}
        per_point = pd.DataFrame({phase: 1e9 * spent / points for phase, spent in (seconds | built).items()}).T
        per_point.columns = pd.Index([f"{p:,}" for p in points])
        fit = points >= fit_from
        if np.count_nonzero(fit) > 1:
            growth = exponents(
                {name: spent[fit] for name, spent in (seconds | built | {"all": total}).items()}, points[fit]
            )
            per_point["exponent"] = pd.Series(growth)
            fitted[objective] = growth
        report.timed.table(
            f"phases_{objective.replace('-', '_')}",
            per_point.rename_axis("phase"),
            f"Nanoseconds per point of one iteration, {objective}, by number of points; the last two rows once for all "
            "iterations." + (f" Exponents from {fit_from:,} points on." if objective in fitted else ""),
            3,
        )
        table = pd.DataFrame(
            {
                "points": points,
                "unknowns": [run.unknowns for run in of_objective],
                "solver": [run.solver for run in of_objective],
                "iteration, median [s]": total,
                "largest [s]": [run.totals.max() for run in of_objective],
                "operators [s]": built["operators"] + built["filter built"],
                "peak memory [GiB]": [run.peak / 2**30 for run in of_objective],
            }
        ).dropna(axis="columns")
        report.timed.table(f"sizes_{objective.replace('-', '_')}", table, f"One iteration, {objective}.", 3)
        colors = [*plt.rcParams["axes.prop_cycle"].by_key()["color"], "#8c564b"]  # one more than the cycle has
        for (phase, spent), marker, color in zip(seconds.items(), ".sv^DxP", colors, strict=True):
            ax.loglog(points, spent, marker=marker, markersize=4, color=color, label=phase)
        ax.loglog(points, total, color="0.2", linewidth=2, marker="o", label="iteration")
        ax.loglog(points, 2 * total[-1] * points / points[-1], color="0.6", linestyle=":", label="linear")
        ax.set(title=objective, xlabel="material points", ylabel="CPU seconds" if ax is axes[0] else "")
        ax.xaxis.set_minor_formatter(NullFormatter())  # over less than a decade its labels would run into each other
    axes[-1].legend(loc="center left", bbox_to_anchor=(1.02, 0.5))
    report.timed.figure("phases", figure, "Phases of an iteration by number of points.")
    return fitted


@pytest.mark.slow
def test_phases(report: Report, progress: ShowProgress) -> None:
    """Phases of an iteration

    Iterations are those that an optimisation makes, taken apart by a clock around the operators: what an iteration
    takes is the sum of its phases.
    """
    opening(report, cantilever(), SOURCES, note="At every size the points are as many times finer.")
    runs = measured(SIZES, lambda objective, nx: measurement(nx, objective, 3), progress)
    recorded(report, runs, SIZES[-1] ** 2)
    table = pd.DataFrame(
        {(name, run.points): {"unknowns": run.unknowns, "solver": run.solver} for (name, _), run in runs.items()}
    ).T.rename_axis(["objective", "points"])
    report.table("sizes", table, "Sizes of a plain run.")
    falls = [bool(run.objective[-1] < run.objective[0]) for (name, _), run in runs.items() if name == "compliance"]
    assert report.check("sizes whose compliance fell", sum(falls), len(SIZES), source="our aim")


@pytest.mark.slow
def test_multigrid(report: Report) -> None:
    """What the optimisation sees of the iterative solver

    The same optimisation with banded Cholesky and with multigrid, made to go through at least three levels on 20,000
    points (it would not be chosen there), for ten iterations. Compliance is off by the square of the residual's
    tolerance, but its gradient by a part of it, and gradients lead to designs: 3e-6 is chosen for it. A p-norm is off
    by the tolerance itself, and its optimisation multiplies any difference by about ten in five iterations,
    rounding's, too: 1e-8 is chosen for objectives of stress.
    """
    same = [compared(report, 200, objective, 10, coarsest=1_000) for objective in ("compliance", "p-norm")]
    report.so(
        f"Cholesky and multigrid make one optimisation, to {TOLERANCE:g} of the objective: the faster one is chosen, "
        f"multigrid from {MULTIGRID_FROM:,} unknowns on, where the objective does not ask for a tight tolerance."
        if all(same)
        else "Multigrid changes the optimisation: its tolerance is too wide."
    )
    assert all(same)


DIRECT: dict[ChosenBy, str] = {BandedCholesky: "banded Cholesky", SparseCholesky: "sparse Cholesky"}


def compared(
    report: Report, nx: int, objective: str, iterations: int, coarsest: int, direct_solver: ChosenBy = BandedCholesky
) -> bool:
    """Check that both solvers' optimisations have the same objective, to the tolerance."""
    direct, direct_rho = run_of(nx, objective, iterations, direct_solver)
    iterative, iterative_rho = run_of(nx, objective, iterations, partial(MultigridCG, coarsest=coarsest))
    size = f"{objective}, {nx * nx // 2:,} points, {iterations} iterations"
    report.text(f"{size}: largest difference of a density at the end {np.abs(iterative_rho - direct_rho).max():.0e}.")
    return report.check(
        f"largest relative difference of the objective, multigrid against {DIRECT[direct_solver]}; {size}",
        rounded_up(float(np.abs(iterative / direct - 1).max())),
        at_most=TOLERANCE,
        source="our aim",
    )


def rounded_up(difference: float) -> float:
    """One digit, as the others are rounding's: no less than the difference."""
    decade = 10.0 ** np.floor(np.log10(difference))
    return float(f"{np.ceil(difference / decade) * decade:.0e}")


@pytest.mark.benchmark
def test_large(report: Report, progress: ShowProgress) -> None:
    """Two million points

    Exponents are fitted from 125,000 points on. The first size is solved by sparse Cholesky, the others by multigrid
    for compliance.
    """
    runs = measured(LARGE, lambda objective, nx: alone(nx, objective, 8), progress)
    growth = recorded(report, runs, LARGE[0] ** 2 // 2)
    for objective in OBJECTIVES:
        largest = runs[objective, LARGE[-1]]
        report.timing(
            f"exponent of an iteration, {objective}", growth[objective]["all"], at_most=1.15, source="our aim"
        )
        others = {phase: growth[objective][phase] for phase in PHASES if phase not in ("factorisation", "solve")}
        report.timing(
            f"largest exponent of a phase but those of the linear solve, {objective}",
            max(others.values()),
            at_most=LINEAR,
            source="our aim: linear",
        )
        report.timing(
            f"CPU seconds of an iteration, 2,000,000 points, {objective}, median",
            float(np.median(largest.totals)),
            **({"at_most": 10.0, "source": "our aim"} if objective == "compliance" else {"source": "for comparison"}),
        )
        report.timing(
            f"peak memory [GiB], 2,000,000 points, {objective}", largest.peak / 2**30, at_most=8.0, source="our aim"
        )


@pytest.mark.benchmark
def test_whole_runs(report: Report, progress: ShowProgress) -> None:
    """Whole optimisations

    The designs that are hard for multigrid come after the first ones: where members form, and gaps between them are
    narrower than what coarse levels resolve. So 100 iterations of compliance, 500,000 and 2,000,000 points. A solve
    that takes more than 40 cycles is left to sparse Cholesky.
    """
    sizes = (LARGE[1], LARGE[-1])
    limits = dict(zip(sizes, (0.75, 3.5), strict=True))
    runs = {nx: alone(nx, "compliance", 100) for nx in progress(sizes, "sizes")}
    report.timed.figure("whole_runs", seconds_figure(runs.values()), "Cycles and CPU seconds of every iteration.")
    growth = exponents({"all": np.array([run.totals.sum() for run in runs.values()])}, np.array([*runs]) ** 2 / 2)
    report.timing("exponent of a whole run", growth["all"], at_most=1.15, source="our aim")
    for nx, run in runs.items():
        whole(report, f"{run.points:,} points, 100 iterations", run, limits[nx])


@pytest.mark.benchmark
def test_whole_stress_run(report: Report) -> None:
    """A whole optimisation of stress

    The p-norm of the L-bracket, 60 iterations: two solves each, to a tolerance that multigrid is too dear for.
    """
    run = alone(BRACKET, "p-norm", 60, "L-bracket")
    caption = f"CPU seconds of every iteration, L-bracket, {run.points:,} points."
    report.timed.figure("whole_stress_run", seconds_figure([run]), caption)
    whole(report, f"L-bracket's p-norm, {run.points:,} points, 60 iterations", run, 8.0)


def seconds_figure(runs: Iterable[Measurement]) -> Figure:
    """CPU seconds by iteration, and cycles of multigrid where it solves."""
    runs = list(runs)
    iterated = any(np.any(run.cycles) for run in runs)
    figure, axes = plt.subplots(1, 2 if iterated else 1, figsize=(8.6 if iterated else 5.0, 3.2), squeeze=False)
    for run in runs:
        axes[0, -1].plot(run.totals, label=f"{run.points:,} points")
        if iterated:
            axes[0, 0].plot(run.cycles, label=f"{run.points:,} points")
    axes[0, -1].set(xlabel="iteration", ylabel="CPU seconds", ylim=(0, None))
    if iterated:
        axes[0, 0].set(xlabel="iteration", ylabel="cycles of multigrid", ylim=(0, None))
    axes[0, 0].legend()
    return figure


def whole(report: Report, at: str, run: Measurement, median: float) -> None:
    """Record a run's iterations, their median against a limit [CPU s], and its memory."""
    seconds = float(np.median(run.totals))
    report.timing(f"CPU seconds of an iteration, median; {at}", seconds, at_most=median, source="our aim")
    report.timing(
        f"CPU seconds of an iteration, largest; {at}", float(run.totals.max()), at_most=10.0, source="our aim"
    )
    report.timing(f"peak memory [GiB]; {at}", run.peak / 2**30, at_most=4.0, source="our aim")


@pytest.mark.benchmark
def test_second_core(report: Report, progress: ShowProgress) -> None:
    """What a second core gives to one run

    Seconds by the clock on the wall of an iteration, with one thread of BLAS and with two, medians of five. Only dense
    blocks of a factorisation are shared between threads, so that one is what every run takes unless told otherwise: a
    second core is better spent on a second scene.
    """
    cases = (("cantilever", "compliance", LARGE[1]), ("cantilever", "compliance", LARGE[-1]))
    for body, objective, nx in progress((*cases, ("L-bracket", "p-norm", BRACKET)), "runs"):
        (points, one), (_, two) = (elapsed(nx, objective, body, threads) for threads in (1, 2))
        what = (
            f"elapsed time of an iteration with two threads over that with one; {body}, {objective}, {points:,} points"
        )
        report.timing(what, two / one, source="for comparison")


@pytest.mark.benchmark
def test_multigrid_large(report: Report) -> None:
    """What the optimisation sees of it, where it is chosen

    The same comparison on 320,000 points with the levels that the solver chooses itself, beside sparse Cholesky; for
    compliance 60 iterations.
    """
    runs = (("compliance", 60), ("p-norm", 10))
    same = [compared(report, 800, *run, MultigridCG.coarsest, SparseCholesky) for run in runs]
    assert all(same)


@pytest.mark.benchmark
def test_crossover(report: Report, progress: ShowProgress) -> None:
    """Where one solver overtakes another

    CPU seconds of an iteration of compliance by two solvers, taken in turn: medians of five, after ten iterations. The
    solver is chosen by size: what counts is what the choice costs over the faster one.
    """
    choices = (
        ("banded", "sparse", SPARSE_FROM, (200, 260, 300, 340, 400, 500)),
        ("sparse", "multigrid", MULTIGRID_FROM, (400, 480, 560, 640, 800)),
    )
    for small, large, threshold, sizes in progress(choices, "choices"):
        table = pd.DataFrame([iteration_seconds(nx, (small, large)) for nx in sizes]).set_index("unknowns")
        table["ratio"] = table[small] / table[large]
        report.timed.table(f"crossover_{large}", table, f"CPU seconds of an iteration, and {small} over {large}.", 3)
        chosen = np.where(table.index >= threshold, table[large], table[small])
        report.timing(
            f"CPU of an iteration by the chosen solver, {large} from {threshold:,} unknowns on, over the faster one's: "
            "the largest of all sizes",
            float(np.max(chosen / table[[small, large]].min(axis=1))),
            source="for comparison",
        )
