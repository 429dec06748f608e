"""A crossed body by its seeded points: what a scene selects by position is what it would select had nothing moved.

A region whose edge lies on a line that points cross holds others of them afterwards: another load, another part,
another mean. Runs would then not differ in crossing alone. Supports hold nodes, and passive regions go by the design
grid: both stay as they are.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from mpmtop.arrays import Array, Mask
from mpmtop.criteria import Criterion, Displacement, Worst
from mpmtop.loads import Action, Load, Throughout
from mpmtop.region import Region
from mpmtop.scene import Scene


@dataclass(frozen=True, eq=False)
class Moves:
    """Where points (p, 2) were seeded, and where they are now."""

    seeded: Array
    moved: Array

    def undone(self, x: Array) -> Array:
        """The seeded positions of the moved points; any other positions x (n, 2) as they are."""
        return self.seeded if np.array_equal(x, self.moved) else x


@dataclass(frozen=True, eq=False)
class SeededRegion:
    """A region that holds the points that it held as seeded."""

    region: Region
    moves: Moves

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner, each (2,)."""
        return self.region.bounds

    def contains(self, x: Array, tol: float = 0.0) -> Mask:
        """Which of the positions x (n, 2), (n,)."""
        return self.region.contains(self.moves.undone(x), tol)


@dataclass(frozen=True, eq=False)
class SeededLoad:
    """A load that is carried by the points that carried it as seeded, with the forces that it had on them."""

    load: Load
    moves: Moves = field(repr=False)

    def __str__(self) -> str:
        return str(self.load)

    def act(self, x: Array, volume: Array, tol: float) -> Action:
        """See `Load.act`."""
        act = self.load.act(self.moves.undone(x), volume, tol)
        return act._replace(throughout=tuple(map(self._by_volume, act.throughout)))

    def _by_volume(self, part: Throughout) -> Throughout:
        region = None if part.region is None else SeededRegion(part.region, self.moves)
        return part._replace(region=region, force=lambda x: part.force(self.moves.undone(x)))


def as_seeded(scene: Scene, seeded: Array, moved: Array) -> Scene:
    """The scene, whose loads, parts and criteria take the points at `moved` (p, 2) for those at `seeded` (p, 2)."""
    moves = Moves(seeded, moved)

    def loads(of: tuple[Load, ...]) -> tuple[Load, ...]:
        return tuple(SeededLoad(load, moves) for load in of)

    body = scene.body
    parts = tuple(replace(part, region=SeededRegion(part.region, moves)) for part in body.parts)
    objective = scene.objective
    return replace(
        scene,
        body=replace(body, loads=loads(body.loads), parts=parts),
        objective=replace(objective, criterion=_criterion(objective.criterion, moves))
        if isinstance(objective, Worst)
        else _criterion(objective, moves),
        constraints=tuple(replace(each, criterion=_criterion(each.criterion, moves)) for each in scene.constraints),
        cases=tuple(replace(case, loads=loads(case.loads)) for case in scene.cases),
    )


def _criterion(stated: Criterion, moves: Moves) -> Criterion:
    if isinstance(stated, Displacement) and not isinstance(stated.place, tuple):
        return replace(stated, place=SeededRegion(stated.place, moves))
    return stated
