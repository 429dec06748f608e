"""Figures, tables and sentences of work against error; those of CPU time on the timings page."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from validation.methods import SHAPE_FUNCTIONS
from validation.report import Recorder, Report
from validation.work_precision.designs import design_name
from validation.work_precision.runs import CASE, FEM, cheapest, front, of_arrangement, slopes

COSTS = {"unknowns": "unknowns", "nonzeros": "nonzeros of K", "stored": "stored operators [MB]"}


TARGETS = (0.1, 0.01, 0.001, 0.0001)


def run_name(run: pd.Series) -> str:
    return run["method"] if run["ppc"] == 0 else f"{run['method']} {run['ppc']} x {run['ppc']}"


def advice(frame: pd.DataFrame, cost: str, what: str) -> str:
    """Which method reaches an error at the least cost: one sentence, for every arrangement of the points."""
    parts = []
    for points in [p for p in frame["points"].unique() if p]:
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


def recorded(report: Report, frame: pd.DataFrame, tag: str) -> None:
    """Slopes, figures and advice of every error of a study; those of CPU time on the timings page."""
    slope = slopes(frame)
    of_time = slopes(frame, "seconds")
    for quantity in frame["quantity"].unique():
        name = f"{tag}_{quantity.replace(' ', '_')}"
        runs = frame[frame["quantity"] == quantity]
        report.text(f"**{quantity.capitalize()}.** " + advice(runs, "nonzeros", "nonzeros of K"))
        draw(report, name, runs, list(COSTS), slope, f"Error of the {quantity} against work.")
        table = slope[quantity].unstack("ppc").round(2).rename(columns=lambda p: f"{p} x {p}" if p else "elements")
        report.table(f"{name}_slopes", table, f"Slopes of the {quantity} by points per cell.", 3)

        report.timed.text(f"**{quantity.capitalize()}.** " + advice(runs, "seconds", "CPU time"))
        draw(report.timed, f"{name}_seconds", runs, ["seconds"], of_time, f"Error of the {quantity} against CPU time.")
        report.timed.table(f"{name}_seconds", seconds_table(runs), f"CPU seconds to an error of the {quantity}.", 3)
        ratio_timed(report, runs)


def seconds_table(frame: pd.DataFrame) -> pd.DataFrame:
    """CPU seconds of each case to each target, NaN where its levels do not reach it."""
    columns = {}
    for target in TARGETS:
        reached = frame[frame["settled"] <= target]
        columns[f"{target:.2g}"] = reached.groupby(CASE[1:], sort=False)["seconds"].min()
    cases = pd.MultiIndex.from_frame(frame[CASE[1:]].drop_duplicates())
    return pd.DataFrame(columns).reindex(cases)


def ratio_timed(report: Report, frame: pd.DataFrame) -> None:
    """CPU time of the cheapest material points over that of the cheapest elements, at the least error both reach."""
    runs = of_arrangement(frame, "uncrossed")
    groups = runs[runs["ppc"] > 0], runs[runs["ppc"] == 0]
    for target in reversed(TARGETS):
        of_points, of_elements = (cheapest(group, "seconds", target) for group in groups)
        if of_points is not None and of_elements is not None:
            claim = f"CPU time to an error of {target:g} of the {frame['quantity'].iloc[0]}, uncrossed"
            ratio = of_points["seconds"] / of_elements["seconds"]
            report.timing(f"{claim}: best material points over best elements", ratio, source="for comparison")
            return


def draw(
    recorder: Recorder, name: str, frame: pd.DataFrame, costs: Sequence[str], slope: pd.Series, caption: str
) -> None:
    """Errors against costs, one row for each arrangement of the points."""
    arrangements = [p for p in frame["points"].unique() if p]
    size = (max(3.0 * len(costs), 4.5) + 2.6, 2.7 * len(arrangements) + 0.4)
    # no constrained layout: among nine logarithmic axes it takes most of the study's time
    figure, axes = plt.subplots(
        len(arrangements),
        len(costs),
        figsize=size,
        sharex="col",
        sharey=True,
        squeeze=False,
        layout="none",
        gridspec_kw={"wspace": 0.08, "hspace": 0.12},
    )
    for row, points in zip(axes, arrangements, strict=True):
        for ax, cost in zip(row, costs, strict=True):
            panel(ax, of_arrangement(frame, points), cost, slope)
        row[0].set(ylabel="relative error")
        row[-1].legend(loc="center left", bbox_to_anchor=(1.02, 0.5), title=points)
    for ax, cost in zip(axes[-1], costs, strict=True):
        ax.set(xlabel=COSTS.get(cost, "CPU seconds"))
    recorder.figure(name, figure, f"{caption} In the legend: slopes of the full lines. Circles: Pareto front.")


def panel(ax: Axes, runs: pd.DataFrame, cost: str, slope: pd.Series) -> None:
    for k, method in enumerate((*SHAPE_FUNCTIONS, *FEM.values())):
        for key, case in runs[runs["method"] == method].groupby(CASE, sort=False):
            ppc = case["ppc"].iloc[0]
            main = ppc in (0, 2)
            value = slope.to_dict()[key]
            text = f"{method} ({value:.1f})" if np.isfinite(value) else method
            style = {"linewidth": 1.6, "marker": ".", "label": text} if main else {"linewidth": 0.7, "alpha": 0.45}
            ax.plot(case[cost], case["error"], color=f"C{k}", linestyle="-" if ppc else "--", **style)
    ax.set(xscale="log", yscale="log")
    ax.minorticks_off()
    best = front(runs, cost)
    ax.plot(best[cost], best["error"], linestyle="none", marker="o", markersize=7, fillstyle="none", color="0.2")


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
        recorder.text(f"Least {what} for a design within {'; '.join(steps)} of the best.")
        figure, ax = plt.subplots(figsize=(6.0, 3.8))
        for (method, cells), case in frame.groupby(level=["method", "cells"], sort=False):
            ax.semilogx(case[cost], case["true compliance"], marker="o", label=f"{method}, {cells}")
            for ppc, x, y in zip(case.index.get_level_values("ppc"), case[cost], case["true compliance"], strict=True):
                ax.annotate(f" {ppc}" if ppc else "", (x, y), fontsize="small", va="bottom")
        best_runs = front(runs, cost)
        ax.plot(best_runs[cost], best_runs["true compliance"], "o", markersize=11, fillstyle="none", color="0.2")
        ax.set(
            xlabel=what if recorder is report else "CPU seconds of the optimisation", ylabel="true compliance [F²/E0]"
        )
        ax.legend(loc="center left", bbox_to_anchor=(1.02, 0.5))
        recorder.figure(
            f"{name}_{cost}", figure, "True compliance against work; digits: points per cell and direction."
        )
    report.timed.table(f"{name}_seconds", frame[["true compliance", "excess", "seconds"]], "CPU seconds.", 4)
