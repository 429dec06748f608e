"""A column under its own weight, beside AMPLE."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from validation.bodies import column
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.measures.orders import observed_order
from validation.methods.analyser import SHAPE_FUNCTIONS
from validation.studies.shape_functions.tolerances import RTOL_ANALYSIS

# points are moved off the clamp and over grid lines on purpose
pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")
COLUMN_LEVELS = (8, 16, 32, 64, 128)
"""Cells along the column; AMPLE's results end at 64."""


def test_self_weight(report: Report, lock: Lock) -> None:
    """Column under its own weight, beside AMPLE

    AMPLE's benchmark: column of height 50, E = 1e4, nu = 0, rho g l0 = 4e4, compressed to half its height by its own
    weight. Its stress is known whatever the law. AMPLE (finite strain) takes 40 steps; ours is **one linear analysis**,
    of the points (a) where they were seeded and (b) where AMPLE's law takes them exactly, volumes and half-lengths
    deformed with them, each with its weight. Error: sum |sigma - exact| V / (rho g l0 sum V), V the initial volumes.

    **Comparable** is the balance of forces on points that have crossed as AMPLE's have: whether the error falls with h,
    and how. **Not comparable** is its size: ours is the stress under the strain of one analysis, for tent and GIMP all
    but constant in a cell, as in (a). AMPLE's points gather stress over 40 steps, in which they pass through the cells:
    most likely GIMP's is smaller and its order higher because that is averaged on the way, while the tent's holds every
    jump at a crossing. AMPLE's domains are updated step by step, ours are given.
    """
    index = pd.MultiIndex.from_product([("seeded", "deformed"), SHAPE_FUNCTIONS], names=["points", "shape function"])
    found = [
        [column.errors(n, SHAPE_FUNCTIONS[name], deformed=points == "deformed") for n in COLUMN_LEVELS]
        for points, name in index
    ]
    errors = pd.DataFrame(np.array(found)[:, :, 0], index, columns=list(COLUMN_LEVELS))
    by_volume = pd.DataFrame(np.array(found)[:, :, 1], index, columns=list(COLUMN_LEVELS))
    ample = column.ample()
    theirs = ample["error"].unstack("cells")
    both = pd.concat([errors, pd.concat({"AMPLE": theirs.loc[["standard", "GIMP"]]}, names=["points"])])
    both.index.names = errors.index.names
    column_tables(report, both, by_volume)
    draw_column(report, both)

    holds = [
        report.check(
            "settlement of the top by AMPLE's law in closed form: AMPLE, GIMP, 64 cells",
            float(ample["min_uy"]["GIMP", 64]),
            float(column.hencky(np.array(column.LENGTH)).y) - column.LENGTH,
            rtol=1e-3,  # AMPLE's own error of discretisation: it changes by 4e-4 from 32 to 64 cells
            source="exact solution",
        ),
        report.check(
            "(a) standard, error at 64 cells: h / 4 off the cell's centre in a linear stress",
            errors[64]["seeded", "standard"],
            1 / (4 * 64),
            rtol=1e-8,  # rounding
            source="statics",
        ),
        report.check(
            "(b) standard, mean order from 8 to 128 cells: does not converge",
            mean_order(errors, ("deformed", "standard"), 128),
            at_most=0.5,
            source=f"AMPLE: {mean_order(both, ('AMPLE', 'standard'), 64):.2f} to 64 cells",
        ),
        report.check(
            "(b) GIMP, mean order from 8 to 128 cells",
            mean_order(errors, ("deformed", "GIMP"), 128),
            at_least=0.9,  # a priori 1, the tent's; domains tile to a relative h²
            source=f"a priori: 1; AMPLE: {mean_order(both, ('AMPLE', 'GIMP'), 64):.2f} to 64 cells",
        ),
    ]
    numbers = {f"{', '.join(case)}, {n} cells": errors[n][case] for case in index for n in COLUMN_LEVELS}
    lock(numbers, rtol=RTOL_ANALYSIS)
    assert all(holds)


def column_tables(report: Report, both: pd.DataFrame, by_volume: pd.DataFrame) -> None:
    """Errors of ours and AMPLE's beside each other, and those weighed by the volumes of the arrangement."""
    orders = {"last order": observed_order(both[32], both[64]), "mean order": observed_order(both[8], both[64], 8)}
    table = pd.concat([both.map("{:.2e}".format), pd.DataFrame(orders).round(2)], axis=1)
    report.table(
        "self_weight",
        table.replace("nan", np.nan),
        "Stress error by number of cells; seeded: (a), deformed: (b). Orders: 32 to 64 cells, and mean of 8 to 64.",
    )
    ratio = pd.DataFrame(both.loc["deformed"] / both.loc["AMPLE"]).loc[["standard", "GIMP"], [8, 16, 32, 64]]
    report.table("self_weight_ratio", ratio.rename(columns=lambda n: f"{n} cells"), "Error in (b) over AMPLE's.", 3)
    change = (by_volume / both.loc[by_volume.index]).loc["deformed"]
    report.text(
        f"Weighing by the deformed volumes in place of the initial ones multiplies the errors in (b) by "
        f"{change.min().min():.2f} to {change.max().max():.2f}: the base, where the error is largest, counts less. "
        f"Mean orders change by at most {np.abs(observed_order(change[8], change[64], 8)).max():.2f}."
    )
    last = {name: float(observed_order(*(both[n]["deformed", name] for n in (64, 128)))) for name in SHAPE_FUNCTIONS}
    report.text(
        "In (b) the B-splines begin with a smaller error, and their order falls: they sum over points that are no "
        f"longer a lattice. Orders from 64 to 128 cells: quadratic {last['quadratic B-spline']:.2f}, cubic "
        f"{last['cubic B-spline']:.2f}, GIMP {last['GIMP']:.2f}."
    )


def mean_order(errors: pd.DataFrame, case: tuple[str, str], finest: int) -> float:
    """Observed order of a case from 8 cells to the finest ones."""
    return float(observed_order(errors[8][case], errors[finest][case], finest / 8))


def draw_column(report: Report, errors: pd.DataFrame) -> None:
    figure, axes = plt.subplots(1, 2, figsize=(7.5, 4.0), sharey=True)
    for ax, points in zip(axes, ("seeded", "deformed"), strict=True):
        for name in SHAPE_FUNCTIONS:
            ax.loglog(COLUMN_LEVELS, errors.loc[(points, name)], marker="o", markersize=4, label=name)
    for name, marker, colour in (("standard", "s", "#0072b2"), ("GIMP", "D", "#d55e00")):
        theirs = errors.loc[("AMPLE", name)]
        axes[1].loglog(COLUMN_LEVELS, theirs, marker, color=colour, markerfacecolor="none", label=f"AMPLE, {name}")
    for ax, title in zip(axes, ("(a) as seeded", "(b) as deformed"), strict=True):
        ax.set(title=title, xlabel="cells along the column", xticks=COLUMN_LEVELS, xticklabels=map(str, COLUMN_LEVELS))
        ax.minorticks_off()
    axes[0].set(ylabel="stress error / (rho g l0)")
    figure.legend(*axes[1].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    report.figure(
        "self_weight",
        figure,
        "Stress error of the column. In (a) standard and GIMP are one line, and all but so are the B-splines.",
    )
