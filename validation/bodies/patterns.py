"""Patterns of crossing drawn where they are used: what moves, how far, and which points change their cell."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np

from mpmtop.crossing import Crossing, Wave, moved
from mpmtop.points import seed
from mpmtop.region import Rectangle
from validation.bodies.manufactured import DeformedWave
from validation.bodies.scenes import SPACING, H
from validation.harness.report import Recorder

STRIP = Rectangle((0.0, 0.0), (16.0 * H, 2.0 * H))
"""Two rows of cells, long enough for two periods of the longest pattern in use."""
STILL = 1e-9
"""Distance [H] below which a point is drawn as where it was seeded: the rounding of a displacement."""


def strip(crossings: Sequence[Crossing]) -> plt.Figure:
    """The patterns below each other on a strip of cells with 2 x 2 points: seeded places hollow, points that moved
    blue, those of another cell than before orange."""
    seeded = seed(STRIP, (SPACING, SPACING))
    figure, axes = plt.subplots(len(crossings), 1, figsize=(6.4, 1.15 * len(crossings)), sharex=True, squeeze=False)
    for ax, crossing in zip(axes[:, 0], crossings, strict=True):
        x = crossing(seeded, STRIP).x
        moves = np.abs(x - seeded.x).max(axis=1) > STILL
        crosses = np.any(np.floor(x / H) != np.floor(seeded.x / H), axis=1)
        ax.vlines(np.arange(17) * H, 0, 2 * H, color="0.7", linewidth=0.6)
        ax.hlines(np.arange(3) * H, 0, 16 * H, color="0.7", linewidth=0.6)
        ax.plot(
            *seeded.x[moves].T,
            "o",
            markersize=3,
            markerfacecolor="none",
            markeredgecolor="0.6",
            linestyle="none",
            rasterized=True,
        )
        for chosen, color in ((~moves, "0.35"), (moves & ~crosses, "#0072b2"), (crosses, "#d55e00")):
            ax.plot(*x[chosen].T, "o", markersize=3, color=color, linestyle="none", rasterized=True)
        ax.set_title(str(crossing), fontsize="small", loc="left", pad=2)
        ax.set(aspect="equal", xlim=(-0.2, 16.9), yticks=[])
        ax.spines[["left", "bottom"]].set_visible(False)
    axes[-1, 0].set_xlabel("x / h")
    return figure


def define(page: Recorder, crossings: Sequence[Crossing], name: str = "patterns") -> None:
    """Record the strip of the patterns that a page uses, each with its words."""
    words = "; ".join(f"`{crossing}`: {in_words(crossing)}" for crossing in crossings)
    page.figure(
        name,
        strip(crossings),
        f"The patterns of crossing on this page. Hollow: where points were seeded; blue: moved; orange: moved into "
        f"another cell. {words}.",
    )


def in_words(crossing: Crossing) -> str:
    """What the pattern does, to stand after its name."""
    if isinstance(crossing, DeformedWave):
        wave = Wave(crossing.period, crossing.amplitude)
        return f"{in_words(wave)}, the domains with them so that they tile the body"
    return moved(crossing).removeprefix("With ")
