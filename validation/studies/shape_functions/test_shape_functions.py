"""Shape functions: order, self weight, cost, scatter

What each shape function gains, and what it costs. **Standard** is the tent; **GIMP** averages it over a point's domain;
the **quadratic and cubic B-splines** end with the body. A manufactured solution and a column under its own weight have
exact answers; the solid cantilever (40h x 20h, 3,200 points, units h = F = E0 = 1) is compared with the fine reference.
Points are moved in x before the analysis, as the paper does to induce crossing, by amounts of our choice.

In short: points that are moved unevenly and keep their volume no longer fill the body evenly, and no shape function
repairs that. Crossing as such is another error, the tent's own. The sections below separate the two.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from mpmtop.crossing import Crossing, Jitter, Periodic, Uniform, Wave
from validation.bodies import manufactured
from validation.bodies.manufactured import CURVATURE, DeformedWave
from validation.bodies.patterns import define
from validation.harness.lock import Lock
from validation.harness.progress import ShowProgress
from validation.harness.report import Report
from validation.measures.orders import observed_order
from validation.methods.analyser import SHAPE_FUNCTIONS
from validation.studies.shape_functions.tolerances import RTOL_ERRORS

# points are moved off the clamp and over grid lines on purpose
pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

ASKED = "How fast do displacement and stress converge, for which function and arrangement of points, and at what cost?"
THEN = ("test_self_weight", "test_cost", "test_jitter")

LEVELS = (8, 16, 32, 64)
"""Cells per side of the manufactured solution."""
UNCROSSED = "uncrossed"
ARRANGEMENTS: dict[str, Crossing] = {
    UNCROSSED: Uniform(0.0),
    **{str(moved): moved for moved in (Uniform(0.3), Periodic(4), Wave(8), DeformedWave(8), Jitter(0.3))},
}
SAME_ORDER, FALLING = 0.2, 0.05
"""A shape function keeps its order where the observed one is within this of its own uncrossed one."""


@pytest.mark.slow
def test_manufactured_solution(report: Report, lock: Lock, progress: ShowProgress) -> None:
    """Convergence to a manufactured solution

    A smooth field with its body force on a square, at 8 to 64 cells per side with 2 x 2 points per cell. The body goes
    on beyond the square, and nodes on its boundary and outside are held at the exact values: neither outline, nor lever
    arm, nor clamp enters. For B-splines, whose coefficients are not values, that is the quasi-interpolant
    c = u - h² v/2 laplacian(u), v = 1/4 (quadratic), 1/3 (cubic). Errors are relative, L2, at the points.

    The families move points by a fixed part of h, at every level. In the wave neighbours move almost alike; in the
    **deformed wave** volumes and half-lengths follow the deformation, too, so that the domains tile the body as before.
    In all others they stay as they were.
    """
    define(report.opening, [moved for name, moved in ARRANGEMENTS.items() if name != UNCROSSED])
    cases = [(name, arrangement) for name in SHAPE_FUNCTIONS for arrangement in ARRANGEMENTS]
    index = pd.MultiIndex.from_tuples(cases, names=["shape function", "points"])
    found = np.array(
        [
            [manufactured.errors(n, SHAPE_FUNCTIONS[name], ARRANGEMENTS[arrangement]) for n in LEVELS]
            for name, arrangement in progress(cases, "manufactured solution")
        ]
    )
    errors = {"displacement": found[:, :, 0], "stress": found[:, :, 1]}
    before, order = (
        pd.DataFrame({field: observed_order(e[:, k], e[:, k + 1]) for field, e in errors.items()}, index)
        for k in (-3, -2)
    )
    orders_recorded(report, before, order)
    bspline_orders(report)
    draw_convergence(report, {field: pd.DataFrame(e, index) for field, e in errors.items()})
    for field, e in errors.items():
        table = pd.DataFrame(e, index, columns=[f"{n} cells" for n in LEVELS])
        report.table(f"error_{field}", table, f"Relative L2 error of the {field} by cells per side.", 3)

    holds = orders_hold(report, order)
    uneven = {
        name: max(order["stress"][name, str(p)] for p in (Periodic(4), Wave(8), Jitter(0.3)))
        for name in SHAPE_FUNCTIONS
    }
    report.found(
        "As seeded, stress converges with order "
        + ", ".join(f"{order['stress'][name, UNCROSSED]:.1f} ({name})" for name in SHAPE_FUNCTIONS)
        + "; with unevenly moved points the best order of any function is "
        + f"{max(uneven.values()):.2f}."
    )
    if max(uneven.values()) <= SAME_ORDER:
        report.so(
            "With unevenly moved points no shape function converges in stress, unless domains deform with the body."
        )
    numbers = {f"{field}, {', '.join(case)}": e[k, -1] for field, e in errors.items() for k, case in enumerate(cases)}
    lock(numbers, rtol=RTOL_ERRORS)
    assert all(holds)


def orders_hold(report: Report, order: pd.DataFrame) -> list[bool]:
    """Claims on the observed orders: those known a priori, and the lost ones."""
    holds = [
        report.check(
            f"observed order, {name}, {points}: {field}", order[field][name, points], at_least=bound, source=why
        )
        # 0.1, 0.05: the next term of the error is h² smaller, 1e-3 here, so a deficit of a tenth is a lost order
        for name, points, field, bound, why in (
            ("standard", UNCROSSED, "displacement", 1.9, "a priori: 2"),
            ("standard", UNCROSSED, "stress", 0.95, "a priori: 1"),
            ("quadratic B-spline", UNCROSSED, "stress", 1.9, "a priori: 2"),
            ("cubic B-spline", UNCROSSED, "displacement", 3.8, "a priori: 4"),
            ("cubic B-spline", UNCROSSED, "stress", 2.85, "a priori: 3"),
            ("GIMP", str(DeformedWave(8)), "displacement", 1.9, "domains tile: patch test passed"),
            ("GIMP", str(DeformedWave(8)), "stress", 0.95, "domains tile: patch test passed"),
        )
    ]
    holds.append(
        report.check(
            "largest observed order of the stress, any function, points moved unevenly with fixed volumes",
            max(order["stress"][name, str(p)] for name in SHAPE_FUNCTIONS for p in (Periodic(4), Wave(8), Jitter(0.3))),
            at_most=SAME_ORDER,
            source="patch test fails by O(1)",
        )
    )
    return holds


def orders_recorded(report: Report, before: pd.DataFrame, order: pd.DataFrame) -> None:
    """Tables of observed orders (function x arrangement), `before` those of the last pair of levels but one, and the
    sentences that follow from them."""
    for field in order:
        table = order[field].unstack("points")[list(ARRANGEMENTS)].loc[list(SHAPE_FUNCTIONS)]
        report.table(f"order_{field}", table.round(2), f"Observed order of the {field}, 32 to 64 cells.")
    short, short_before = (
        o.rsub(o.xs(UNCROSSED, level="points"), level="shape function").astype(float) for o in (order, before)
    )
    kept = ((short <= SAME_ORDER) & (short - short_before <= FALLING)).all(axis=1).unstack("points")
    lines = [
        f"- {points}: {', '.join(name for name in SHAPE_FUNCTIONS if kept[points][name]) or 'none'}"
        for points in ARRANGEMENTS
        if points != UNCROSSED
    ]
    report.text(
        f"Both orders are within {SAME_ORDER:g} of those uncrossed, no further below than on the levels before, "
        f"to {FALLING:g}, with:\n\n" + "\n".join(lines)
    )
    report.text(
        """
        Where points of fixed volume are moved unevenly, their volume per cell is off by a part that refinement does not
        lower. A constant stress then has nodal forces of order h sigma (see the patch test in Verification): the stress
        keeps an error of that part, and the displacement falls only as far as such forces cancel over a distance. GIMP
        lowers the error and does not restore the order, as its domains then overlap and leave gaps. Where the domains
        are deformed with the body, GIMP integrates the tent's gradient exactly and is as before; the B-splines, which
        know points and not domains, keep a small error, and the tent, which counts a point on one side of a boundary
        only, nearly all of it.

        A uniform shift leaves every cell the same volume. The tent's order falls all the same with refinement: its
        eps_xx is that of the cell's centre, its eps_yy that of the points, whose mean is 0.2 h beside it, and the
        product of the two in the energy has an error of order h."""
    )


def bspline_orders(report: Report) -> None:
    """Why the quadratic B-spline has order 2, and what the boundary values do to the cubic's order."""
    rows = {}
    for name, ppc, quasi in (
        ("quadratic B-spline", 2, True),
        ("quadratic B-spline", 6, True),
        ("quadratic B-spline", 2, False),
        ("cubic B-spline", 2, True),
        ("cubic B-spline", 2, False),
    ):
        f = SHAPE_FUNCTIONS[name]
        curvature = CURVATURE[f] if quasi else 0.0
        e = np.array([manufactured.errors(n, f, Uniform(0.0), ppc=ppc, curvature=curvature) for n in (8, 16)])
        rows[name, f"{ppc} x {ppc}", "quasi-interpolant" if quasi else "values"] = observed_order(e[0], e[1])
    table = pd.DataFrame.from_dict(rows, orient="index", columns=["displacement", "stress"])
    table.index = pd.MultiIndex.from_tuples(rows, names=["B-spline", "points per cell", "held at"])
    report.table(
        "bsplines",
        table,
        "Observed order uncrossed, 8 to 16 cells. The quadratic's 2 in place of 3 is quadrature: more points raise it. "
        "A boundary held at values as if they were coefficients leaves the cubic no more than order 2.",
        3,
    )


def draw_convergence(report: Report, errors: dict[str, pd.DataFrame]) -> None:
    shown = (UNCROSSED, str(Periodic(4)), str(DeformedWave(8)))
    h = 1 / np.array(LEVELS)
    figure, axes = plt.subplots(2, 3, figsize=(8.0, 5.6), sharex=True, sharey="row")
    guides = {"displacement": ((2, 4e-2), (4, 2e-5)), "stress": ((1, 0.25), (3, 3e-4))}
    for row, (field, e) in zip(axes, errors.items(), strict=True):
        for ax, points in zip(row, shown, strict=True):
            for name in SHAPE_FUNCTIONS:
                ax.loglog(h, e.loc[(name, points)], marker="o", markersize=4, label=name)
        for order, start in guides[field]:
            row[0].loglog(h, start * (h / h[0]) ** order, color="0.6", linewidth=1, linestyle="-", zorder=0)
            row[0].annotate(f" order {order}", (h[0], start), color="0.4", fontsize="small", va="center")
        row[0].set(ylabel=f"relative error, {field}")
    for ax, points in zip(axes[0], shown, strict=True):
        ax.set(title=points)
    for ax in axes[1]:
        ax.set(
            xlabel="h / side of the square",
            xlim=(h[-1] / 1.3, 2.4 * h[0]),
            xticks=h,
            xticklabels=[f"1/{n}" for n in LEVELS],
        )
        ax.minorticks_off()
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    report.figure(
        "convergence", figure, "Errors against cell size. Grey: slopes. Uncrossed, standard and GIMP are one line."
    )
