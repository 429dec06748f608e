"""The opening of a page: a drawing of the scene, and a table of its parameters with the source of each."""

from collections.abc import Mapping
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.collections import LineCollection, PolyCollection
from scipy.spatial import KDTree

from mpmtop.criteria import PNormStress
from mpmtop.fields import rectangles
from mpmtop.points import MaterialPoints, seed
from mpmtop.scene import Scene
from validation.bodies.scenes import SPACING, H
from validation.harness.report import Report
from validation.measures.drawing import draw_points

PAPER, CHOSEN, CALIBRATED, NO_PART = "paper", "chosen here", "calibrated here", "plays no part here"
"""Where a parameter comes from."""
ENLARGED = 4
"""Cells along a side of the enlarged part: as many as one period of the crossing shown most."""


def opening(
    report: Report, scene: Scene, sources: Mapping[str, str], *, points: MaterialPoints | None = None, note: str = ""
) -> None:
    """Record sketch and parameters of a scene; `sources` says of parameters where they come from, the others are the
    paper's. `points` are those drawn and counted, 2 x 2 per cell if not given."""
    grid = points or seed(scene.body.domain, (SPACING, SPACING))
    report.opening.figure("scene", draw(scene, grid), f"The scene on its grid, one dot for each material point. {note}")
    rows = parameters(scene, grid)
    if unknown := set(sources) - set(rows):
        raise ValueError(f"no parameter {', '.join(sorted(unknown))}: there are {', '.join(rows)}")
    table = pd.DataFrame(
        {"value": rows, "source": {name: sources.get(name, PAPER) for name in rows}}, dtype=object
    ).rename_axis("parameter")
    report.opening.table("parameters", table, "Parameters of the scene; h = F = E0 = 1.")


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
    return f"{force} at ({load.position[0]:g}, {load.position[1]:g}) h, on {load.points} points"


def _enlarge(ax: plt.Axes, points: MaterialPoints) -> None:
    """A few cells about the middle of the body's points, each point with the domain that it stands for."""
    middle = points.x[np.argmin(np.linalg.norm(points.x - np.median(points.x, axis=0), axis=1))]
    corner = (np.floor(middle / H) - ENLARGED // 2) * H
    near = np.all((points.x > corner - H) & (points.x < corner + (ENLARGED + 1) * H), axis=1)
    x, half = points.x[near], np.broadcast_to(points.half_length, points.x.shape)[near]
    ax.add_collection(PolyCollection(list(rectangles(x, half)), facecolors="0.92", edgecolors="0.75", linewidths=0.5))
    ends = corner[:, None] + [0, ENLARGED * H]
    for k in range(ENLARGED + 1):
        ax.axvline(corner[0] + k * H, color="0.35", linewidth=0.8)
        ax.axhline(corner[1] + k * H, color="0.35", linewidth=0.8)
    ax.plot(*x.T, "o", color="#0072b2", markersize=2.5, linestyle="none")
    ax.set(xlim=ends[0], ylim=ends[1], aspect="equal", title="a part of it", xticks=[], yticks=[])


def draw(scene: Scene, points: MaterialPoints) -> plt.Figure:
    """Body, background grid, points, what is held (along its edge) and loads; beside a large one a part of it."""
    if np.max(points.x.max(axis=0) - points.x.min(axis=0)) > 2 * ENLARGED * H:
        figure, (ax, part) = plt.subplots(1, 2, figsize=(6.6, 3.2), width_ratios=(3, 1))
        _enlarge(part, points)
    else:
        figure, ax = plt.subplots(figsize=(4.6, 3.2))
    draw_points(ax, points.x, points.half_length, np.full(len(points.x), 0.12), cmap="gray_r", vmin=0, vmax=1)
    lower, upper = scene.body.domain.bounds
    first, last = np.floor(lower / H).astype(int), np.ceil(upper / H).astype(int)
    lines = [[(x * H, first[1] * H), (x * H, last[1] * H)] for x in range(first[0], last[0] + 1)]
    lines += [[(first[0] * H, y * H), (last[0] * H, y * H)] for y in range(first[1], last[1] + 1)]
    ax.add_collection(LineCollection(lines, colors="0.75", linewidths=0.3, rasterized=True))
    dot = max(0.05, 4e3 / max(len(points.x), 1) ** 1.2)
    ax.scatter(points.x[:, 0], points.x[:, 1], s=dot, color="#0072b2", linewidths=0, rasterized=True)
    nodes = np.stack(np.meshgrid(*(np.arange(a, b + 1) * H for a, b in zip(first, last, strict=True))), -1).reshape(
        -1, 2
    )
    inside = KDTree(points.x).query(nodes)[0] < 0.75 * H  # corners of the body's cells
    for support in scene.body.supports:
        held = nodes[support.region.contains(nodes, 1e-9) & inside]
        ax.scatter(held[:, 0], held[:, 1], marker="s", s=9, color="#d55e00", linewidths=0, label="held", zorder=3)
    reach = 0.16 * float(np.max(upper - lower))
    loads: tuple[Any, ...] = scene.body.loads
    for load in loads:
        if hasattr(load, "position"):
            places = np.array([load.position])
        else:
            carrying = points.x[load.region.contains(points.x, 1e-9)]
            columns = np.linspace(carrying[:, 0].min(), carrying[:, 0].max(), 7)
            places = np.column_stack([columns, np.full(7, carrying[:, 1].max())])
        force = np.array(load.force) / np.linalg.norm(load.force)
        for place in places:
            start = place - reach * force
            arrow = {"arrowstyle": "-|>", "color": "#000000", "linewidth": 1.6}
            ax.annotate("", tuple(place), tuple(start), arrowprops=arrow, annotation_clip=False, zorder=4)
        ends = np.vstack([places, places - reach * force])
        ax.update_datalim(ends)
    margin = 0.04 * float(np.max(upper - lower))
    low, high = np.minimum(ax.dataLim.min, lower), np.maximum(ax.dataLim.max, upper)
    ax.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))
    for region, marker in ((scene.design.passive_void, "x"), (scene.design.passive_solid, "o")):
        if region is not None:
            part = points.x[region.contains(points.x)]
            ax.scatter(part[:, 0], part[:, 1], s=4, marker=marker, color="0.4", linewidths=0.4, rasterized=True)
    return figure
