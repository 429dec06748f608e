"""What the pages on large deformation draw."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

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
