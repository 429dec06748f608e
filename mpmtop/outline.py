"""Outline of a domain: its boundary as positions, outward normals and lengths, to integrate over.

Every region names the curves that its outline is made of. Which parts of them bound the domain is told by the domain
itself, a hair to either side: what holds for a rectangle holds for any union, intersection or difference.
"""

from typing import NamedTuple

import numpy as np

from mpmtop.arrays import Array, Mask
from mpmtop.curves import Curve
from mpmtop.region import Region, outline

PROBE = 1e-9
"""Of the domain's longer side: how far to either side of a curve it is asked what is inside. Where curves of a
composite domain meet at an angle, the outline is as long as it should be to about that."""
ON = 1e-12
"""Of the same: positions of a curve this far from another region are on it; their rounding is below."""
SAMPLES = 8
"""Positions between two cuts of a curve at which it is asked whether the domain ends there."""
BISECTIONS = 50
"""Halvings of the interval between two samples: to rounding."""
GAUSS_POINTS, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(5)
"""Exact to degree 9: products of two cubic B-splines, and more than any load needs on an arc within a cell."""


class Surface(NamedTuple):
    """Positions x (n, 2) on an outline, outward unit normals (n, 2) and lengths (n,) that they stand for."""

    x: Array
    normal: Array
    length: Array


def surface(domain: Region, region: Region, lines: tuple[Array, Array]) -> Surface:
    """The part of the domain's outline that lies in `region`, five Gauss points between each two cuts.

    Curves are cut where they cross the `lines` of a grid, coordinates (m,) along x and along y, so that functions of
    the grid's cells are integrated exactly on straight ones; and at the corners of the region's box, so that an edge
    is found however short it is. What else ends a part is found to rounding if it is longer than an eighth of what two
    cuts leave. Empty if the region holds no outline.
    """
    lower, upper = domain.bounds
    size = float(np.max(upper - lower))
    ends = np.array(region.bounds)
    cuts = [np.concatenate([line, end[np.isfinite(end)]]) for line, end in zip(lines, ends.T, strict=True)]
    parts, before = [], list[Curve]()
    for curve in outline(domain, (lower, upper)):
        at = np.unique(np.concatenate([[0.0, 1.0], *(curve.cuts(axis, cuts[axis]) for axis in (0, 1))]))
        inner = (np.arange(SAMPLES) + 0.5) / SAMPLES
        samples = (at[:-1, None] + np.diff(at)[:, None] * inner).ravel()
        side = _sides(domain, region, curve, before, samples, size)
        low, high = samples[:-1][side[:-1] != side[1:]], samples[1:][side[:-1] != side[1:]]
        first = side[:-1][side[:-1] != side[1:]]
        for _ in range(BISECTIONS if len(low) else 0):
            middle = (low + high) / 2
            same = _sides(domain, region, curve, before, middle, size) == first
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        at = np.unique(np.concatenate([at, high]))
        width = np.diff(at)
        side = _sides(domain, region, curve, before, at[:-1] + width / 2, size)
        speed = curve.at(at[:-1])[2]
        kept = (side != 0) & (width * speed > 4 * ON * size)  # the rest is what ON adds at the ends of a part
        t = (at[:-1, None] + width[:, None] * (1 + GAUSS_POINTS) / 2)[kept].ravel()
        x, normal, speed = curve.at(t)
        weight = (width[kept, None] * GAUSS_WEIGHTS / 2).ravel()
        parts.append(Surface(x, np.repeat(side[kept], len(GAUSS_POINTS))[:, None] * normal, weight * speed))
        before.append(curve)
    return Surface(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def _sides(domain: Region, region: Region, curve: Curve, before: list[Curve], t: Array, size: float) -> Array:
    """Of a curve at t (n,): 1 where the domain ends in `region` along the normal, -1 against it, 0 elsewhere, and where
    an earlier curve runs, too."""
    x, normal, _ = curve.at(t)
    own: Mask = region.contains(x, ON * size)
    for other in before:
        own = own & ~other.holds(x, ON * size)
    side = np.zeros(len(t), dtype=int)
    if not np.any(own):
        return side
    x, normal = x[own], normal[own]
    behind, beyond = (domain.contains(x + way * PROBE * size * normal).astype(int) for way in (-1, 1))
    side[own] = behind - beyond
    return side
