"""The opening of a page: a drawing of what is analysed, and a table of its parameters with the source of each."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.collections import LineCollection, PolyCollection
from scipy.spatial import KDTree

from mpmtop.body import Body
from mpmtop.criteria import PNormStress
from mpmtop.fields import rectangles
from mpmtop.points import MaterialPoints, seed
from mpmtop.region import Region
from mpmtop.scene import Scene
from mpmtop.scene_plot import arrows_of, draw_parts
from validation.bodies.scenes import SPACING, H
from validation.harness.report import Report
from validation.measures.drawing import draw_points

PAPER, CHOSEN, CALIBRATED, NO_PART = "paper", "chosen here", "calibrated here", "plays no part here"
"""Where a parameter comes from."""
FEW = 9
"""Loads from which arrows are drawn thin: heads of full size would cover each other."""
ENLARGED = 4
"""Cells along a side of the enlarged part: as many as one period of the crossing shown most."""


def opening(
    report: Report, scene: Scene, sources: Mapping[str, str], *, points: MaterialPoints | None = None, note: str = ""
) -> None:
    """Record sketch and parameters of a scene; `sources` says of parameters where they come from, the others are the
    paper's. `points` are those drawn and counted, 2 x 2 per cell if not given."""
    grid = points or seed(scene.body.domain, (SPACING, SPACING))
    rows = parameters(scene, grid)
    if unknown := set(sources) - set(rows):
        raise ValueError(f"no parameter {', '.join(sorted(unknown))}: there are {', '.join(rows)}")
    sourced = {name: (value, sources.get(name, PAPER)) for name, value in rows.items()}
    passive = (scene.design.passive_void, scene.design.passive_solid)
    body_opening(report, scene.body, grid, sourced, note=note, passive=passive)


def body_opening(
    report: Report,
    body: Body,
    points: MaterialPoints,
    rows: Mapping[str, tuple[Any, str]],
    *,
    h: float = H,
    note: str = "",
    passive: Sequence[Region | None] = (None, None),
) -> None:
    """Record sketch and parameters of a body on cells of side h: `rows` holds value and source of each, by name."""
    caption = f"What is analysed, on its grid, one dot for each material point; orange: held. {note}"
    report.opening.figure("scene", draw(body, points, h, passive), caption.strip())
    value, source = zip(*rows.values(), strict=True)
    table = pd.DataFrame({"value": value, "source": source}, index=list(rows), dtype=object)
    report.opening.table("parameters", table.rename_axis("parameter"), "Parameters; h = F = E0 = 1 unless stated.")


def parameters(scene: Scene, points: MaterialPoints) -> dict[str, Any]:
    """What defines a scene, by name."""
    lower, upper = scene.body.domain.bounds
    material, objective = scene.body.material, scene.objective
    what = f"p-norm of stress, p = {objective.p:g}, q = {objective.q:g}" if isinstance(objective, PNormStress) else ""
    return {
        "size": " x ".join(f"{side:g} h" for side in upper - lower),
        "material points": len(points.x),
        "load": "; ".join(map(said, scene.body.loads)),
        "objective": what or "compliance",
        "volume fraction": scene.design.volume_fraction,
        "filter radius": f"{scene.design.filter_radius:g} h",
        "penalty": scene.design.penal,
        "E_min / E0": scene.design.contrast,
        "rho_min": scene.design.rho_min,
        "Poisson's ratio": f"{material.poisson:g}, plane {material.plane}",
    }


def said(load: Any) -> str:
    """Force and place of a load, in words."""
    force = f"({load.force[0]:g}, {load.force[1]:g}) F"
    if not hasattr(load, "position"):
        return f"{force} over the edge"
    place = f"{force} at ({load.position[0]:g}, {load.position[1]:g}) h"
    if not hasattr(load, "points"):
        return place
    return f"{place}, on {load.points} point{'s' if load.points > 1 else ''}"


def _enlarge(ax: plt.Axes, points: MaterialPoints, h: float) -> None:
    """A few cells about the middle of the body's points, each point with the domain that it stands for."""
    middle = points.x[np.argmin(np.linalg.norm(points.x - np.median(points.x, axis=0), axis=1))]
    corner = (np.floor(middle / h) - ENLARGED // 2) * h
    near = np.all((points.x > corner - h) & (points.x < corner + (ENLARGED + 1) * h), axis=1)
    x, half = points.x[near], np.broadcast_to(points.half_length, points.x.shape)[near]
    ax.add_collection(PolyCollection(list(rectangles(x, half)), facecolors="0.92", edgecolors="0.75", linewidths=0.5))
    ends = corner[:, None] + [0, ENLARGED * h]
    for k in range(ENLARGED + 1):
        ax.axvline(corner[0] + k * h, color="0.35", linewidth=0.8)
        ax.axhline(corner[1] + k * h, color="0.35", linewidth=0.8)
    ax.plot(*x.T, "o", color="#0072b2", markersize=2.5, linestyle="none")
    ax.set(xlim=ends[0], ylim=ends[1], aspect="equal", title="a part of it", xticks=[], yticks=[])


def draw(
    body: Body, points: MaterialPoints, h: float = H, passive: Sequence[Region | None] = (None, None)
) -> plt.Figure:
    """Body, grid of cells of side h, points, what is held and loads; beside a large body a part of it; `passive` are
    the regions that stay void and solid."""
    if np.max(np.ptp(points.x, axis=0)) > 2 * ENLARGED * h:
        figure, (ax, part) = plt.subplots(1, 2, figsize=(6.6, 3.2), width_ratios=(3, 1))
        _enlarge(part, points, h)
    else:
        figure, ax = plt.subplots(figsize=(4.6, 3.2))
    draw_points(ax, points.x, points.half_length, np.full(len(points.x), 0.12), cmap="gray_r", vmin=0, vmax=1)
    lower, upper = body.domain.bounds
    first, last = np.floor(lower / h).astype(int), np.ceil(upper / h).astype(int)
    lines = [[(x * h, first[1] * h), (x * h, last[1] * h)] for x in range(first[0], last[0] + 1)]
    lines += [[(first[0] * h, y * h), (last[0] * h, y * h)] for y in range(first[1], last[1] + 1)]
    ax.add_collection(LineCollection(lines, colors="0.75", linewidths=0.3, rasterized=True))
    draw_parts(ax, body)
    dot = max(0.05, 4e3 / max(len(points.x), 1) ** 1.2)
    ax.scatter(points.x[:, 0], points.x[:, 1], s=dot, color="#0072b2", linewidths=0, rasterized=True)
    axes = (np.arange(a, b + 1) * h for a, b in zip(first, last, strict=True))
    nodes = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    inside = KDTree(points.x).query(nodes)[0] < 0.75 * h  # corners of the body's cells
    for support in body.held:
        held = nodes[support.region.contains(nodes, 1e-9) & inside]
        ax.scatter(held[:, 0], held[:, 1], marker="s", s=9, color="#d55e00", linewidths=0, label="held", zorder=3)
    size = float(np.max(upper - lower))
    arrows(ax, body, points, 0.16 * size)
    margin = 0.04 * size
    low, high = np.minimum(ax.dataLim.min, lower), np.maximum(ax.dataLim.max, upper)
    ax.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))
    if h != H:
        ax.set(xlabel="x", ylabel="y")
    for region, marker in zip(passive, "xo", strict=True):
        if region is not None:
            chosen = points.x[region.contains(points.x)]
            ax.scatter(chosen[:, 0], chosen[:, 1], s=4, marker=marker, color="0.4", linewidths=0.4, rasterized=True)
    return figure


def arrows(ax: plt.Axes, body: Body, points: MaterialPoints, reach: float) -> None:
    """An arrow for each force, ending where it acts; the largest as long as `reach`. A force on a region is shown by
    seven along the region's upper end."""
    loads: tuple[Any, ...] = body.loads
    few = len(loads) < FEW
    style = {"arrowstyle": "-|>", "color": "#000000", "linewidth": 1.6 if few else 0.5}
    style |= {"mutation_scale": 14 if few else 4, "shrinkA": 0, "shrinkB": 0}
    acting = []
    for load in loads:
        if hasattr(load, "position"):
            acting.append((np.array([load.position]), np.array([load.force])))
        elif hasattr(load, "region") and load.act(points.x, points.volume, 1e-9).along:
            pairs = arrows_of(load, body.domain)
            acting.append((np.array([at for at, _ in pairs]), np.array([t for _, t in pairs])))
        else:
            carrying = points.x[load.region.contains(points.x, 1e-9)]
            columns = np.linspace(carrying[:, 0].min(), carrying[:, 0].max(), 7 if np.ptp(carrying[:, 0]) else 1)
            places = np.column_stack([columns, np.full(len(columns), carrying[:, 1].max())])
            acting.append((places, np.tile(load.force, (len(places), 1))))
    largest = max((float(np.linalg.norm(force, axis=1).max()) for _, force in acting), default=1.0)
    for places, force in acting:
        starts = places - reach * force / largest
        for place, start in zip(places, starts, strict=True):
            ax.annotate("", tuple(place), tuple(start), arrowprops=style, annotation_clip=False, zorder=4)
        ax.update_datalim(np.vstack([places, starts]))
