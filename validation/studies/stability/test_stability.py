"""Stability: broken on purpose

Thousands of inputs far from what is sensible. Each must come out as one of three: **right**, by a reference or an
invariant, to a stated tolerance; a **named error** that says the cause and the cure; a documented **limit**, right for
the discrete problem and far from the body's physics. Anything else, a wrong number, NaN, a warning, a false alarm, is
**other**, and there must be none.

An analysis is judged by u, compliance, p-norm and both gradients in extended precision, by a route of its own: shape
functions, strains, tangent, load, clamp and objectives from closed forms, K in full, residuals of extended precision.
Only the ghost penalty's operators are those of the code under test. Where a long double has the 53 bits of a double,
the reference is plain double; the bits of this machine are among the claims. The compliance must agree to 1e-8; what
depends on strains to 1e-8 or, where the condition number of the scaled stiffness leaves fewer digits, to ten times its
rounding error, and never worse than 1e-4. An error is a named one only if the input asks for its class and, where that
is for a stiffness close to singular, the condition number is beyond 1e13. The body is a cantilever of 5 x 2 cells
unless stated; h = E0 = F = 1; **B-spline** is the quadratic one. The error against Poisson's ratio is shown with the
remedy for locking.
"""

from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
import pandas as pd
import pytest

from mpmtop.arrays import Array
from mpmtop.equilibrium import equilibrium
from mpmtop.errors import NotConverged, UnsupportedBody
from mpmtop.model import Model
from mpmtop.solvers import Solve, Solver
from validation.bodies.sketch import CHOSEN, opening
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.oracles.extended import condition, plain_condition
from validation.studies.stability.cases import GHOST, beam, fields, lattice, model_of
from validation.studies.stability.figures import Cuts, column, draw_contrast, draw_cuts, draw_positions
from validation.studies.stability.interruption import AFTER
from validation.studies.stability.judge import KINDS, densities, direct, distance, quantities, reference
from validation.studies.stability.outcomes import SECTIONS, compared, outcomes, outcomes_twice, tabulate
from validation.studies.stability.runs import killed_runs

# points are moved off the clamp and over grid lines on purpose
pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

ASKED = "What comes of inputs far past what is sensible: the right value, a named error, or a wrong number in silence?"

RTOL_CONDITION = 1e-6
"""Condition numbers of small matrices below 1e9: seven digits are left."""
EVERY = 12
"""Of the analyses, one in twelve is done by multigrid, too."""
ANSWERED = 0.8
"""Part of the analyses that both solvers must answer: with fewer, a comparison of them says little."""


def displacements(model: Model) -> tuple[Array, Array]:
    """Displacements of points (p, 2) and nodes (a, 2) of the solid body; NaN where it has none."""
    try:
        u = equilibrium(model, np.ones(len(model.points.x))).u
    except (UnsupportedBody, NotConverged):
        u = np.full(len(model.f_ext), np.nan)
    return model.transfer.interpolate(u), u.reshape(-1, 2)


@pytest.mark.benchmark
def test_positions(report: Report) -> None:
    """Positions

    The points shifted over a whole cell in x, y and both: sixteenths, every line that points, domains or the body
    cross, and 1e-12 to 1e-2 on both sides of it. A shift in x opens a gap at the clamp; with the tent and the B-spline
    an error says so once no point is left in the clamped cells, with GIMP once the overlap is lost in rounding. The
    scene and its grid moved to another origin, by irrational numbers and by 1e6 h, where positions are known to 1e-10 h
    only: the compliance of the scene in its place. The grid alone moved.
    """
    own = ("size", "material points", "load", "volume fraction", "filter radius", "E_min / E0", "rho_min")
    sources = dict.fromkeys(own, CHOSEN)
    opening(
        report, beam(), sources, points=lattice(), note="Cases change one thing at a time, far past what is sensible."
    )
    none_else = tabulate(report, "positions", outcomes("Positions"), "Positions: cases and outcomes.")
    draw_positions(report)
    assert none_else


@pytest.mark.slow
def test_small_cuts(report: Report, lock: Lock) -> None:
    """Small cuts

    GIMP domains that overlap the next cells by 0.2 to 2e-12 of a cell; points of tent and B-spline as far over a grid
    line. The plain condition number grows without bound. Scaled by the diagonal it does not, to which the rounding
    error of Cholesky's method is blind: u is right for the discrete problem at any cut. The nodes outside are tied by a
    hair of material: at the corner they move many times as far as the points do, so no quantity of interest is taken at
    a node. Not tied, they no longer stiffen the edge either: a step of the points' displacements at an infinitesimal
    cut, large on a body of two cells across, and a limit. The ghost penalty (`discretise(..., ghost=0.01)`) bounds the
    condition number and the nodes, and takes most of the step away. A larger body's compliances are AMPLE's to 1e-10.
    What reaches over a line by less than 1e-12 of a cell lies on it by tolerance: the smallest cuts are none.
    """
    none_else = tabulate(report, "small_cuts", outcomes("Small cuts"), "Small cuts: cases and outcomes.")
    sizes = 10.0 ** -np.arange(1, 15)
    still = {ghost: displacements(direct(model_of("GIMP", ghost=ghost)))[0] for ghost in (0.0, GHOST)}
    rows: Cuts = {}
    for ghost, remedy in {0.0: "none", GHOST: "ghost penalty"}.items():
        for s in sizes:
            model = direct(model_of("GIMP", (s, s), ghost=ghost))
            points, nodes = displacements(model)
            solid = np.ones(len(model.points.x))
            largest = np.abs(still[ghost]).max()
            rows[remedy, s] = {
                "condition": plain_condition(model, solid),
                "condition, scaled": condition(model, solid),
                "points, change": float(np.abs(points - still[ghost]).max() / largest),
                "nodes over points": float(np.abs(nodes).max() / np.abs(points).max()),
            }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis(["remedy", "cut / h"])
    report.table(
        "cut_sizes",
        table,
        "GIMP, domains over the lines by the cut in x and y: condition numbers; change of the points' displacements to "
        "the body without a cut, largest by largest; largest displacement of a node over that of a point.",
        3,
    )
    draw_cuts(report, rows)
    ghosted = column(rows, "ghost penalty")
    bounded = report.check(
        "largest condition number with the ghost penalty, over that at a cut of 0.1 h",
        max(ghosted["condition"]) / ghosted["condition"][0],
        at_most=2.0,
        source="our bound: however small the cut",
    )
    quiet = report.check(
        "largest displacement of a node over that of a point, ghost penalty",
        max(ghosted["nodes over points"]),
        at_most=1.5,  # nodes at the free end are outside the points, by up to a cell of five
        source="our bound",
    )
    lock({f"{remedy}, {s:g}": row["condition"] for (remedy, s), row in rows.items() if s == 0.1}, rtol=RTOL_CONDITION)
    less = report.check(
        "step of the points' displacements at a cut of 1e-9 h, ghost penalty, over that with none",
        rows["ghost penalty", sizes[8]]["points, change"] / rows["none", sizes[8]]["points, change"],
        at_most=0.5,
        source="our bound: most of it",
    )
    assert none_else and bounded and quiet and less


@dataclass(frozen=True, eq=False)
class Unchecked:
    """A solver that is believed: no answer of it is refined or refused."""

    solver: Solver
    tolerance: float = np.inf

    def factor(self, data: Array, tolerance: float | None = None) -> Solve:
        return self.solver.factor(data)


@pytest.mark.benchmark
def test_contrast(report: Report) -> None:
    """Contrast and density fields

    E_min / E0 from 1 to 1e-15, and zero; the paper's E_min = 1e-6 read as absolute (1e-12) and as relative; solid,
    void, checkerboards, a bridge of one point, a loaded end on void, islands at random, a slit, grey at random.

    Where void carries the load, as many digits of the strains are lost as the void is softer, by any solver. A residual
    small beside the load says little then: the p-norm's **adjoint** may miss the soft mode that decides its gradient.
    One solve by multigrid to a residual of 1e-6 leaves gradients wrong by a tenth, in silence; by the direct solver
    they lose digits. So state and adjoint are accepted by the residual and by its work on the state, and refined where
    that is more than the tolerance; what does not get there is refused.
    """
    cases = outcomes("Contrast and density fields")
    none_else = tabulate(report, "contrast", cases, "Contrast and density fields: cases and outcomes.")
    named = {"direct": direct, "multigrid": lambda model: model}
    rows: list[tuple[str, float, float, float]] = []
    for k in (0, 2, 4, 5, 6, 7, 8, 10, 12):
        model = model_of("tent")
        rho = dict(fields(lattice().x))["loaded end on void"]
        rho, moduli = densities(model, rho, 10.0**-k if k else 1 - 1e-12)
        exact, _ = reference(model, moduli, rho)
        for name, take in named.items():
            for checked in (False, True):
                used = take(model) if checked else replace(take(model), solver=Unchecked(take(model).solver))
                try:
                    found = quantities(used, equilibrium(used, moduli), rho)
                    C, gradient = (distance(found[i], exact[i]) for i in (0, 3))
                except (UnsupportedBody, NotConverged):
                    C = gradient = np.nan
                what = "checked" if checked else "one solve"
                rows.append((f"{name}, {what}", 10.0**-k, C, gradient))
    table = pd.DataFrame(rows, columns=["solver", "contrast", "compliance", "gradient of the p-norm"])
    # how rounding errors of this size come out depends on the processor
    report.timed.table("contrast_errors", table, "Relative errors, loaded end on void, tent; empty: a named error.", 2)
    draw_contrast(report, rows)
    worst = {name: np.nanmax([row[3] for row in rows if row[0] == name]) for name in {row[0] for row in rows}}
    right = report.check(
        "gradients of the p-norm that are not refused are right to 1e-4, loaded end on void",
        bool(max(error for name, error in worst.items() if "checked" in name) <= 1e-4),
        True,
        source="the tolerance of a gradient",
    )
    report.check(
        "one solve by multigrid, unchecked, leaves them wrong by more than a hundredth",
        bool(worst["multigrid, one solve"] > 0.01),
        True,
        source="why the check is there",
    )
    assert none_else and right


@pytest.mark.benchmark
def test_points(report: Report) -> None:
    """Points

    One to eight points per cell, equal or not, at several shifts; a cell without points; one point alone; 1,000 clouds
    of random number, place and size. In many clouds a node hangs on a single point and turns about it, or a piece
    floats: a mechanism, named with its node and, where a piece floats, its island. Behind other small pivots rounding
    may leave that of a mechanism far above rounding: a small pivot costs two more solves, which find the direction of
    least stiffness.
    """
    assert tabulate(report, "points", outcomes("Points"), "Points: cases and outcomes.")


@pytest.mark.benchmark
def test_scales(report: Report) -> None:
    """Scales

    Poisson's ratio from -0.9 to 0.49999, cells from 1000 : 1 to 1 : 1000, and h from 1e-9 to 1e9, E from 1e-6 to 1e12,
    F from 1e-12 to 1e12 together: compliance E / F², p-norm h / F, their gradients and displacement E / F must be those
    of h = E = F = 1, to 1e-10; and so must the design after five steps of GCMMA at the ends of these ranges, to 1e-8.
    Close to 0.5 the body locks, a limit.
    """
    assert tabulate(report, "scales", outcomes("Scales"), "Scales: cases and outcomes.")


@pytest.mark.slow
def test_parameters(report: Report) -> None:
    """Parameters

    Penalty 1 to 10 by p 1 to 100 by q 0 to 3: the adjoint's directional derivative and a central difference, to 1e-5.
    Filter radius from 1e-9 h to 1000 h, volume fraction from 1e-3 to 1: five steps of GCMMA stay feasible and do not
    rise. Inputs outside their ranges, NaN and infinity among them, are refused.
    """
    assert tabulate(report, "parameter_cases", outcomes("Parameters"), "Parameters: cases and outcomes.")


@pytest.mark.benchmark
def test_optimiser(report: Report) -> None:
    """Optimiser

    A problem of known optimum, min sum c / x under a bound of the mean: random starts, most of them infeasible, reach
    it to 0.1 %; steps keep a move limit from 1e-6 to 1; without a gradient the design becomes feasible; NaN or infinity
    from the objective or its gradient, here and of the beam, ends the run by name; over 2,000 iterations neither volume
    nor objective drifts.
    """
    assert tabulate(report, "optimiser", outcomes("Optimiser"), "Optimiser: cases and outcomes.")


@pytest.mark.slow
def test_interruption(report: Report) -> None:
    """Interruption

    Runs with a checkpoint, each in a process of its own, killed by SIGKILL after every iteration, half-way through
    writing, between writing and renaming, and at some milliseconds from the start; then resumed: design, objective and
    number of solves of the run that was not killed, bit for bit. Truncated checkpoints, foreign files, and checkpoints
    with one bit flipped are refused, or what they hold is whole. VTU files reopen with the numbers written.
    That SIGKILL is what ended a run is looked up in its status; a kill by time may come too late.
    """
    none_else = tabulate(report, "interruption", outcomes("Interruption"), "Interruption: cases and outcomes.")
    killed = [end.killed for (_, moment), end in killed_runs().items() if moment in AFTER]
    hits = sum(killed)
    report.timed.text(f"Of {len(killed)} kills by time {hits} came before the end.")
    assert none_else


@pytest.mark.slow
def test_two_solvers(report: Report) -> None:
    """Two solvers

    One in twelve analyses of the sections above, drawn at random, once more by multigrid with two levels or more,
    beside the direct solver (`make benchmark`: every one): compliance, p-norm, gradients and displacements to ten times
    multigrid's tolerance of 1e-6. Where the direct solver refuses, extended precision or, if that sees a mechanism,
    too, the pseudo-inverse of K judges the compliance. Displacements of a piece in void may differ by what a force of
    the tolerance does to the void. An error is none of the comparisons; multigrid's, too, needs a condition number of
    1e13.
    """
    found = outcomes_twice(EVERY)
    none_else = tabulate(report, "two_solvers", found, "Multigrid beside the direct solver: one in twelve.")
    enough = report.check(
        "part of the analyses answered by multigrid and compared",
        compared(found) / len(found),
        at_least=ANSWERED,
        source="our aim",
    )
    assert none_else and enough


@pytest.mark.benchmark
def test_two_solvers_in_full(report: Report) -> None:
    """Two solvers, all analyses

    As above, with every analysis.
    """
    found = outcomes_twice(1)
    none_else = tabulate(report, "two_solvers_in_full", found, "Multigrid beside the direct solver: all analyses.")
    enough = report.check(
        "part of the analyses answered by multigrid and compared, all",
        compared(found) / len(found),
        at_least=ANSWERED,
        source="our aim",
    )
    assert none_else and enough


@pytest.mark.benchmark
def test_all_cases(report: Report, lock: Lock) -> None:
    """All cases

    The sections' counts, locked so that errors cannot take the place of right values unseen; comparisons of solvers are
    not among the cases again. Limits are told in the docstrings of
    `discretise`, `Support`, `Material` and, for the comparisons, `MultigridCG`.
    """
    found = {section: outcomes(section) for section in SECTIONS}
    every = tuple(chain.from_iterable(found.values()))
    rows = {
        section: {"cases": len(part)} | {kind: sum(case.kind == kind for case in part) for kind in KINDS}
        for section, part in (found | {"all": every}).items()
    }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("section")
    report.table("all_cases", table, "Cases tried and their outcomes.")
    what = pd.Series([f"{case.kind}: {case.what}" for case in every if case.kind in ("named error", "limit")])
    total = rows["all"]
    report.found(
        f"{total['cases']:,} cases: {total['right']:,} right, {total['named error']:,} named errors, "
        f"{total['limit']:,} limits that are documented, {total['other']} others."
    )
    report.so(
        "Nothing is wrong in silence among them."
        if not total["other"]
        else "The others are neither right nor named: they are listed, and fail the test."
    )
    counts = what.value_counts().rename_axis("outcome").rename("cases").to_frame()
    report.table("what", counts, "Which errors, which limits.")
    bits = np.finfo(np.longdouble).nmant + 1
    report.timed.text(f"The reference's numbers have {bits} bits; 53 is plain double.")
    enough = report.check("cases tried, no problem twice", len(every), at_least=5000, source="our aim")
    none_else = report.check("outcomes other than these three, all cases", rows["all"]["other"], 0, source="our aim")
    lock({f"{section}, {kind}": part[kind] for section, part in rows.items() for kind in KINDS}, rtol=0)
    assert enough and none_else
