"""Loads: what acts where on a body of given points (or elements) and volumes.

A load is an object with the one method `act`; one of one's own is as good as those here. Where it names the place that
it acts at, its `position`, that place has to lie in the body.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from numbers import Integral
from typing import Any, NamedTuple, Protocol

import numpy as np
from scipy.spatial import cKDTree

from mpmtop.arrays import Array, Index
from mpmtop.errors import InvalidScene, LoadOutsideBody
from mpmtop.outline import surface
from mpmtop.region import Region, check_region, finite, finite_pair

LOAD_ROUNDING = 1e-14
"""Of the sum of all forces: what is left at a node where they cancel."""


def check_work(free: Array, size: float) -> None:
    """LoadOutsideBody if forces, whose absolute values add up to `size`, leave nothing on the free degrees of freedom
    (m,) but rounding."""
    if not np.any(np.abs(free) > LOAD_ROUNDING * size):
        raise LoadOutsideBody(
            "the loads act on held nodes only, are zero or cancel each other, and do no work: move them away from the "
            "supports, or change their forces"
        )


Vectors = Callable[[Array], Array]
"""Vectors (n, 2) of positions (n, 2)."""


class Along(NamedTuple):
    """Force per length `traction`(x, n) (n, 2), of positions and outward normals (n, 2) each, on the part of the
    domain's boundary that lies in `region`."""

    region: Region
    traction: Callable[[Array, Array], Array]


class Throughout(NamedTuple):
    """Force per volume `force`(x) (n, 2) at positions x (n, 2) in `region`, everywhere if that is None; times the
    density there if it `follows_density`."""

    region: Region | None
    force: Vectors
    follows_density: bool

    def at(self, x: Array, tol: float) -> Array:
        """Force per volume (n, 2) at density one, zero outside the region."""
        force = _given("body force", self.force, x, x.shape)
        if self.region is None:
            return force
        inside = self.region.contains(x, tol)
        if not np.any(inside):
            raise LoadOutsideBody("the region of a body force holds no material: enlarge it or move it onto the body")
        return np.where(inside[:, None], force, 0.0)


class Action(NamedTuple):
    """Forces `carried` (k, 2) by points (k,), through their own functions; forces `force` (n, 2) at positions (n, 2)
    that belong to no point; and what acts along the boundary and throughout the volume, which the solver integrates."""

    points: Index
    carried: Array
    position: Array
    force: Array
    along: tuple[Along, ...] = ()
    throughout: tuple[Throughout, ...] = ()

    def places(self, x: Array) -> tuple[Array, Array]:
        """Positions (k + n, 2) and forces of all that act at places, on a body with points at x (p, 2)."""
        return np.concatenate([x[self.points], self.position]), np.concatenate([self.carried, self.force])


class Load(Protocol):
    """What a body is pulled by."""

    def act(self, x: Array, volume: Array, tol: float) -> Action:
        """What acts where on a body with points (or elements) at x (p, 2) of the given volumes (p,); lengths below
        `tol` are rounding."""
        ...


def at_places(
    points: Index | None = None, carried: Array | None = None, position: Array | None = None, force: Array | None = None
) -> Action:
    """What is carried by points or acts at positions, alone; nothing where not given."""
    none, nowhere = np.empty(0, np.intp), np.empty((0, 2))
    carried, position, force = (nowhere if part is None else part for part in (carried, position, force))
    return Action(none if points is None else points, carried, position, force)


def action(loads: Iterable[Load], x: Array, volume: Array, tol: float) -> Action:
    """What all loads do, in their order; arguments as for `Load.act`."""
    parts = [at_places(), *(load.act(x, volume, tol) for load in loads)]
    return Action(
        np.concatenate([act.points for act in parts]),
        np.concatenate([act.carried for act in parts]),
        np.concatenate([act.position for act in parts]),
        np.concatenate([act.force for act in parts]),
        tuple(piece for act in parts for piece in act.along),
        tuple(piece for act in parts for piece in act.throughout),
    )


def carriers(load: Load, x: Array, volume: Array, tol: float, domain: Region, lines: tuple[Array, Array]) -> Index:
    """Points (or elements) that carry a part of a load whatever their density: those it names, those of its volume, and
    the nearest to each position of the outline, which is cut at the `lines` of a grid, see `outline.surface`."""
    act = load.act(x, volume, tol)
    found = [act.points]
    found += [np.flatnonzero(np.any(part.at(x, tol), axis=1)) for part in act.throughout if not part.follows_density]
    found += [cKDTree(x).query(surface(domain, piece.region, lines).x)[1] for piece in act.along]
    return np.unique(np.concatenate(found))


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
        return at_places(np.append(nearer, shell), np.outer(share, self.force))


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
        return at_places(position=np.array([self.position]), force=np.array([self.force]))


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
        return at_places(inside, np.outer(volume[inside] / volume[inside].sum(), self.force))


@dataclass(frozen=True)
class Traction:
    """Force per length (2,), or a function that gives one (n, 2) for positions (n, 2), on the part of the body's
    boundary that lies in `region`.

    The region may be as thin as the edge itself, Rectangle((40, 8), (40, 12)). The domain's own outline counts, not
    that of cells or elements: the sum of forces is the traction times its length. On stairs of cells or points forces
    act where the outline runs, through the functions of the nearest cell with material.
    """

    region: Region
    force: tuple[float, float] | Vectors

    def __post_init__(self) -> None:
        check_region("the region of a traction", self.region)
        if not callable(self.force):
            object.__setattr__(self, "force", finite_pair("traction", self.force))

    def act(self, x: Array, volume: Array, tol: float) -> Action:
        """t."""
        force = _vectors(self.force)
        return at_places()._replace(
            along=(Along(self.region, lambda x, normal: _given("traction", force, x, x.shape)),)
        )


@dataclass(frozen=True)
class Pressure:
    """Pressure, or a function that gives it (n,) for positions (n, 2), on the part of the body's boundary that lies in
    `region`: a force per length against the outward normal, suction where it is negative. See `Traction`."""

    region: Region
    pressure: float | Vectors

    def __post_init__(self) -> None:
        check_region("the region of a pressure", self.region)
        if not callable(self.pressure):
            object.__setattr__(self, "pressure", finite("pressure", self.pressure))

    def act(self, x: Array, volume: Array, tol: float) -> Action:
        """-p n."""

        def traction(x: Array, normal: Array) -> Array:
            if not callable(self.pressure):
                return -self.pressure * normal
            return -_given("pressure", self.pressure, x, (len(x),))[:, None] * normal

        return at_places()._replace(along=(Along(self.region, traction),))


@dataclass(frozen=True)
class BodyForce:
    """Force per volume (2,), or a function that gives one (n, 2) for positions (n, 2), throughout the body or in a
    `region` of it. It acts on what there is of the domain, whatever its density: see `Weight`."""

    force: tuple[float, float] | Vectors
    region: Region | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", _per_volume("body force", self.force, self.region))

    def act(self, x: Array, volume: Array, tol: float) -> Action:
        """The force of each volume, at the points or at points of quadrature."""
        return at_places()._replace(throughout=(Throughout(self.region, _vectors(self.force), False),))


@dataclass(frozen=True)
class Weight:
    """Force per volume (2,) of solid material, or a function as for `BodyForce`, times the density rho.

    The load depends on the design: df/drho is part of every gradient. Compliance then need not fall with material, and
    rho^(penal - 1) of a penalty above 1 leaves voids that are heavier than stiff: give a `contrast` or a `rho_min`
    that carries them.
    """

    force: tuple[float, float] | Vectors
    region: Region | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", _per_volume("weight", self.force, self.region))

    def act(self, x: Array, volume: Array, tol: float) -> Action:
        """The weight at density one; the solver multiplies by the density."""
        return at_places()._replace(throughout=(Throughout(self.region, _vectors(self.force), True),))


def _per_volume(what: str, force: Any, region: Region | None) -> object:
    if region is not None:
        check_region(f"the region of a {what}", region)
    return force if callable(force) else finite_pair(what, force)


def _given(what: str, function: Vectors, x: Array, shape: tuple[int, ...]) -> Array:
    """What a function gives at positions x (n, 2); InvalidScene unless it is finite and has the shape."""
    try:
        found = np.asarray(function(x))
    except (TypeError, ValueError) as error:  # it takes other arguments, or a list of them
        raise InvalidScene(
            f"a {what} by a function failed at {len(x)} positions ({error}): let it take positions (n, 2)"
        ) from error
    if found.shape != shape or found.dtype.kind not in "biuf" or not np.all(np.isfinite(found)):
        raise InvalidScene(
            f"a {what} by a function gave {found.shape} for {shape[0]} positions: return finite numbers {shape}"
        )
    return found


def _vectors(force: tuple[float, float] | Vectors) -> Vectors:
    return force if callable(force) else lambda x: np.tile(np.asarray(force, float), (len(x), 1))
