"""The five benchmarks drawn side by side: body, what is held, where forces act, where errors are taken."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from mpmtop.body import Body
from mpmtop.points import seed
from validation.bodies.beam import beam_body
from validation.bodies.bracket import BRACKET_SIDE, PATH, bracket_body
from validation.bodies.cook import COOK_TIP, cook_body
from validation.bodies.sketch import arrows
from validation.studies.work_precision.field import tip_scene

POINTS = 24
"""Points along a body's longer side in the drawing."""


def benchmarks() -> Figure:
    """One panel each; the square of the manufactured solution is held all around and loaded all over."""
    figure, axes = plt.subplots(1, 5, figsize=(9.6, 2.2), layout="constrained")
    axes[0].add_patch(plt.Rectangle((0, 0), 1, 1, facecolor="0.9", edgecolor="#d55e00", linewidth=2))
    axes[0].set(title="manufactured", aspect="equal", xlim=(-0.1, 1.1), ylim=(-0.1, 1.1))
    bodies = {
        "beam": (beam_body(6), np.array([(24.0, 3.0)])),
        "Cook's membrane": (cook_body(0.5), COOK_TIP / 2),
        "bracket, path": (bracket_body(25), PATH * 25 / BRACKET_SIDE),
        "optimised field": (tip_scene().body, None),
    }
    for ax, (name, (body, measured)) in zip(axes[1:], bodies.items(), strict=True):
        _panel(ax, body, measured)
        ax.set_title(name)
    for ax in axes:
        ax.set(xticks=[], yticks=[])
        ax.title.set_fontsize("small")
        ax.spines[:].set_visible(False)
    return figure


def _panel(ax: plt.Axes, body: Body, measured: np.ndarray | None) -> None:
    """The body in grey, what is held in orange, forces as arrows, where the error is taken in blue."""
    lower, upper = body.domain.bounds
    size = float(np.max(upper - lower))
    count = np.maximum(np.rint(POINTS * (upper - lower) / size), 4)
    points = seed(body.domain, tuple((upper - lower) / count))
    ax.scatter(points.x[:, 0], points.x[:, 1], s=5, color="0.8", linewidths=0, rasterized=True)
    edge = points.x[:, None, :] + points.half_length[:, None, :] * np.array([(-1, 0), (1, 0), (0, 1), (0, -1)])
    edge = edge.reshape(-1, 2)
    for support in body.held:
        held = edge[support.region.contains(edge, 1e-9)]
        ax.scatter(held[:, 0], held[:, 1], s=7, color="#d55e00", linewidths=0, rasterized=True)
    arrows(ax, body, points, 0.2 * size)
    if measured is not None:
        ax.plot(
            *measured.T,
            "o",
            markersize=3 if len(measured) == 1 else 1,
            color="#0072b2",
            linestyle="none",
            rasterized=True,
        )
    ax.set_aspect("equal")
    ax.margins(0.1)
