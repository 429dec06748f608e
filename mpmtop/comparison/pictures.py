"""What a comparison draws: designs, histories, the scene, the patterns of crossing."""

import io
from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from mpmtop import plot
from mpmtop.arrays import Array
from mpmtop.comparison.entries import Comparison, measure
from mpmtop.crossing import Crossing
from mpmtop.fields import rectangles
from mpmtop.points import MaterialPoints, seed
from mpmtop.region import Rectangle
from mpmtop.scene import Scene

STRIP = (16, 2)
"""Cells of the strip on which patterns are drawn: two periods of the longest one in use, and two rows."""
STILL = 1e-9
"""Distance [cells] below which a point is drawn as where it was seeded: the rounding of a displacement."""
LOGARITHMIC = 3.0
"""Largest value by the last ones from which a history is drawn on a logarithmic axis: the start would hide the end."""
WIDTH = 4.8
"""Of a picture of a design [in]."""


def design_picture(at: MaterialPoints, rho: Array) -> bytes:
    """PNG of densities on the rectangles that points own, nothing around it."""
    corners = rectangles(at.x, at.half_length)
    span = np.ptp(corners.reshape(-1, 2), axis=0)
    wide = WIDTH * min(1.0, span[0] / span[1])
    figure = Figure(figsize=(wide + 0.1, wide * span[1] / span[0] + 0.1))
    figure.set_layout_engine("none")  # whatever a user has set
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    plot.cells(ax, corners, rho, cmap=plot.DENSITY, limits=(0.0, 1.0), outlined=True)
    plot.frame(ax, corners).set_axis_off()
    return png(figure)


def png(figure: Figure, dpi: int = 120) -> bytes:
    """A figure as PNG, the same bytes for the same drawing, whatever a user has set."""
    drawn = io.BytesIO()
    with mpl.rc_context({"savefig.bbox": "standard", "savefig.facecolor": "white"}):
        figure.savefig(drawn, format="png", dpi=dpi, metadata={"Software": None})
    return drawn.getvalue()


def histories(found: Comparison) -> Figure:
    """Own objective by iteration, one line for each run."""
    figure = Figure(figsize=(7.0, 3.6), layout="constrained")
    ax = figure.subplots()
    runs = [(entry.label, entry.run) for entry in found.found if entry.run is not None]
    for label, run in runs:
        ax.plot(run.objective, label=label)
    values = np.concatenate([run.objective for _, run in runs])
    last = np.array([run.own for _, run in runs])
    if np.all(values > 0) and values.max() > LOGARITHMIC * last.max():
        ax.set_yscale("log")
    ax.set(xlabel="iteration", ylabel=f"own {measure(found.asked.scene)}")
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def scene_picture(of: Scene, model: object) -> Figure:
    """The scene with a model's grid and points."""
    figure = Figure(figsize=(6.0, 4.2), layout="constrained")
    plot.scene(of, model, figure.subplots())
    return figure


def patterns(crossings: Sequence[Crossing]) -> Figure:
    """The patterns below each other on a strip of cells with 2 x 2 points: seeded places hollow, points that moved
    blue, those of another cell than before orange."""
    columns, rows = STRIP
    body = Rectangle((0.0, 0.0), (float(columns), float(rows)))
    seeded = seed(body, (0.5, 0.5))
    figure = Figure(figsize=(6.4, 1.15 * len(crossings)), layout="constrained")
    axes = figure.subplots(len(crossings), 1, sharex=True, squeeze=False)
    for ax, crossing in zip(axes[:, 0], crossings, strict=True):
        x = crossing(seeded, body).x
        moves = np.abs(x - seeded.x).max(axis=1) > STILL
        crosses = np.any(np.floor(x) != np.floor(seeded.x), axis=1)
        ax.vlines(np.arange(columns + 1), 0, rows, color="0.7", linewidth=0.6)
        ax.hlines(np.arange(rows + 1), 0, columns, color="0.7", linewidth=0.6)
        hollow = {"markerfacecolor": "none", "markeredgecolor": "0.6"}
        ax.plot(*seeded.x[moves].T, "o", markersize=3, linestyle="none", rasterized=True, **hollow)
        for chosen, color in ((~moves, "0.35"), (moves & ~crosses, plot.BLUE), (crosses, plot.ORANGE)):
            ax.plot(*x[chosen].T, "o", markersize=3, color=color, linestyle="none", rasterized=True)
        ax.set_title(str(crossing), fontsize="small", loc="left", pad=2)
        ax.set(aspect="equal", xlim=(-0.2, columns + 0.9), yticks=[])
        ax.spines[["left", "bottom"]].set_visible(False)
    axes[-1, 0].set_xlabel("x / h")
    return figure
