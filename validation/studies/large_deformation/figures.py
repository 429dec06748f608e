"""What the pages on large deformation draw."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from mpmtop.large_deformation.model import Model
from mpmtop.large_deformation.steps import Trajectory
from validation.studies.large_deformation.crossings import Crossed
from validation.studies.large_deformation.smooth import Line

MARKERS = {"total Lagrange": "o", "tent": "s", "GIMP": "v", "B-spline": "^"}


def line_figure(lines: dict[str, Line]) -> Figure:
    """J along the line, and the size of its jumps."""
    figure, (above, below) = plt.subplots(2, 1, figsize=(6.0, 5.4), sharex=True)
    for method, found in lines.items():
        above.plot(found.t, found.J / found.J[0] - 1, label=method)
        middle = (found.t[1:] + found.t[:-1]) / 2
        seen = np.maximum(np.abs(found.jumps), 1e-14)
        below.semilogy(middle, seen, marker=MARKERS[method], markersize=3, linestyle="none", label=method)
    above.set(ylabel="J / J at the start - 1")
    below.set(xlabel="place on the line of designs", ylabel="|jump| / J")
    figure.legend(*above.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


def crossing_figure(real: dict[str, list[Crossed]], induced: dict[str, list[Crossed]]) -> Figure:
    """Errors of tip and stress against the share of points that have crossed."""
    figure, axes = plt.subplots(2, 2, figsize=(8.0, 6.0), sharey="row")
    for column, (title, found) in enumerate((("by themselves", real), ("pushed, small strain", induced))):
        for k, method in enumerate(MARKERS):
            if method not in found:
                continue
            steps = found[method]
            share = [100 * step.share for step in steps]
            for ax, errors in zip(axes[:, column], ([s.tip for s in steps], [s.stress for s in steps]), strict=True):
                ax.semilogy(
                    share,
                    np.abs(errors),
                    marker=MARKERS[method],
                    markersize=4,
                    linestyle="-",
                    color=f"C{k}",
                    label=method,
                )
        axes[0, column].set(title=title)
        axes[1, column].set(xlabel="points that have crossed [%]")
    axes[0, 0].set(ylabel="|error| of the tip")
    axes[1, 0].set(ylabel="error of the stress (RMS)")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def sketch(model: Model, path: Trajectory) -> Figure:
    """The bent beam's points at the start and at the end, on the grid, its clamp and the direction of its load."""
    figure, ax = plt.subplots(figsize=(6.6, 5.2))
    grid, points = model.grid, model.points
    lower = np.array(grid.origin)
    upper = lower + np.array(grid.h) * grid.cells
    ax.vlines(np.arange(grid.nodes[0]) * grid.h[0] + lower[0], lower[1], upper[1], colors="0.85", linewidths=0.4)
    ax.hlines(np.arange(grid.nodes[1]) * grid.h[1] + lower[1], lower[0], upper[0], colors="0.85", linewidths=0.4)
    for (x, half_length), color in (
        ((points.x, points.half_length), "0.6"),
        ((path.states[-1].x, path.states[-1].half_length), "C0"),
    ):
        # domains of true size
        corners = x[:, None] + half_length[:, None] * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        ax.add_collection(PolyCollection(list(corners), facecolors=color, edgecolors="white", linewidths=0.2))
    top = points.x[:, 1].max() + points.half_length[0, 1]
    ax.plot([0, 0], [0, top], color="#d55e00", linewidth=4, solid_capstyle="butt", label="held")
    carried = path.states[-1].x[np.any(model.force != 0, axis=1)].mean(axis=0)
    arrow = {"arrowstyle": "-|>", "color": "black", "linewidth": 1.6}
    ax.annotate("", tuple(carried - [0, 1.5]), tuple(carried), arrowprops=arrow)
    ax.set(aspect="equal", xlim=(lower[0], upper[0]), ylim=(lower[1], upper[1]), xlabel="x / depth", ylabel="y / depth")
    ax.legend(loc="upper right")
    return figure
