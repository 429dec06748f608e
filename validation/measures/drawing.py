"""What the studies draw of a body of material points, and the style of every figure."""

from typing import Any

from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.image import AxesImage

from mpmtop import plot
from mpmtop.arrays import Array
from mpmtop.fields import rectangles

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
    cmap: str = plot.MAP,
    vmin: float | None = None,
    vmax: float | None = None,
    label: str = "",
    outlined: bool = False,
) -> AxesImage | PolyCollection:
    """Draw every material point as the rectangle x +- half_length it stands for, coloured by its value.

    Positions x (p, 2) and half-lengths (p, 2) or (2,) are in units of h, values (p,) in those `label` states. Returns
    the mappable, for `figure.colorbar(mappable, ax=ax, label=label)`.
    """
    corners = rectangles(x, half_length)
    drawn = plot.cells(ax, corners, values, cmap=cmap, limits=(vmin, vmax), outlined=outlined)
    plot.frame(ax, corners).set(xlabel="x / h", ylabel="y / h")
    drawn.set_label(label)
    return drawn


def draw_design(ax: Axes, x: Array, half_length: Array, rho: Array) -> AxesImage | PolyCollection:
    """Draw physical densities rho (p,), 0 white and 1 black, and the outline of the body; the rest as `draw_points`."""
    return draw_points(ax, x, half_length, rho, cmap=plot.DENSITY, vmin=0.0, vmax=1.0, label="density", outlined=True)
