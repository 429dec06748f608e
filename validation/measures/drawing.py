"""What the studies draw of a body of material points, and the style of every figure."""

from typing import Any

import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from mpmtop.scene import Array

# Okabe and Ito's colours but for yellow, too faint on white; line styles tell them apart where they print grey.
STYLE: dict[str, Any] = {
    "axes.prop_cycle": cycler(
        color=["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#000000"],
        linestyle=["-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 1))],
    ),
    "axes.formatter.use_mathtext": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": "medium",
    "figure.constrained_layout.use": True,
    # 5 in fill a phone's 390 px with letters of 11 px; wider figures shrink theirs.
    "figure.figsize": (5.0, 3.4),
    "font.size": 11.0,
    "image.cmap": "cividis",
    "legend.frameon": False,
    "legend.fontsize": "small",
    "lines.linewidth": 1.8,
    "savefig.bbox": "tight",  # equal axes leave blank bands
    "savefig.dpi": 200,
    "savefig.facecolor": "white",
    "svg.fonttype": "path",  # letters as drawn here: no font of the reader's can move or clip them
}


def draw_points(
    ax: Axes,
    x: Array,
    half_length: Array,
    values: Array,
    *,
    cmap: str = "cividis",
    vmin: float | None = None,
    vmax: float | None = None,
    label: str = "",
) -> PolyCollection:
    """Draw every material point as the rectangle x +- half_length it stands for, coloured by its value.

    Positions x (p, 2) and half-lengths (p, 2) or (2,) are in units of h, values (p,) in those `label` states. Returns
    the mappable, for `figure.colorbar(mappable, ax=ax, label=mappable.get_label())`. The rectangles are pixels inside
    the SVG: that keeps it small, and neighbours meet without the pale seams of a vector drawing.
    """
    drawn = PolyCollection(
        _rectangles(x, half_length),
        array=values,
        cmap=cmap,
        linewidth=0,
        edgecolor="none",
        antialiased=False,
        rasterized=True,
        label=label,
    )
    drawn.set_clim(vmin, vmax)
    ax.add_collection(drawn)
    _frame(ax, x, half_length)
    return drawn


def draw_design(ax: Axes, x: Array, half_length: Array, rho: Array) -> PolyCollection:
    """Draw physical densities rho (p,), 0 white and 1 black, and the outline of the body; the rest as `draw_points`."""
    # Stroked rectangles below the filled ones: what stays visible is the edge of their union, holes included.
    outline = PolyCollection(
        _rectangles(x, half_length), facecolor="none", edgecolor="#0072b2", linewidth=2.4, rasterized=True, zorder=0.5
    )
    ax.add_collection(outline)
    return draw_points(ax, x, half_length, rho, cmap="gray_r", vmin=0.0, vmax=1.0, label="density")


def _rectangles(x: Array, half_length: Array) -> list[Array]:
    """Corners of the points' domains, p times (4, 2)."""
    corners = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    return list(x[:, None, :] + np.broadcast_to(half_length, x.shape)[:, None, :] * corners)


def _frame(ax: Axes, x: Array, half_length: Array) -> None:
    """Equal axes in units of h around the body."""
    lower, upper = np.min(x - half_length, axis=0), np.max(x + half_length, axis=0)
    margin = 0.02 * np.max(upper - lower)
    ax.set(xlim=(lower[0] - margin, upper[0] + margin), ylim=(lower[1] - margin, upper[1] + margin))
    ax.set(aspect="equal", xlabel="x / h", ylabel="y / h")
