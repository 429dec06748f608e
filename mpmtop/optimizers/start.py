"""Where an optimisation starts: at the problem's own design, at one that is given, or at another problem's."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from scipy.spatial import KDTree

from mpmtop.arrays import Array
from mpmtop.optimizers.protocols import E, Problem

RESOLVED = 1.5
"""Spacings in a filter radius, at least: with one neighbour to each side in the average a coarse design has the fine
one's smallest members; with none it has checkerboards, and their optimum is a bad start."""

STARTS = "give a design (n,), one number for all, or a function of the positions (n, d)"

Start = Array | float | Callable[[Array], Array]


class Placed(Protocol):
    """A problem whose variables have places: positions (n, d), and the length that its filter averages over."""

    @property
    def positions(self) -> Array:
        """Where the design variables are, (n, d)."""

    @property
    def filter_radius(self) -> float:
        """Radius of the density filter [length]."""


class Unplaced(TypeError):
    """A problem does not say where its variables are; the message says what to give it."""


class UnresolvedFilter(ValueError):
    """A level is too coarse for the filter radius; the message says which."""


def starting_design(problem: Problem[E], start: Start | None) -> Array:
    """The design (n,) of a start: x0, an array (n,), one number for all, or a function of the positions (n, d)."""
    if start is None:
        return np.array(problem.x0, float)
    try:
        design = np.asarray(start(np.array(placed(problem).positions)) if callable(start) else start)
    except Unplaced:
        raise
    except (TypeError, ValueError) as error:  # a function of something else, lists of unequal length
        raise ValueError(f"start {start!r} ({error}): {STARTS}") from error
    if design.dtype.kind not in "biuf":
        raise ValueError(f"start {start!r}: {STARTS}")
    design = design.astype(float)
    return np.full(np.shape(problem.x0), design) if design.ndim == 0 else design


def carried(coarse: Problem[Any], x: Array, fine: Problem[Any]) -> Array:
    """A start (n,) for `fine` from a design of another problem: the value of the nearest variable, within the bounds.

    Designs of problems on the same variables are taken as they are.
    """
    unplaced = not (hasattr(coarse, "positions") and hasattr(fine, "positions"))
    if unplaced and len(x) == len(fine.x0):
        return np.clip(x, fine.lower, fine.upper)
    there, here = placed(coarse).positions, placed(fine).positions
    nearest = x if np.array_equal(there, here) else x[KDTree(there).query(here)[1]]
    return np.clip(nearest, fine.lower, fine.upper)


def check_levels(levels: Sequence[Problem[Any]]) -> None:
    """UnresolvedFilter if a level's filter radius is less than `RESOLVED` of its spacings."""
    for k, level in enumerate(levels):
        x, radius = placed(level).positions, placed(level).filter_radius
        spacing = np.median(KDTree(x).query(x, 2)[0][:, 1]) if len(x) > 1 else np.inf
        if radius < RESOLVED * spacing * (1 - 1e-9):  # its rounding
            raise UnresolvedFilter(
                f"level {k}: the filter radius {radius:g} is less than {RESOLVED} of its spacings "
                f"{spacing:g}: give finer levels, of spacings up to {radius / RESOLVED:g}"
            )


def placed(problem: Any) -> Placed:
    """The problem, if it says where its variables are; TypeError otherwise."""
    if not (hasattr(problem, "positions") and hasattr(problem, "filter_radius")):
        raise Unplaced(
            f"{type(problem).__name__} does not say where its variables are: give it `positions` (n, d) and "
            "`filter_radius`, or an array as start"
        )
    return problem
