"""Verification

What holds before anything is compared: identities of the discretisation that decide what a comparison can mean. Where
an identity breaks, that is a result.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from mpmtop.equilibrium import equilibrium
from mpmtop.grid import Grid
from mpmtop.model import discretise
from mpmtop.objectives import compliance
from mpmtop.optimizers import OptimalityCriteria, design_change, optimize
from mpmtop.points import MaterialPoints, seed
from mpmtop.region import Rectangle
from mpmtop.shape_functions import ShapeFunction
from mpmtop.transfer import body_ends, transfer
from reference_fem import simp
from reference_fem.simp import Filtered
from validation import paper
from validation.bodies.mbb import half_mbb
from validation.bodies.scenes import SPACING, H, cantilever
from validation.bodies.sketch import CHOSEN, PAPER, body_opening
from validation.harness.claims import Statement
from validation.harness.report import Report
from validation.methods.analyser import SHAPE_FUNCTIONS

# points are moved off the clamp and over grid lines on purpose
pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

ASKED = "Which shape functions pass the patch test, for which arrangements of points?"

CROSSED = "every 4th boundary crossed by 0.01 h"
"""The arrangement that is drawn."""
PUBLISHED: dict[Filtered, float] = {"density": 233.71457, "sensitivity": 216.81366}
"""Objectives that the codes print, by their filter."""


def arrangements() -> dict[str, MaterialPoints]:
    """Points of the cantilever: uniform, shifted as a whole, and uneven in three ways."""
    uniform = seed(cantilever().body.domain, (SPACING, SPACING))
    x = uniform.x[:, 0]
    last_column = np.isclose(x % (4 * H), 3.75 * H)
    rng = np.random.default_rng(20)
    return {
        "uniform": uniform,
        "shifted by 0.1 h": uniform.moved((0.1, 0.0)),
        "shifted by 0.3 h, points cross": uniform.moved((0.3, 0.0)),
        CROSSED: uniform.moved(np.outer(last_column, [0.26, 0.0])),
        "jitter of 0.05 h, no point crosses": uniform.moved(rng.uniform(-0.05, 0.05, uniform.x.shape)),
        "jitter of 0.3 h, points cross": uniform.moved(rng.uniform(-0.3, 0.3, uniform.x.shape)),
    }


def unbalanced(points: MaterialPoints, shape_function: ShapeFunction) -> float:
    """Largest nodal force of a unit stress sigma_xx at nodes with none but full cells around, in h sigma."""
    lower, upper = points.x.min(axis=0), points.x.max(axis=0)
    grid = Grid.around(np.floor(lower), np.ceil(upper), (H, H))
    operators = transfer(grid, points, shape_function, body_ends(grid, points))
    force = operators.B.T @ np.outer(points.volume, [1.0, 0.0, 0.0]).ravel()
    position = grid.node_positions()[operators.nodes]
    interior = np.all((position > lower + 2.5 * H) & (position < upper - 2.5 * H), axis=1)
    return float(np.linalg.norm(force.reshape(-1, 2)[interior], axis=1).max())


def test_patch(report: Report) -> None:
    """Patch test: is a constant stress in equilibrium?

    Nodal forces of a constant stress must vanish inside the body, whatever carries it. Points of equal size in a
    pattern that repeats from cell to cell pass with every function. Where the pattern varies, the tent's one-sided
    gradients count a whole point on one side of a cell boundary only: a finite force appears from an infinitesimal
    move. That force is the origin of the crossing error. GIMP weighs the domain's parts on both sides, and fails by
    the gaps and overlaps that an uneven shift leaves between the domains.
    """
    arranged = arrangements()
    body_opening(
        report,
        cantilever().body,
        arranged[CROSSED],
        {
            "size": ("40 h x 20 h", PAPER),
            "material points": (len(arranged[CROSSED].x), PAPER),
            "arrangements": (len(arranged), CHOSEN),
            "stress": ("sigma_xx = 1, given", CHOSEN),
        },
        note=f"Drawn: {CROSSED}. For the patch test neither support nor load plays a part.",
    )
    worst = {
        case: {name: unbalanced(points, f) for name, f in SHAPE_FUNCTIONS.items()} for case, points in arranged.items()
    }
    table = pd.DataFrame.from_dict(worst, orient="index").rename_axis("points").reset_index()
    # what is below rounding is no information, and differs from machine to machine
    shown = table.map(lambda cell: 0.0 if isinstance(cell, float) and cell < 1e-12 else cell)
    report.table(
        "patch", shown, "Largest unbalanced nodal force of a unit stress, in h sigma (below 1e-12 shown as 0).", 3
    )
    uniform = table.set_index("points").iloc[:3].to_numpy()
    holds = report.check(
        "uniform points, shifted or not, all functions: unbalanced force below 1e-12",
        bool(uniform.max() < 1e-12),
        True,
        source="equilibrium of a constant stress",
    )
    tell_patch(report, float(uniform.max()), holds, worst[CROSSED])
    # the paper speaks of points that cross; where none does, GIMP's domains cross all the same
    sources: dict[str, tuple[float | None, str | Statement]] = {
        CROSSED: (1.0, paper.MITIGATES),
        "jitter of 0.05 h, no point crosses": (None, "for comparison"),
    }
    for case, (at_most, source) in sources.items():
        report.check(
            f"unbalanced force, GIMP over standard: {case}",
            worst[case]["GIMP"] / worst[case]["standard"],
            at_most=at_most,
            source=source,
        )

    draw_patch(report)
    assert holds


def draw_patch(report: Report) -> None:
    """The unbalanced force while one column of points moves over a cell boundary."""
    shifts = np.linspace(0, 0.5, 101)
    strip = seed(Rectangle((0.0, 0.0), (12.0, 8.0)), (SPACING, SPACING))
    column = np.isclose(strip.x[:, 0], 5.75)
    figure, ax = plt.subplots()
    for name, function in SHAPE_FUNCTIONS.items():
        ax.plot(shifts, [unbalanced(strip.moved(np.outer(column, [s, 0.0])), function) for s in shifts], label=name)
    ax.axvline(0.25, color="0.4", linewidth=1, linestyle="-")
    ax.annotate("cell boundary", (0.26, 0.98), rotation=90, ha="left", va="top", fontsize="small")
    ax.set(xlabel="shift of one column of points / h", ylabel="unbalanced force / (h sigma)")
    ax.legend()
    report.figure(
        "patch", figure, "One column of points pushed over a cell boundary: the tent's force jumps, the others' grow."
    )


def tell_patch(report: Report, uniform: float, holds: bool, crossed: dict[str, float]) -> None:
    """What came out for uniform and for crossed points, and what follows."""
    report.found(
        f"Uniform points, shifted or not, pass to {uniform:.0e} with every function."
        if holds
        else f"Uniform points fail, by {uniform:.1e}."
    )
    fails = [name for name, force in crossed.items() if force > 1e-12]
    if fails:
        report.found(
            f"With every fourth boundary crossed the largest unbalanced force is {max(crossed.values()):.2g} h sigma, "
            f"and {', '.join(fails)} fail."
        )
        report.so("Points that moved unevenly with fixed volumes cannot represent a constant stress.")


def test_outer_edge(report: Report) -> None:
    """An infinitesimal move over the body's outer edge

    A point's domain that ends on the body's edge and is moved beyond it by a hair touches a row of nodes outside. Their
    stiffness is next to nothing, of order s² for an overlap s, but so is what holds them: they move as they like, by
    1/s, and let go a finite part of the strain at the edge. GIMP's compliance jumps, the displacement of the points
    stays finite. The independent code AMPLE does the same. The tent and the B-splines see the edge only when a
    point crosses it: the B-splines end with the last cell that holds a point. A study of crossing must not mix this up
    with crossing inside the body.
    """
    shifts = (0.0, 1e-9, 1e-6, 1e-3, 1e-2)
    scene = cantilever()
    points = seed(scene.body.domain, (SPACING, SPACING))
    rows: dict[str, dict[str, float]] = {}
    for name, function in SHAPE_FUNCTIONS.items():
        models = (discretise(scene.body, H, points=points.moved((0.0, s * H)), shape_function=function) for s in shifts)
        values = [compliance(model, equilibrium(model, np.ones(len(points.x)))) for model in models]
        rows[name] = {f"{s:g} h": v / values[0] - 1 for s, v in zip(shifts, values, strict=True)}
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("shift in y")
    report.table("outer_edge", table.round(6).reset_index(), "Relative change of the solid cantilever's compliance.", 3)
    report.check(
        "change of compliance by a shift of 1e-9 h in y, GIMP", rows["GIMP"]["1e-09 h"], source="small-cut effect"
    )
    smooth = all(abs(rows[name]["1e-09 h"]) < 1e-6 for name in SHAPE_FUNCTIONS if name != "GIMP")
    report.check("the others' compliance changes by less than 1e-6", smooth, True, source="continuity")
    assert smooth


@pytest.mark.slow
def test_published_optima(report: Report) -> None:
    """Half MBB beam: values of the published optimality-criteria codes, digit by digit

    60 x 20 elements, filter radius 2.4, half of the volume, move limit 0.2, stopped at a change of 0.01. The codes
    bisect their multiplier to 1e-3 and print the objective of the design before the last update; so do we here, to
    show that what differs elsewhere is a choice and not a slip. With an exact multiplier the optimum moves by 3e-5.
    """
    holds = [
        report.check(
            f"half MBB beam 60 x 20, {filtered} filter: objective before the last update",
            published_run(filtered),
            printed,
            rtol=1e-7,
            source="Andreassen et al. (2011), printed by their code for the same parameters",
            why="half a unit of the last digit printed is 2e-8 of it",
        )
        for filtered, printed in PUBLISHED.items()
    ]
    assert all(holds)


def published_run(filtered: Filtered) -> float:
    """Objective of the last but one iterate of the published rule."""
    problem = simp.design_problem(half_mbb(), 1.0, filtered=filtered)
    rule, stop = OptimalityCriteria(0.2, bisection=1e-3), design_change(0.01)
    *_, before, _ = optimize(problem, rule, stop=stop)
    return before.objective
