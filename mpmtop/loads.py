"""Loads: forces, and which points or positions of a body they act on."""

from dataclasses import dataclass

import numpy as np

from mpmtop.arrays import Array, Index
from mpmtop.errors import InvalidScene, LoadOutsideBody
from mpmtop.region import Region, finite_pair


@dataclass(frozen=True)
class PointLoad:
    """Force (2,) at `position`, shared equally by the `points` material points nearest to it.

    With `points` = 0 no point carries it: it acts at the position itself, through bilinear functions of the grid or
    the mesh's own.
    """

    position: tuple[float, float]
    force: tuple[float, float]
    points: int = 6

    def __post_init__(self) -> None:
        finite_pair("position of a load", self.position)
        finite_pair("force", self.force)
        if self.points < 0:
            raise InvalidScene(f"point load shared by {self.points} points: give 0 or more")

    def shares(self, x: Array, tol: float) -> tuple[Index, Array]:
        """Indices (n,) of the points at x (p, 2) that carry the load, and the share of each (n,), of sum one.

        Points at one distance, to `tol`, are alike: if there are more of them than shares left, all of them divide
        what is left. The resultant is then as near to the position as can be, and a mirrored scene has a mirrored load.
        """
        if self.points > len(x):
            raise LoadOutsideBody(
                f"point load at {self.position} asks for {self.points} points and the body has {len(x)}: lower `points`"
            )
        distance = np.rint(np.hypot(*(x - self.position).T) / tol)
        last = np.partition(distance, self.points - 1)[self.points - 1]
        nearer, shell = np.flatnonzero(distance < last), np.flatnonzero(distance == last)
        left = (self.points - len(nearer)) / len(shell)
        return np.append(nearer, shell), np.repeat([1.0, left], [len(nearer), len(shell)]) / self.points

    def act(self, x: Array, tol: float) -> tuple[Array, Array]:
        """Positions (n, 2) and forces (n, 2) of the load on a body with points (or elements) at x (p, 2)."""
        if self.points == 0:
            return np.array([self.position], float), np.array([self.force], float)
        carriers, share = self.shares(x, tol)
        return x[carriers], np.outer(share, self.force)


@dataclass(frozen=True)
class RegionLoad:
    """Force (2,) shared equally by all material points in `region`."""

    region: Region
    force: tuple[float, float]

    def __post_init__(self) -> None:
        finite_pair("force", self.force)

    def shares(self, x: Array, tol: float) -> tuple[Index, Array]:
        """Indices (n,) of the points at x (p, 2) in the region, and the share of each (n,), of sum one."""
        inside = np.flatnonzero(self.region.contains(x, tol))
        if len(inside) == 0:
            raise LoadOutsideBody("the region of a load holds no material point: enlarge it or move it onto the body")
        return inside, np.full(len(inside), 1 / len(inside))

    def act(self, x: Array, tol: float) -> tuple[Array, Array]:
        """Positions (n, 2) and forces (n, 2) of the load on a body with points (or elements) at x (p, 2)."""
        carriers, share = self.shares(x, tol)
        return x[carriers], np.outer(share, self.force)
