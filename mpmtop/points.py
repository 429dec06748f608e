"""Material points: seeding a region."""

from dataclasses import dataclass, replace

import numpy as np

from mpmtop.arrays import Array
from mpmtop.errors import EmptyDomain
from mpmtop.region import Region, divisions

GAUSS_2 = 1 / np.sqrt(3)
"""Abscissae of the two-point Gauss rule are -+GAUSS_2 on [-1, 1]."""


@dataclass(frozen=True, eq=False)
class MaterialPoints:
    """Material points: position x (p, 2) [length], volume (p,) [length^2], half-length l (p, 2) of their domains."""

    x: Array
    volume: Array
    half_length: Array

    def __post_init__(self) -> None:
        p = len(self.x)
        if p == 0:
            raise EmptyDomain("no material points: the domain must hold at least one")
        if self.x.shape != (p, 2) or self.volume.shape != (p,) or self.half_length.shape != (p, 2):
            raise ValueError(
                f"points x {self.x.shape}, volume {self.volume.shape}, half_length {self.half_length.shape}: "
                "give (p, 2), (p,) and (p, 2)"
            )
        if not np.all(np.isfinite(self.x)):
            raise ValueError(f"{np.count_nonzero(~np.isfinite(self.x))} point coordinates are not finite: remove them")
        size = np.concatenate([self.volume, self.half_length.ravel()])
        if not (np.all(size > 0) and np.all(np.isfinite(size))):
            raise ValueError("point volumes and half-lengths must be positive and finite: give each point a size")

    def moved(self, shift: Array | tuple[float, float]) -> "MaterialPoints":
        """The same points displaced by `shift`, (2,) or (p, 2); volumes and half-lengths stay."""
        return replace(self, x=self.x + shift)


def seed(region: Region, spacing: tuple[float, float]) -> MaterialPoints:
    """Points at the centres of a lattice of the given spacing (x, y) over the region's bounding box.

    Centres outside the region are left out. Each point owns its lattice rectangle. The spacing must divide the box:
    points that drift through the cells of the grid would be another discretisation than the one asked for. Raises
    InvalidScene and EmptyDomain.
    """
    lower, upper = region.bounds
    counts = divisions("point spacing, which is h over the points per cell,", region.bounds, spacing)
    step = (upper - lower) / counts
    axes = [a + s * (np.arange(n) + 0.5) for a, s, n in zip(lower, step, counts, strict=True)]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    x = x[region.contains(x)]
    if len(x) == 0:
        raise EmptyDomain(f"no point of a lattice of spacing {step.tolist()} lies in the domain: refine it")
    p = len(x)
    return MaterialPoints(x, np.full(p, step.prod()), np.tile(step / 2, (p, 1)))


def to_gauss_points(points: MaterialPoints) -> MaterialPoints:
    """Points seeded 2 x 2 per cell, from the first cell on, moved to the cells' Gauss points.

    With tent functions this is the Q1 finite element with full integration: the part of the difference between the
    methods that is no quadrature error vanishes.
    """
    size = 4 * points.half_length  # of the cell
    corner = np.min(points.x - points.half_length, axis=0)
    cell = np.floor((points.x - corner) / size + 1e-9)
    if np.any(np.unique(cell, axis=0, return_counts=True)[1] != 4):
        raise ValueError("Gauss points need the points seeded 2 x 2 in every cell: seed with ppc = 2")
    centre = corner + (cell + 0.5) * size
    return replace(points, x=centre + np.sign(points.x - centre) * size / 2 * GAUSS_2)
