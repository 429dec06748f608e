"""Loads: what acts where on a body of given points (or elements) and volumes.

A load is an object with the one method `act`; one of one's own is as good as those here. Where it names the place that
it acts at, its `position`, that place has to lie in the body.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from numbers import Integral
from typing import NamedTuple, Protocol

import numpy as np

from mpmtop.arrays import Array, Index
from mpmtop.errors import InvalidScene, LoadOutsideBody
from mpmtop.region import Region, check_region, finite_pair

LOAD_ROUNDING = 1e-14
"""Of the sum of all forces: what is left at a node where they cancel."""


def check_work(free: Array, forces: Array) -> None:
    """LoadOutsideBody if `forces` (n, 2) leave nothing on the free degrees of freedom but rounding, (m,) in all."""
    if not np.any(np.abs(free) > LOAD_ROUNDING * np.abs(forces).sum()):
        raise LoadOutsideBody(
            "the loads act on held nodes only, are zero or cancel each other, and do no work: move them away from the "
            "supports, or change their forces"
        )


class Action(NamedTuple):
    """Forces `carried` (k, 2) by points (k,), through their own functions, and forces `force` (n, 2) at positions
    (n, 2) that belong to no point."""

    points: Index
    carried: Array
    position: Array
    force: Array

    def places(self, x: Array) -> tuple[Array, Array]:
        """Positions (k + n, 2) and forces of all, on a body with points at x (p, 2)."""
        return np.concatenate([x[self.points], self.position]), np.concatenate([self.carried, self.force])


class Load(Protocol):
    """What a body is pulled by."""

    def act(self, x: Array, volume: Array, tol: float) -> Action:
        """What acts where on a body with points (or elements) at x (p, 2) of the given volumes (p,); lengths below
        `tol` are rounding."""
        ...


def carried(points: Index, forces: Array) -> Action:
    """Forces (k, 2) carried by points (k,) alone."""
    return Action(points, forces, np.empty((0, 2)), np.empty((0, 2)))


def action(loads: Iterable[Load], x: Array, volume: Array, tol: float) -> Action:
    """What all loads do, in their order; arguments as for `Load.act`."""
    nothing = carried(np.empty(0, np.intp), np.empty((0, 2)))
    parts = zip(nothing, *(load.act(x, volume, tol) for load in loads), strict=True)
    return Action(*(np.concatenate(part) for part in parts))


def positions(loads: Iterable[Load]) -> Array:
    """The places (n, 2) that loads name."""
    named = [load.position for load in loads if hasattr(load, "position")]
    return np.array(named, float).reshape(-1, 2)


@dataclass(frozen=True)
class PointLoad:
    """Force (2,) shared equally by the `points` material points nearest to `position`, as in the paper.

    The shares are equal whatever the points' sizes: where these differ near the position, the resultant leans to the
    side of the smaller ones. `RegionLoad` shares by volume, `PositionLoad` acts at the position itself.
    """

    position: tuple[float, float]
    force: tuple[float, float]
    points: int = 6

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", finite_pair("position of a load", self.position))
        object.__setattr__(self, "force", finite_pair("force", self.force))
        if not isinstance(self.points, Integral) or self.points < 1:
            raise InvalidScene(
                f"point load shared by {self.points} points: give a whole number of at least 1, or a `PositionLoad`, "
                "which acts at the position itself"
            )

    def act(self, x: Array, volume: Array, tol: float) -> Action:
        """Points at one distance, to `tol`, are alike: if there are more of them than shares left, all of them divide
        what is left. The resultant is then as near to the position as can be, and a mirrored body has a mirrored load.
        """
        if self.points > len(x):
            raise LoadOutsideBody(
                f"point load at {self.position} asks for {self.points} points and the body has {len(x)}: lower `points`"
            )
        distance = np.rint(np.hypot(*(x - self.position).T) / tol)
        last = np.partition(distance, self.points - 1)[self.points - 1]
        nearer, shell = np.flatnonzero(distance < last), np.flatnonzero(distance == last)
        left = (self.points - len(nearer)) / len(shell)
        share = np.repeat([1.0, left], [len(nearer), len(shell)]) / self.points
        return carried(np.append(nearer, shell), np.outer(share, self.force))


@dataclass(frozen=True)
class PositionLoad:
    """Force (2,) at `position` itself, through the functions that the grid or the mesh has there.

    Its energy grows without bound as these get finer: that of a force at a point of the plane is infinite.
    """

    position: tuple[float, float]
    force: tuple[float, float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", finite_pair("position of a load", self.position))
        object.__setattr__(self, "force", finite_pair("force", self.force))

    def act(self, x: Array, volume: Array, tol: float) -> Action:
        """No point carries it."""
        return Action(np.empty(0, np.intp), np.empty((0, 2)), np.array([self.position]), np.array([self.force]))


@dataclass(frozen=True)
class RegionLoad:
    """Force (2,) shared by all material points in `region`, in proportion to their volumes.

    It is then the same force per area on points of any sizes, and refining some of them does not move its resultant.
    """

    region: Region
    force: tuple[float, float]

    def __post_init__(self) -> None:
        check_region("the region of a load", self.region)
        object.__setattr__(self, "force", finite_pair("force", self.force))

    def act(self, x: Array, volume: Array, tol: float) -> Action:
        """Points whose positions the region holds."""
        inside = np.flatnonzero(self.region.contains(x, tol))
        if len(inside) == 0:
            raise LoadOutsideBody("the region of a load holds no material point: enlarge it or move it onto the body")
        return carried(inside, np.outer(volume[inside] / volume[inside].sum(), self.force))
