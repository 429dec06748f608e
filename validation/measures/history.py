"""The histories of optimisations that run beside each other."""

from collections.abc import Mapping
from typing import Protocol

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from mpmtop.arrays import Array

ABOVE, BELOW = 0.04, 0.01
"""How far the enlarged part reaches above the largest last value and below the least one, by themselves: what histories
differ by at their ends is of that size."""


class Run(Protocol):
    """A finished optimisation: objective and volume fraction (k + 1,) of its iterates."""

    @property
    def objective(self) -> Array: ...

    @property
    def volume(self) -> Array: ...


def histories(runs: Mapping[str, Run], label: str, stated: float | None = None) -> Figure:
    """Objective, its end enlarged, and volume fraction against iterations; a line at the number that is `stated`."""
    figure, (top, middle, bottom) = plt.subplots(3, 1, figsize=(5.0, 6.4), sharex=True, height_ratios=(4, 3, 2))
    for name, run in runs.items():
        top.semilogy(run.objective, label=name)
        middle.plot(run.objective)
        bottom.plot(run.volume)
    ends = [float(run.objective[-1]) for run in runs.values()]
    if stated is not None:
        top.axhline(stated, color="0.4", linewidth=1, linestyle="-", label="paper, final")
        middle.axhline(stated, color="0.4", linewidth=1, linestyle="-")
        ends.append(stated)
    middle.set(ylim=((1 - BELOW) * min(ends), (1 + ABOVE) * max(ends)), ylabel="its end")
    plain_logarithm(top)
    top.set(ylabel=label)
    top.legend()
    middle_of = float(next(iter(runs.values())).volume[-1])
    bottom.set(xlabel="iteration", ylabel="volume fraction", ylim=(0.9 * middle_of, 1.05 * middle_of))
    return figure


def plain_logarithm(ax: plt.Axes) -> None:
    """Ticks 1, 2, 4, 8 of every decade, in plain numbers."""
    ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 4, 8)))
    ax.yaxis.set_major_formatter(lambda y, _: f"{y:g}")
    ax.minorticks_off()
