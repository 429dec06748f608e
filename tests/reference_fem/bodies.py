"""Scenes of the reference's tests, and densities."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pytest

from mpmtop.arrays import Array, Mask
from mpmtop.body import Body, Material, Support
from mpmtop.design import Design
from mpmtop.loads import Action, PointLoad, PositionLoad, action
from mpmtop.region import Rectangle
from mpmtop.scene import Scene
from validation.bodies.scenes import changed

Plane = Literal["strain", "stress"]
planes = pytest.mark.parametrize("plane", ["strain", "stress"])
orders = pytest.mark.parametrize("order", [1, 2])
LEFT = Support(Rectangle((0, -np.inf), (0, np.inf)))


def cantilever(load: object = None, **changes: object) -> Scene:
    """40 x 20, left edge clamped, unit force down at mid-height of the right edge, shared by six points."""
    body = Body(Rectangle((0, 0), (40, 20)), (LEFT,), (load or PointLoad((40, 10), (0, -1)),))  # type: ignore[arg-type]
    return changed(Scene("cantilever", body, Design(0.4, 1.5)), **changes)


def mbb() -> Scene:
    """Half MBB beam in the units of the published educational codes."""
    body = Body(
        Rectangle((0, 0), (60, 20)),
        (
            Support(Rectangle((0, 0), (0, 20)), fixed=(True, False)),
            Support(Rectangle((60, 0), (60, 0)), fixed=(False, True)),
        ),
        (PositionLoad((0, 20), (0, -1)),),
        Material(young=1.0, poisson=0.3, plane="stress"),
    )
    return Scene("half MBB", body, Design(0.5, 2.4, rho_min=0.0))


@dataclass(frozen=True)
class LShape:
    """Box of side 10 without its upper right part beyond 4."""

    bounds = np.zeros(2), np.full(2, 10.0)

    def contains(self, x: Array, tol: float = 0.0) -> Mask:
        return np.all((x >= -tol) & (x <= 10 + tol), axis=1) & np.any(x <= 4 + tol, axis=1)


@dataclass(frozen=True)
class FixedPositions:
    """Unit force down shared equally by positions that do not depend on the mesh."""

    x: Array

    def act(self, x: Array, volume: Array, tol: float) -> Action:
        return action([PositionLoad(tuple(at), (0, -1 / len(self.x))) for at in self.x], x, volume, tol)


def densities(n: int, seed: int = 1) -> Array:
    return np.random.default_rng(seed).uniform(0.2, 1.0, n)
