"""Pictures: a design, its history, a field, the deformed body, the scene; each in one line, for either solver.

Every function draws on the axes `ax` it is given or on new ones, and returns the axes. matplotlib is imported by the
functions, so that to import this module costs nothing. Maps are safe for the colour-blind; axes are equal.

    plot.design(problem.model, iterate.evaluation)
    plot.field(problem.model, iterate.evaluation, "von_mises").figure.savefig("stress.png")
    for iterate in plot.live("frames", problem.model, optimize(problem, GCMMA())): ...
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mpmtop.arrays import Array
from mpmtop.at_points import fields_at_points as fields_at_points  # known to `fields` from here on
from mpmtop.fields import Fields, fields, layout, scalar
from mpmtop.scene import Scene
from mpmtop.scene_plot import BLUE as BLUE  # colours of both
from mpmtop.scene_plot import ORANGE as ORANGE
from mpmtop.scene_plot import draw_scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection
    from matplotlib.image import AxesImage

Passed = TypeVar("Passed")

MAP, DIVERGING, DENSITY = "cividis", "PuOr", "gray_r"
SIGNED = ("_x", "_y", "_xx", "_yy", "_xy", "_zz")  # endings of the names of fields that have a sign
DEFORMED = 0.1  # of the body's larger side: how far the largest displacement is drawn


def design(model: Any, evaluation: Any, ax: Axes | None = None) -> Axes:
    """Physical densities, 0 white and 1 black, within the outline of the body."""
    ax = _axes(ax)
    cells(ax, layout(model).corners, evaluation.rho, cmap=DENSITY, limits=(0.0, 1.0), outlined=True)
    return frame(ax, layout(model).corners)


def field(model: Any, evaluation: Any, name: str, ax: Axes | None = None) -> Axes:
    """A field of `mpmtop.fields.SCALARS`, such as "von_mises", "stress_xx" or "displacement", with its colour bar.

    What has a sign is drawn in two hues about zero. ValueError for an unknown name.
    """
    at = fields(model, evaluation.state, evaluation.rho)
    ax = _axes(ax)
    _coloured(ax, at, at.layout.corners, name)
    return frame(ax, at.layout.corners)


def deformed(
    model: Any, evaluation: Any, name: str = "density", scale: float | None = None, ax: Axes | None = None
) -> Axes:
    """The body moved by `scale` times its displacements, coloured by a field, above its outline at rest.

    Without `scale` the largest displacement is drawn as a tenth of the body's larger side.
    """
    at = fields(model, evaluation.state, evaluation.rho)
    corners, move = at.layout.corners, at.corner_displacement
    if scale is None:
        largest = float(np.hypot(*move.reshape(-1, 2).T).max())
        scale = DEFORMED * float(np.ptp(corners.reshape(-1, 2), axis=0).max()) / largest if largest > 0 else 1.0
    ax = _axes(ax)
    _outline(ax, corners)
    moved = corners + scale * move
    _coloured(ax, at, moved, name)
    ax.set_title(f"displacements times {scale:.3g}")
    return frame(ax, np.concatenate([corners, moved]))


def history(iterates: Iterable[Any], ax: Axes | None = None) -> Axes:
    """Objective, left, and the largest constraint (feasible up to zero), right, by iteration."""
    steps = [(it.iteration, it.objective, float(np.max(it.constraints))) for it in iterates]
    if not steps:
        raise ValueError("no iterates to draw: keep those of `optimize` in a list")
    k, objective, constraint = np.array(steps).T
    ax = _axes(ax)
    ax.plot(k, objective, color=BLUE)
    ax.set(xlabel="iteration", ylabel="objective")
    ax.yaxis.label.set_color(BLUE)
    right = ax.twinx()
    right.plot(k, constraint, color=ORANGE, linestyle="--")
    right.axhline(0.0, color=ORANGE, linewidth=0.5)
    right.set_ylabel("largest constraint", color=ORANGE)
    return ax


def scene(of: Scene, model: Any = None, ax: Axes | None = None) -> Axes:
    """The domain, its parts, supports of every kind, all loads; with a `model` its grid and points, or elements."""
    ax = _axes(ax)
    lower, upper = of.body.domain.bounds
    sides = upper - lower
    draw_scene(ax, of, None if model is None else layout(model))
    box = np.array([lower - 0.06 * sides.max(), upper + 0.06 * sides.max()])
    reach = np.vstack([box, ax.dataLim.get_points()]) if np.all(np.isfinite(ax.dataLim.get_points())) else box
    ax.set(xlim=(reach[:, 0].min(), reach[:, 0].max()), ylim=(reach[:, 1].min(), reach[:, 1].max()))
    ax.set(aspect="equal", xlabel="x", ylabel="y", title=of.name)
    return ax


def live(
    target: Path | str | None, model: Any, iterates: Iterable[Passed], every: int = 1, dpi: int = 100
) -> Iterator[Passed]:
    """Pass iterates on and draw the design of every `every`-th one and of the last.

    `target` is a folder, which gets `<iteration>.png` and, replaced as a whole, `latest.png`; a file `*.gif`, written
    at the end by matplotlib's own writer; or None in a notebook, where the picture is shown anew under the cell.
    """
    import matplotlib.pyplot as plt
    from matplotlib.animation import PillowWriter

    target = None if target is None else Path(target)
    figure, ax = plt.subplots(layout="constrained")
    with ExitStack() as stack:
        stack.callback(plt.close, figure)
        writer = None
        if target is not None and target.suffix == ".gif":
            target.parent.mkdir(parents=True, exist_ok=True)
            writer = PillowWriter(fps=5)
            stack.enter_context(writer.saving(figure, target, dpi))
        drawn: Any = None
        last: Any = None
        for last in iterates:
            if last.iteration % every == 0:
                _frame_of(figure, ax, model, last, target, writer, dpi)
                drawn = last
            yield last
        if last is not drawn:
            _frame_of(figure, ax, model, last, target, writer, dpi)


def cells(
    ax: Axes,
    corners: Any,
    values: Array,
    *,
    cmap: str = MAP,
    limits: tuple[float | None, float | None] = (None, None),
    outlined: bool = False,
) -> AxesImage | PolyCollection:
    """Quads with corners (c, 4, 2) coloured by values (c,); returns the mappable, for a colour bar.

    Cells of a lattice are one image, others one collection, in pixels also in an SVG: that keeps it small, and
    neighbours meet without the pale seams of a vector drawing.
    """
    from matplotlib.collections import PolyCollection

    lattice = _as_lattice(corners)
    if outlined and lattice is None:
        _outline(ax, corners)
    if lattice is not None:
        place, shape, extent = lattice
        if outlined:
            _lattice_outline(ax, *lattice)
        picture = np.full(shape, np.nan)
        picture[place[:, 1], place[:, 0]] = values
        image = ax.imshow(picture, cmap=cmap, origin="lower", extent=extent, interpolation="auto", aspect="equal")
        image.set_clim(*limits)
        return image
    drawn = PolyCollection(
        corners, array=values, cmap=cmap, linewidth=0, edgecolor="none", antialiased=False, rasterized=True
    )
    drawn.set_clim(*limits)
    ax.add_collection(drawn)
    return drawn


def _as_lattice(corners: Array) -> tuple[Array, tuple[int, int], tuple[float, float, float, float]] | None:
    """Place (c, 2) of each quad in a lattice, its shape (rows, columns) and extent; None if they do not tile one."""
    lower, upper = corners.min(axis=1), corners.max(axis=1)
    size = upper[0] - lower[0]
    first = lower.min(axis=0)
    place = np.rint((lower - first) / size).astype(int)
    straight = np.all((corners == lower[:, None]) | (corners == upper[:, None]))
    fits = np.abs(first + place * size - lower).max() < 1e-6 * size.min()  # far below a pixel
    if not (straight and fits and np.abs(upper - lower - size).max() < 1e-6 * size.min()):
        return None
    columns, rows = place.max(axis=0) + 1
    if len(np.unique(place[:, 1] * columns + place[:, 0])) < len(place) or columns * rows > 4 * len(place):
        return None  # one above another, or an image that is mostly empty
    last = first + size * (columns, rows)
    return place, (rows, columns), (first[0], last[0], first[1], last[1])


def _coloured(ax: Axes, at: Fields, corners: Array, name: str) -> None:
    label, values = scalar(at, name)
    limits: tuple[float | None, float | None] = (0.0, None)
    cmap = MAP
    if name == "density":
        cmap, limits = DENSITY, (0.0, 1.0)
    elif name.endswith(SIGNED):
        largest = float(np.abs(values).max()) or 1.0
        cmap, limits = DIVERGING, (-largest, largest)
    ax.figure.colorbar(cells(ax, corners, values, cmap=cmap, limits=limits), ax=ax, label=label, shrink=0.8)


def _outline(ax: Axes, corners: Any) -> None:
    """Quads stroked, and all of them filled above: what stays visible is the edge of their union, holes included."""
    from matplotlib.collections import PolyCollection

    style: dict[str, Any] = {"rasterized": True, "antialiased": False}
    ax.add_collection(PolyCollection(corners, facecolor="none", edgecolor=BLUE, linewidth=2.4, zorder=-2, **style))
    ax.add_collection(PolyCollection(corners, facecolor="white", edgecolor="none", linewidth=0, zorder=-1, **style))


def _lattice_outline(ax: Axes, place: Array, shape: tuple[int, int], extent: tuple[float, ...]) -> None:
    """The same for cells of a lattice, by the sides between one and none: a hundred thousand cells take no time."""
    from matplotlib.collections import LineCollection

    filled = np.zeros(np.add(shape, 2), bool)
    filled[place[:, 1] + 1, place[:, 0] + 1] = True
    first, last = np.array(extent).reshape(2, 2).T
    size = (last - first) / shape[::-1]
    for a, cell in ((0, filled), (1, filled.T)):  # sides across x, then across y
        j, i = np.nonzero(cell[:, 1:] != cell[:, :-1])
        ends: Any = np.empty((len(i), 2, 2))
        ends[:, :, a] = (first[a] + size[a] * i)[:, None]
        ends[:, :, 1 - a] = first[1 - a] + size[1 - a] * np.stack([j - 1, j], axis=1)
        ax.add_collection(LineCollection(ends, color=BLUE, linewidth=2.4, zorder=-1, rasterized=True, capstyle="round"))


def _frame_of(figure: Any, ax: Axes, model: Any, iterate: Any, target: Path | None, writer: Any, dpi: int) -> None:
    """Draw an iterate's design and save, grab or show it."""
    ax.clear()
    design(model, iterate.evaluation, ax)
    ax.set_title(f"iteration {iterate.iteration}, objective {iterate.objective:.5g}")
    if writer is not None:
        writer.grab_frame()
    elif target is not None:
        target.mkdir(parents=True, exist_ok=True)
        figure.savefig(target / f"{iterate.iteration:05d}.png", dpi=dpi)
        partial = target / "latest.png.partial"
        figure.savefig(partial, dpi=dpi, format="png")
        partial.replace(target / "latest.png")
    else:
        from IPython.display import clear_output, display

        clear_output(wait=True)
        display(figure)


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots(layout="constrained")[1]


def frame(ax: Axes, corners: Array) -> Axes:
    """Equal axes around the cells."""
    lower, upper = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    margin = 0.02 * float((upper - lower).max())
    ax.set(xlim=(lower[0] - margin, upper[0] + margin), ylim=(lower[1] - margin, upper[1] + margin))
    ax.set(aspect="equal", xlabel="x", ylabel="y")
    return ax
