"""What the page on designs draws."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from validation.measures.drawing import draw_design
from validation.studies.large_designs.runs import JUDGED, LINEAR, STARTS, Judged, Run, points

Runs = dict[tuple[str, str], tuple[Run, Judged]]
"""Run and judgement by method and start."""


def designs_figure(runs: Runs) -> Figure:
    """Every design, points in true size: a row for each method, a column for each start."""
    methods = list(dict.fromkeys(method for method, _ in runs))
    starts = [start for start in STARTS if any(start == its for _, its in runs)]
    size = (4.0 * len(starts), 1.35 * len(methods))
    figure, axes = plt.subplots(len(methods), len(starts), figsize=size, squeeze=False)
    at = points()
    for row, method in zip(axes, methods, strict=True):
        for ax, start in zip(row, starts, strict=True):
            ax.set_axis_off()
            if (method, start) not in runs:
                continue
            run, found = runs[method, start]
            draw_design(ax, at.x, at.half_length, run.rho)
            ax.set_title(f"{method}, from {start}: judged {found.levels[-1]:.3f}", fontsize=8)
    return figure


def levels_figure(runs: Runs) -> Figure:
    """Judged compliance by load level, 0 for linear elasticity, by that of the linear design."""
    _, linear = runs[LINEAR, STARTS[0]]
    figure, axes = plt.subplots(1, 2, figsize=(8.0, 3.6), sharey=True)
    for ax, start in zip(axes, STARTS, strict=True):
        for k, ((method, its_start), (_, found)) in enumerate(runs.items()):
            if its_start == start and method != LINEAR:
                by = np.append(found.linear / linear.linear, found.levels / linear.levels)
                ax.semilogy([0, *JUDGED], by, marker="osv^Dx"[k // 2 % 6], markersize=4, label=method)
        ax.axhline(1.0, color="0.5", linewidth=0.8)
        ax.set(xlabel="load level", title=f"from {start}")
    axes[0].set(ylabel="compliance / that of the linear design")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=6, fontsize=8)
    return figure
