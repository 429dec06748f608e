"""What the studies draw of a body of material points."""

from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.image import AxesImage

from mpmtop import plot
from mpmtop.arrays import Array
from mpmtop.fields import rectangles


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
