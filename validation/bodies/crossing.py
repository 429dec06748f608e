"""Induced cell crossing: families of displacements that move material points over cell boundaries, before the analysis.

The paper moves points in x and says neither how far nor which. Every family moves in x only; volumes and half-lengths
stay. `Uniform` moves the body as a whole; the others keep its outline: a point whose domain could leave the body does
not move, so that no cell outside is cut. Distances in units of the cell size H = 1.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mpmtop.arrays import Array
from mpmtop.body import Body
from mpmtop.model import Model, discretise
from mpmtop.points import MaterialPoints, seed
from mpmtop.region import Region
from mpmtop.shape_functions import ShapeFunction
from validation.bodies.scenes import H


class Crossing(Protocol):
    """A family with its parameters; `str` is its label in reports."""

    def __call__(self, points: MaterialPoints, body: Region) -> MaterialPoints:
        """The points, moved."""
        ...


@dataclass(frozen=True)
class Uniform:
    """Every point by `shift`. With 2 x 2 points per cell the first column crosses at 1/4."""

    shift: float

    def __call__(self, points: MaterialPoints, body: Region) -> MaterialPoints:
        return points.moved((self.shift, 0.0))

    def __str__(self) -> str:
        return f"uniform({self.shift:g})"


@dataclass(frozen=True)
class Periodic:
    """The column left of every `every`-th cell boundary by `distance`: one cell is left with one column of points, its
    neighbour has three."""

    every: int
    distance: float = 0.26

    def __call__(self, points: MaterialPoints, body: Region) -> MaterialPoints:
        boundary = (points.x[:, 0] + points.half_length[:, 0]) / H
        nearest = np.rint(boundary)
        pushed = (np.abs(boundary - nearest) < 1e-9) & (nearest % self.every == 0)
        return moved_inside(points, self.distance * pushed, body)

    def __str__(self) -> str:
        return f"periodic({self.every}, {self.distance:g})"


@dataclass(frozen=True)
class Wave:
    """A smooth deformation, `amplitude` sin(2 pi x / `period`), as bodies have: neighbours move almost alike."""

    period: float
    amplitude: float = 0.26

    def __call__(self, points: MaterialPoints, body: Region) -> MaterialPoints:
        distance = self.amplitude * np.sin(2 * np.pi * points.x[:, 0] / (self.period * H))
        return moved_inside(points, distance, body)

    def __str__(self) -> str:
        return f"wave({self.period:g}, {self.amplitude:g})"


@dataclass(frozen=True)
class Bump:
    """The sum of `amplitude` exp(-((x - b + 1/4) / `width`)^2) over every `every`-th cell boundary b inside the body:
    the column left of it, 1/4 before it, goes about as far as `Periodic`'s, and its neighbours come along."""

    every: int
    width: float = 1.5
    amplitude: float = 0.26

    def __call__(self, points: MaterialPoints, body: Region) -> MaterialPoints:
        first, last = (float(corner[0]) / H for corner in body.bounds)
        boundaries = self.every * np.arange(np.floor(first / self.every) + 1, np.ceil(last / self.every))
        from_crest = points.x[:, :1] / H - boundaries + 0.25
        distance = self.amplitude * np.sum(np.exp(-((from_crest / self.width) ** 2)), axis=1)
        return moved_inside(points, distance, body)

    def __str__(self) -> str:
        return f"bump({self.every}, {self.width:g}, {self.amplitude:g})"


@dataclass(frozen=True)
class Jitter:
    """Every point by an independent, uniformly distributed distance of at most `amplitude`, but those nearer to an end:
    had they only one way to go, the ends would move inwards on average."""

    amplitude: float
    seed: int = 0

    def __call__(self, points: MaterialPoints, body: Region) -> MaterialPoints:
        distance = np.random.default_rng(self.seed).uniform(-self.amplitude, self.amplitude, len(points.x))
        return moved_inside(points, distance, body, reach=self.amplitude)

    def __str__(self) -> str:
        return f"jitter({self.amplitude:g})"


FAMILIES: dict[str, tuple[Crossing, ...]] = {
    "uniform(s)": tuple(Uniform(s) for s in (0.26, 0.3, 0.4, 0.5, 0.6, 0.7, 0.74)),
    "periodic(n, 0.26)": tuple(Periodic(n) for n in (2, 3, 4, 5, 6, 8)),
    "wave(n, 0.26)": tuple(Wave(n) for n in (5, 6, 7, 8, 9, 10, 12, 16, 20)),
    "bump(4, w, 0.26)": tuple(Bump(4, w) for w in (0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0)),
}
"""Members of each family; none wider than half the distance of the bumps, where their sum is next to a shift."""


def points_model(body: Body, shape_function: ShapeFunction, ppc: int, crossing: Crossing, ghost: float = 0.0) -> Model:
    """The body on cells of size 1 with ppc x ppc points in each, moved by `crossing`."""
    points = crossing(seed(body.domain, (1 / ppc, 1 / ppc)), body.domain)
    return discretise(body, 1.0, points=points, shape_function=shape_function, ghost=ghost)


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


def moved_inside(points: MaterialPoints, distance: Array, body: Region, reach: float = 0.0) -> MaterialPoints:
    """Points moved in x by distance (p,) H, but those whose domain would leave the body there, or `reach` H either way.

    Looked at are the middles of the domain's left and right sides.
    """
    sides = points.half_length[:, 0]
    edges = (points.x + np.outer(way * (sides + H * np.maximum(way * distance, reach)), [1.0, 0.0]) for way in (-1, 1))
    free = np.logical_and(*(body.contains(edge, 1e-9 * H) for edge in edges))
    return points.moved(np.outer(np.where(free, distance, 0.0), [H, 0.0]))


def integrated_exactly(lower: Array, upper: Array, pieces: int, n: int) -> MaterialPoints:
    """n x n Gauss points in each of `pieces` x `pieces` equal parts of every cell, or what the body has of it.

    Stiffness is then exact for functions that are polynomials of degree n - 1 at most on the parts: what is left
    between this and material points on the same body is their quadrature.
    """
    nodes, weights = np.polynomial.legendre.leggauss(n)
    positions, widths = [], []
    for a, b in zip(lower, upper, strict=True):
        part = H / pieces
        lines = part * np.arange(np.floor(a / part) + 1, np.ceil(b / part))
        breaks = np.concatenate([[a], lines, [b]])
        half = np.diff(breaks)[:, None] / 2
        positions.append((breaks[:-1, None] + half * (1 + nodes)).ravel())
        widths.append((half * weights).ravel())
    x, width = (np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2) for axes in (positions, widths))
    return MaterialPoints(x, width.prod(axis=1), width / 2)
