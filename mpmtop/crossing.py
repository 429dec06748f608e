"""Induced cell crossing: families of displacements that move material points over cell boundaries, before the analysis.

The paper moves points in x and says neither how far nor which. Every family moves in x only; volumes and half-lengths
stay. `Uniform` moves the body as a whole; the others keep its outline: a point whose domain could leave the body does
not move, so that no cell outside is cut. Distances are in units of the cells' side h, which is 1 unless given; a line
of the grid lies at x0.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mpmtop.arrays import Array
from mpmtop.points import MaterialPoints
from mpmtop.region import Region


class Crossing(Protocol):
    """A family with its parameters; `str` is its label in reports."""

    def __call__(self, points: MaterialPoints, body: Region, h: float = 1.0, x0: float = 0.0) -> MaterialPoints:
        """The points, moved."""
        ...


@dataclass(frozen=True)
class Uniform:
    """Every point by `shift`. With 2 x 2 points per cell the first column crosses at 1/4."""

    shift: float

    def __call__(self, points: MaterialPoints, body: Region, h: float = 1.0, x0: float = 0.0) -> MaterialPoints:
        """See `Crossing`."""
        return points.moved((self.shift * h, 0.0))

    def __str__(self) -> str:
        return f"uniform({self.shift:g})"


@dataclass(frozen=True)
class Periodic:
    """The column left of every `every`-th cell boundary by `distance`: one cell is left with one column of points, its
    neighbour has three."""

    every: int
    distance: float = 0.26

    def __call__(self, points: MaterialPoints, body: Region, h: float = 1.0, x0: float = 0.0) -> MaterialPoints:
        """See `Crossing`."""
        boundary = (points.x[:, 0] - x0 + points.half_length[:, 0]) / h
        nearest = np.rint(boundary)
        pushed = (np.abs(boundary - nearest) < 1e-9) & (nearest % self.every == 0)
        return moved_inside(points, self.distance * pushed, body, h)

    def __str__(self) -> str:
        return f"periodic({self.every}, {self.distance:g})"


@dataclass(frozen=True)
class Wave:
    """A smooth deformation, `amplitude` sin(2 pi x / `period`), as bodies have: neighbours move almost alike."""

    period: float
    amplitude: float = 0.26

    def __call__(self, points: MaterialPoints, body: Region, h: float = 1.0, x0: float = 0.0) -> MaterialPoints:
        """See `Crossing`."""
        distance = self.amplitude * np.sin(2 * np.pi * (points.x[:, 0] - x0) / (self.period * h))
        return moved_inside(points, distance, body, h)

    def __str__(self) -> str:
        return f"wave({self.period:g}, {self.amplitude:g})"


@dataclass(frozen=True)
class Bump:
    """The sum of `amplitude` exp(-((x - b + 1/4) / `width`)^2) over every `every`-th cell boundary b inside the body:
    the column left of it, 1/4 before it, goes about as far as `Periodic`'s, and its neighbours come along."""

    every: int
    width: float = 1.5
    amplitude: float = 0.26

    def __call__(self, points: MaterialPoints, body: Region, h: float = 1.0, x0: float = 0.0) -> MaterialPoints:
        """See `Crossing`."""
        first, last = ((float(corner[0]) - x0) / h for corner in body.bounds)
        boundaries = self.every * np.arange(np.floor(first / self.every) + 1, np.ceil(last / self.every))
        from_crest = (points.x[:, :1] - x0) / h - boundaries + 0.25
        distance = self.amplitude * np.sum(np.exp(-((from_crest / self.width) ** 2)), axis=1)
        return moved_inside(points, distance, body, h)

    def __str__(self) -> str:
        return f"bump({self.every}, {self.width:g}, {self.amplitude:g})"


@dataclass(frozen=True)
class Jitter:
    """Every point by an independent, uniformly distributed distance of at most `amplitude`, but those nearer to an end:
    had they only one way to go, the ends would move inwards on average."""

    amplitude: float
    seed: int = 0

    def __call__(self, points: MaterialPoints, body: Region, h: float = 1.0, x0: float = 0.0) -> MaterialPoints:
        """See `Crossing`."""
        distance = np.random.default_rng(self.seed).uniform(-self.amplitude, self.amplitude, len(points.x))
        return moved_inside(points, distance, body, h, reach=self.amplitude)

    def __str__(self) -> str:
        return f"jitter({self.amplitude:g})"


BY_NAME: dict[str, Callable[..., Crossing]] = {
    "uniform": Uniform,
    "periodic": Periodic,
    "wave": Wave,
    "bump": Bump,
    "jitter": Jitter,
}
PARAMETERS: dict[str, tuple[float, ...]] = {
    "uniform": (0.3,),
    "periodic": (4, 0.26),
    "wave": (8, 0.26),
    "bump": (4, 1.5, 0.26),
    "jitter": (0.3,),
}
"""Those of a family that is named without any."""


def named(text: str) -> Crossing:
    """The member of a family by what `str` says of it, as "periodic(4, 0.26)"; parameters left out at the end are those
    of `PARAMETERS`. ValueError for another text."""
    name, _, inner = text.strip().partition("(")
    if name not in BY_NAME or (inner and not inner.endswith(")")):
        known = ", ".join(str(BY_NAME[each](*PARAMETERS[each])) for each in BY_NAME)
        raise ValueError(f"crossing {text!r}: say none, or a family such as {known}")
    try:
        given = [float(part) for part in inner.rstrip(")").split(",") if part.strip()]
    except ValueError as error:
        raise ValueError(f"crossing {text!r}: the parameters of {name} are numbers") from error
    usual = PARAMETERS[name]
    if len(given) > len(usual) or not np.all(np.isfinite(given)):
        raise ValueError(f"crossing {text!r}: {name} has {len(usual)} finite parameters, as {usual}")
    values = (*given, *usual[len(given) :])
    if name in ("periodic", "bump"):
        if values[0] < 1 or values[0] != int(values[0]):
            raise ValueError(f"crossing {text!r}: the first parameter of {name} is a whole number of cells, from 1 on")
        values = (int(values[0]), *values[1:])
    if (name == "wave" and values[0] <= 0) or (name == "bump" and values[1] <= 0):
        raise ValueError(f"crossing {text!r}: lengths of {name} are positive")
    return BY_NAME[name](*values)


FAMILIES: dict[str, tuple[Crossing, ...]] = {
    "uniform(s)": tuple(Uniform(s) for s in (0.26, 0.3, 0.4, 0.5, 0.6, 0.7, 0.74)),
    "periodic(n, 0.26)": tuple(Periodic(n) for n in (2, 3, 4, 5, 6, 8)),
    "wave(n, 0.26)": tuple(Wave(n) for n in (5, 6, 7, 8, 9, 10, 12, 16, 20)),
    "bump(4, w, 0.26)": tuple(Bump(4, w) for w in (0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0)),
}
"""Members of each family; none wider than half the distance of the bumps, where their sum is next to a shift."""


def moved(crossing: Crossing) -> str:
    """The family in words, to begin a sentence with."""
    match crossing:
        case Uniform(shift):
            return f"With all points moved by {shift:g} h"
        case Periodic(every, distance):
            return f"With the points left of one in {every} cell boundaries moved by {distance:g} h"
        case Wave(period, amplitude):
            return f"With points moved by a sine of length {period:g} h and amplitude {amplitude:g} h"
        case Bump(every, width):
            return f"With a bump of {width:g} h in width at one in {every} cell boundaries"
        case Jitter(amplitude):
            return f"With points moved at random by up to {amplitude:g} h"
    return f"With points moved by {crossing}"


def moved_inside(
    points: MaterialPoints, distance: Array, body: Region, h: float = 1.0, reach: float = 0.0
) -> MaterialPoints:
    """Points moved in x by distance (p,) h, but those whose domain would leave the body there, or `reach` h either way.

    Looked at are the middles of the domain's left and right sides.
    """
    sides = points.half_length[:, 0]
    edges = (points.x + np.outer(way * (sides + h * np.maximum(way * distance, reach)), [1.0, 0.0]) for way in (-1, 1))
    free = np.logical_and(*(body.contains(edge, 1e-9 * h) for edge in edges))
    return points.moved(np.outer(np.where(free, distance, 0.0), [h, 0.0]))
