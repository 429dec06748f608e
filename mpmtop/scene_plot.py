"""Picture of a scene, as `plot.scene` draws it: the domain and its parts, supports of every kind, and loads."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mpmtop.arrays import Array
from mpmtop.body import Body
from mpmtop.fields import Layout
from mpmtop.loads import Load
from mpmtop.outline import surface
from mpmtop.region import Region
from mpmtop.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BLUE, ORANGE, GREEN, PURPLE = "#0072b2", "#d55e00", "#009e73", "#cc79a7"  # of Okabe and Ito's palette
HATCHES = ("//", "xx", "..", "oo", "--")
RASTER = 400  # pixels along the larger side of a body whose outline is drawn
CUTS = 9  # lines between which one arrow stands, and five marks of what runs along the outline


def draw_scene(ax: Axes, of: Scene, where: Layout | None) -> None:
    """All of a scene; with the layout of a model its grid and points, or elements."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    lower, upper = of.body.domain.bounds
    handles: list[Any] = []
    draw_region(ax, of.body.domain, of.body.domain, "0.88")
    handles += draw_parts(ax, of.body)
    for part, colour, label in (
        (of.design.passive_solid, "0.45", "passive solid"),
        (of.design.passive_void, "#f0e442", "passive void"),
    ):
        if part is not None:
            draw_region(ax, part, of.body.domain, colour)
            handles.append(Patch(color=colour, label=label))
    if where is None:
        for support in of.body.held:
            draw_region(ax, support.region, of.body.domain, BLUE, reach=0.01)
    if where is None and (of.body.held or not (of.body.edges or of.body.springs or of.body.beds)):
        handles.append(Patch(color=BLUE, label="support"))
    elif where is not None:
        handles += _discretised(ax, where)
    handles += draw_ties(ax, of.body)
    span = 0.18 * float((upper - lower).max())
    acting = (*of.body.loads, *(load for case in of.cases for load in case.loads))
    for load in acting:
        _draw_arrows(ax, arrows_of(load, of.body.domain), span, ORANGE)
    if acting:
        handles.append(Line2D([], [], color=ORANGE, marker=">", label="load"))
    moved = [support for support in of.body.held if any(support.displacement)]
    for support in moved:
        x, _, _, tol = _raster(of.body.domain, 0.01)
        held = x[support.region.contains(x, tol)]
        _draw_arrows(ax, [(held.mean(axis=0), np.array(support.displacement))] if len(held) else [], span, PURPLE)
    if moved:
        handles.append(Line2D([], [], color=PURPLE, marker=">", label="displaced"))
    ax.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=3, frameon=False)


def draw_parts(ax: Axes, body: Body) -> list[Any]:
    """Each part of another material hatched in its own way; returns what the legend says of them."""
    from matplotlib.patches import Patch

    handles = []
    for k, part in enumerate(body.parts):
        x, shape, (x0, x1, y0, y1), tol = _raster(body.domain, 0.0)
        inside = (part.region.contains(x, tol) & body.domain.contains(x, tol)).astype(float).reshape(shape)
        hatch = HATCHES[k % len(HATCHES)]
        if np.any(inside):
            framed = np.pad(inside, 1)  # so that the region ends with the picture
            fine = (x1 - x0) / shape[1], (y1 - y0) / shape[0]
            across, up = (
                a + d * (np.arange(n + 2) - 0.5) for a, d, n in zip((x0, y0), fine, (shape[1], shape[0]), strict=True)
            )
            filled = ax.contourf(across, up, framed, levels=[0.5, 1.5], colors=["0.78"], hatches=[hatch], zorder=0.5)
            filled.set_edgecolor("0.45")
            filled.set_linewidth(0.0)
        label = f"E0 = {part.material.young:g}, nu = {part.material.poisson:g}"
        handles.append(Patch(facecolor="0.78", edgecolor="0.45", hatch=hatch, label=label))
    return handles


def draw_ties(ax: Axes, body: Body) -> list[Any]:
    """Supports along the outline, elastic beds and springs; returns what the legend says of them."""
    lines = tuple(np.linspace(*body.domain.bounds, CUTS).T)
    found = []
    for supports, marker, colour, size, label in (
        (body.edges, "s", BLUE, 3.5, "held along the edge"),
        (body.beds, "|", GREEN, 7.0, "elastic bed"),
    ):
        places = [surface(body.domain, support.region, (lines[0], lines[1])).x for support in supports]
        if places:
            x, y = np.concatenate(places).T
            found += ax.plot(x, y, marker, color=colour, markersize=size, linestyle="none", label=label)
    if body.springs:
        at = np.array([spring.position for spring in body.springs])
        found += ax.plot(*at.T, "D", color=BLUE, markersize=5, linestyle="none", label="spring")
    return found


def draw_region(ax: Axes, region: Region, domain: Region, colour: str, reach: float = 0.0) -> None:
    """The part of a region in the domain, as pixels; `reach` of the larger side beyond it, for what lies on an edge."""
    from matplotlib.colors import ListedColormap

    x, shape, extent, tol = _raster(domain, reach)
    inside = region.contains(x, tol) & domain.contains(x, tol)
    picture = np.where(inside, 1.0, np.nan).reshape(shape)
    ax.imshow(picture, cmap=ListedColormap([colour]), origin="lower", extent=extent, interpolation="nearest")


def arrows_of(load: Load, domain: Region) -> list[tuple[Array, Array]]:
    """Where a load acts and its force (2,) there: in the mean, but at several places along the outline."""
    if hasattr(load, "position"):
        force: Any = getattr(load, "force", (0.0, 0.0))
        return [(np.array(load.position, float), np.array(force, float))]
    x, _, _, tol = _raster(domain, 0.01)
    x = x[domain.contains(x, tol)]
    act = load.act(x, np.ones(len(x)), tol)
    arrows = [(act.places(x)[0].mean(axis=0), act.carried.sum(axis=0))] if len(act.points) else []
    by_volume = (part.at(x, tol) for part in act.throughout)
    arrows += [(x[np.any(force != 0, axis=1)].mean(axis=0), force.sum(axis=0)) for force in by_volume]
    for piece in act.along:
        on = surface(domain, piece.region, tuple(np.linspace(*domain.bounds, CUTS).T))
        arrows += list(zip(on.x[2::5], piece.traction(on.x, on.normal)[2::5], strict=True))  # one between two cuts
    return arrows


def _draw_arrows(ax: Axes, arrows: list[tuple[Array, Array]], span: float, colour: str) -> None:
    for at, force in arrows:
        tip = at + span * force / max(float(np.hypot(*force)), np.finfo(float).tiny)
        style = {"arrowstyle": "-|>", "color": colour, "linewidth": 2}
        ax.annotate("", tuple(tip), tuple(at), arrowprops=style, annotation_clip=False)
        ax.update_datalim([tip])


def _raster(domain: Region, reach: float) -> tuple[Array, tuple[int, int], tuple[float, float, float, float], float]:
    """Centres (n, 2) of pixels over a domain's box, their shape (rows, columns) and extent, and `reach` as a length."""
    lower, upper = domain.bounds
    tol = reach * float((upper - lower).max())
    lower, upper = lower - tol, upper + tol
    columns, rows = np.maximum(np.rint(RASTER * (upper - lower) / (upper - lower).max()).astype(int), 1)
    fine = (upper - lower) / (columns, rows)
    x, y = (lower[a] + fine[a] * (np.arange(n) + 0.5) for a, n in enumerate((columns, rows)))
    at = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return at, (rows, columns), (lower[0], upper[0], lower[1], upper[1]), tol


def _discretised(ax: Axes, where: Layout) -> list[Any]:
    """Lines of the grid or the elements, centres, held nodes; returns what the legend says of them."""
    from matplotlib.collections import LineCollection

    lines: Any = where.lines
    ax.add_collection(LineCollection(lines, color="0.65", linewidth=0.4, rasterized=True), autolim=False)
    points = ax.scatter(
        where.x[:, 0], where.x[:, 1], s=2, color=GREEN, linewidth=0, rasterized=True, label="points, or element centres"
    )
    either = np.any(where.held, axis=1)
    both = np.all(where.held, axis=1)
    (x, y), half_held = where.nodes.T, either & ~both
    full = ax.scatter(x[both], y[both], s=14, marker="s", color=BLUE, label="held nodes")
    half = ax.scatter(x[half_held], y[half_held], s=18, marker="o", facecolor="none", edgecolor=BLUE)
    half.set_label("held in one component")
    return [points, *(marks for marks, held in ((full, both), (half, half_held)) if np.any(held))]
