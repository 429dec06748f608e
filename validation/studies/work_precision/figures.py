"""Figures, tables and sentences of work against error; those of CPU time on the timings page."""

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from validation.harness.report import Recorder, Report
from validation.methods.analyser import SHAPE_FUNCTIONS
from validation.studies.work_precision.designs import design_name
from validation.studies.work_precision.runs import CASE, FEM, cheapest, front, of_arrangement, slopes

COSTS = {"unknowns": "unknowns", "nonzeros": "nonzeros of K", "stored": "stored operators [MB]"}
TARGETS = (0.1, 0.01, 0.001, 0.0001)
GAP = np.full((1, 2), np.nan)
"""A row that ends a line."""
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def arrangements(frame: pd.DataFrame) -> list[str]:
    """How the points of the runs are arranged, as seeded first."""
    return [points for points in frame["points"].unique() if points]


def run_name(run: pd.Series) -> str:
    return run["method"] if run["ppc"] == 0 else f"{run['method']} {run['ppc']} x {run['ppc']}"


def cheapest_table(frame: pd.DataFrame, cost: str, benchmark: str) -> pd.DataFrame:
    """Which run reaches each error at the least cost, one row for every quantity and arrangement of the points; in
    brackets the cheapest material points and how many times as much they cost, where elements are cheaper."""
    rows = []
    for quantity in frame["quantity"].unique():
        of_quantity = frame[frame["quantity"] == quantity]
        for points in arrangements(of_quantity):
            row = {"benchmark": benchmark, "error of": quantity, "points": points}
            for target in TARGETS:
                row[f"{target:.2g}"] = cheapest_run(of_arrangement(of_quantity, points), cost, target)
            rows.append(row)
    return pd.DataFrame(rows)


def cheapest_run(runs: pd.DataFrame, cost: str, target: float) -> str:
    """The run that reaches an error at the least cost, and the best one of material points."""
    best, of_points = (cheapest(part, cost, target) for part in (runs, runs[runs["ppc"] > 0]))
    if best is None:
        return "not reached"
    if best["ppc"] > 0:
        return run_name(best)
    if of_points is None:
        return f"{run_name(best)} (points: not reached)"
    return f"{run_name(best)} ({run_name(of_points)}: {of_points[cost] / best[cost]:.2g} times)"


def reach(frame: pd.DataFrame, benchmark: str) -> str:
    """Least errors by arrangement of the points and by elements, of the first quantity: a sentence."""
    quantity = frame["quantity"].iloc[0]
    runs = frame[frame["quantity"] == quantity]
    elements = runs.loc[runs["ppc"] == 0, "settled"].min()
    parts = [f"{runs.loc[runs['points'] == points, 'settled'].min():.1g} {points}" for points in arrangements(runs)]
    return f"{benchmark}, {quantity}: least error {', '.join(parts)}, {elements:.1g} by elements."


def advice(frame: pd.DataFrame, cost: str, what: str) -> str:
    """Which method reaches an error at the least cost: one sentence, for every arrangement of the points."""
    parts = []
    for points in arrangements(frame):
        runs = of_arrangement(frame, points)
        steps = []
        for target in TARGETS:
            best, of_points = (cheapest(part, cost, target) for part in (runs, runs[runs["ppc"] > 0]))
            if best is None:
                continue
            step = f"{target:g} by {run_name(best)}"
            if best["ppc"] == 0:
                step += (
                    " (material points: not reached)"
                    if of_points is None
                    else f" (material points: {run_name(of_points)}, {of_points[cost] / best[cost]:.2g} times as much)"
                )
            steps.append(step)
        parts.append(f"**{points}** {', '.join(steps) or 'none reached'}")
    return f"Least {what} to an error: {'; '.join(parts)}."


def recorded(report: Report, frame: pd.DataFrame, tag: str, benchmark: str = "") -> None:
    """Slopes, figures and cheapest runs of every error of a study, at the top of the page if it is a `benchmark` there;
    those of CPU time on the timings page. The figures but the first are folded."""
    slope = slopes(frame)
    table = cheapest_table(frame, "nonzeros", benchmark or tag.replace("_", " "))
    caption = (
        "Cheapest run to an error, by nonzeros of K; in brackets the cheapest material points, where elements win."
    )
    if benchmark:
        report.opening.table(f"{tag}_cheapest", table, caption, part_of="cheapest")
        report.found(reach(frame, benchmark))
    else:
        report.table(f"{tag}_cheapest", table, caption)
    for number, quantity in enumerate(frame["quantity"].unique()):
        name = f"{tag}_{quantity.replace(' ', '_')}"
        runs = frame[frame["quantity"] == quantity]
        caption = f"Error of the {quantity} against nonzeros of K, 2 x 2 points per cell. Circles: Pareto front of all."
        draw(report, name, work_figure(runs), caption, folded=number > 0)
        if benchmark:  # the finest levels are shown by the first cost only: a page has room for so much
            caption = f"Error of the {quantity} as seeded against the other costs, with 1 to 4 points per cell (thin)."
            draw(report, f"{name}_in_full", full_figure(runs), caption, folded=True)
        table = slope[quantity].unstack("ppc").round(2).rename(columns=lambda p: f"{p} x {p}" if p else "elements")
        report.table(f"{name}_slopes", table, f"Slopes of the {quantity} by points per cell.", 3)

        report.timed.text(f"**{quantity.capitalize()}.** " + advice(runs, "seconds", "CPU time"))
        caption = f"CPU seconds to an error of the {quantity}, and slope of the error by CPU time."
        report.timed.table(f"{name}_seconds", seconds_table(runs), caption, 3)
        ratio_timed(report, runs, tag)
    draw(report.timed, f"{tag}_seconds", time_figure(frame), "Errors against CPU time. Circles: Pareto front.")


def seconds_table(frame: pd.DataFrame) -> pd.DataFrame:
    """CPU seconds of each case to each target, NaN where its levels do not reach it, and slope of the error by them."""
    columns = {}
    for target in TARGETS:
        reached = frame[frame["settled"] <= target]
        columns[f"{target:.2g}"] = reached.groupby(CASE[1:], sort=False)["seconds"].min()
    slope = slopes(frame, "seconds").droplevel("quantity").round(2)
    return pd.DataFrame(columns).reindex(slope.index).assign(slope=slope)


def ratio_timed(report: Report, frame: pd.DataFrame, tag: str) -> None:
    """CPU time of the cheapest material points over that of the cheapest elements, at the least error both reach; the
    study's tag tells apart quantities of one name."""
    runs = of_arrangement(frame, "uncrossed")
    groups = runs[runs["ppc"] > 0], runs[runs["ppc"] == 0]
    for target in reversed(TARGETS):
        of_points, of_elements = (cheapest(group, "seconds", target) for group in groups)
        if of_points is not None and of_elements is not None:
            quantity = f"{frame['quantity'].iloc[0]} ({tag.replace('_', ' ')})"
            claim = f"CPU time to an error of {target:g} of the {quantity}, uncrossed"
            ratio = of_points["seconds"] / of_elements["seconds"]
            report.timing(f"{claim}: best material points over best elements", ratio, source="for comparison")
            return


def draw(recorder: Recorder, name: str, figure: Figure, caption: str, *, folded: bool = False) -> None:
    """Record a figure that fills its page: to find its outline, `bbox="tight"` would lay it out once more."""
    with mpl.rc_context({"savefig.bbox": "standard"}):
        recorder.figure(name, figure, caption, folded=folded)


def work_figure(runs: pd.DataFrame) -> Figure:
    """Errors against nonzeros of K, one panel for each arrangement of the points."""
    arranged = arrangements(runs)
    figure, axes = panels(1, len(arranged) + 1)
    for ax, points in zip(axes[0], arranged, strict=False):
        panel(ax, of_arrangement(runs, points), "nonzeros", faint=False)
        ax.set(title=points, xlabel=COSTS["nonzeros"])
    return _with_legend(figure, axes)


def full_figure(runs: pd.DataFrame) -> Figure:
    """Errors as seeded against the other costs, all numbers of points per cell."""
    others = {cost: name for cost, name in COSTS.items() if cost != "nonzeros"}
    figure, axes = panels(1, len(others) + 1)
    for ax, (cost, name) in zip(axes[0], others.items(), strict=False):
        panel(ax, of_arrangement(runs, arrangements(runs)[0]), cost)
        ax.set(xlabel=name)
    return _with_legend(figure, axes)


def _with_legend(figure: Figure, axes: np.ndarray) -> Figure:
    """The last panel of a row is the legend's."""
    axes[0, 0].set(ylabel="relative error")
    axes[0, -1].set_axis_off()
    axes[0, -1].legend(*axes[0, 0].get_legend_handles_labels(), loc="center")
    return figure


def time_figure(frame: pd.DataFrame) -> Figure:
    """Errors as seeded against CPU time, one panel for each quantity: moved points take as long."""
    quantities = frame["quantity"].unique()
    figure, axes = panels(1, len(quantities) + 1, sharey=False)
    for ax, quantity in zip(axes[0], quantities, strict=False):
        runs = frame[frame["quantity"] == quantity]
        seeded = arrangements(runs)[0]
        panel(ax, of_arrangement(runs, seeded), "seconds")
        ax.set(title=f"{quantity}, {seeded}", xlabel="CPU seconds")
    return _with_legend(figure, axes)


def panels(rows: int, columns: int, *, sharey: bool = True) -> tuple[Figure, np.ndarray]:
    """Figure of rows x columns axes; margins in inches, as constrained layout takes seconds."""
    width, height = 3.1 * columns + 0.2, 2.8 * rows + 0.1
    margins = {"left": 0.75 / width, "right": 1 - 0.1 / width, "bottom": 0.55 / height, "top": 1 - 0.3 / height}
    space = {"wspace": 0.08 if sharey else 0.25, "hspace": 0.4}
    figure, axes = plt.subplots(
        rows,
        columns,
        figsize=(width, height),
        sharey=sharey,
        squeeze=False,
        layout="none",
        gridspec_kw=margins | space,
    )
    return figure, axes


def panel(ax: Axes, runs: pd.DataFrame, cost: str, *, faint: bool = True) -> None:
    """Cases of 2 x 2 points and of elements as full lines, the others `faint` or not at all; circles on the Pareto
    front."""
    for k, method in enumerate((*SHAPE_FUNCTIONS, *FEM.values())):
        cases = runs[runs["method"] == method]
        main = cases["ppc"].isin((0, 2))
        x, y = cases.loc[main, [cost, "error"]].to_numpy().T
        style = "--" if method in FEM.values() else "-"
        ax.plot(x, y, style, color=f"C{k}", linewidth=1.6, marker=".", label=method)
        if not faint:
            continue
        # one line with gaps, which is drawn faster than many
        parts = [case[[cost, "error"]].to_numpy() for _, case in cases[~main].groupby("ppc")]
        x, y = np.concatenate([GAP, *(row for part in parts for row in (part, GAP))]).T
        ax.plot(x, y, "-", color=f"C{k}", linewidth=0.8, alpha=0.6)
    best = front(runs, cost)
    ax.plot(best[cost], best["error"], linestyle="none", marker="o", markersize=7, fillstyle="none", color="0.2")
    ax.set(xscale="log", yscale="log")
    ax.minorticks_off()
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(power_of_ten)


def power_of_ten(x: float, position: float) -> str:
    """10⁻³ or 3·10⁻³ in plain letters: the parser of formulae takes longer than all the rest of a figure."""
    digit, power = f"{x:.0e}".split("e")
    return ("" if digit == "1" else f"{digit}·") + "10" + str(int(power)).translate(SUPERSCRIPTS)


def designs_recorded(report: Report, frame: pd.DataFrame, name: str) -> None:
    """Table, figure and advice; those with seconds on the timings page."""
    frame["excess"] = frame["true compliance"] / frame["true compliance"].min() - 1
    shown = frame.drop(columns="seconds")
    report.table(name, shown, "Optimised designs; compliance in F²/E0.", 5)
    for recorder, cost, what in ((report, "nonzeros", "nonzeros of K"), (report.timed, "seconds", "CPU time")):
        runs = frame.assign(settled=frame["excess"], run=[design_name(*case) for case in frame.index])
        steps = []
        for target in (0.1, 0.05, 0.02, 0.01):
            best = cheapest(runs, cost, target)
            if best is not None:
                steps.append(f"{target:.0%} by {best['run']}")
        if recorder is report and steps:
            report.so(f"A design needs no such precision: the cheapest is within {'; '.join(steps)} of the best.")
        recorder.text(f"Least {what} for a design within {'; '.join(steps)} of the best.")
        label = what if recorder is report else "CPU seconds of the optimisation"
        caption = "True compliance against work; digits: points per cell and direction. Circles: Pareto front."
        draw(recorder, f"{name}_{cost}", design_figure(runs, cost, label), caption)
    report.timed.table(f"{name}_seconds", frame[["true compliance", "excess", "seconds"]], "CPU seconds.", 4)


def design_figure(runs: pd.DataFrame, cost: str, label: str) -> Figure:
    """True compliance of the designs against a cost."""
    figure, axes = panels(1, 2)
    ax = axes[0, 0]
    for (method, cells), case in runs.groupby(level=["method", "cells"], sort=False):
        ax.semilogx(case[cost], case["true compliance"], marker="o", label=f"{method}, {cells}")
        for ppc, x, y in zip(case.index.get_level_values("ppc"), case[cost], case["true compliance"], strict=True):
            digit = str(ppc) if ppc else ""
            ax.annotate(digit, (x, y), (7, 0), textcoords="offset points", fontsize="x-small", va="center")
    best = front(runs, cost)
    ax.plot(best[cost], best["true compliance"], "o", markersize=11, fillstyle="none", color="0.2")
    ax.set(xlabel=label, ylabel="true compliance [F²/E0]")
    ax.minorticks_off()
    ax.xaxis.set_major_locator(LogLocator(subs=(1, 3)))  # costs may span less than a decade
    ax.xaxis.set_major_formatter(power_of_ten)
    axes[0, 1].set_axis_off()
    axes[0, 1].legend(*ax.get_legend_handles_labels(), loc="center")
    return figure
