"""Checks of shape functions whose domains are parallelograms, by their corners, as CPDI's are.

What holds of any of them: the weights sum to one and reproduce the centre, the gradients those of linear fields.
Gradients of such functions are means over a domain and not derivatives of the weights, and are not asked to be.

Source: A. Sadeghirad, R. M. Brannon and J. Burghardt (2011), Int. J. Numer. Meth. Engng 86:1435 (CPDI).
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from mpmtop.arrays import Array
from mpmtop.grid import Grid
from validation.codes.card import Check, Observed
from validation.codes.shape import AWAY, CELLS, ORIGINS, ROUNDING, counted, dense, mirrored, turned
from validation.methods.protocol import Capability, HasCorners, Shape

SHEARED: frozenset[Capability] = frozenset({"sheared domains"})
COUNT = 200
SUMS = "sums of some products near one, rounded"


class Sample(NamedTuple):
    """Parallelograms by their corners (k, 4, 2), counter-clockwise, on a grid."""

    grid: Grid
    corners: Array


def sample(origin: tuple[float, float] = (0.0, 0.0), h: tuple[float, float] = (1.0, 1.0)) -> Sample:
    """In the middle of a grid: sides of a fifth to seven tenths of a cell, sheared by up to a half, turned at will."""
    rng = np.random.default_rng(0)
    centre = rng.uniform(AWAY, CELLS - AWAY, (COUNT, 2))
    size, shear, angle = rng.uniform(0.1, 0.35, (COUNT, 2)), rng.uniform(-0.5, 0.5, COUNT), rng.uniform(0, 7, COUNT)
    u = size[:, :1] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    across = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    v = size[:, 1:] * (across + shear[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    corners = centre[:, None] + np.stack([-u - v, u - v, u + v, v - u], axis=1)
    return Sample(Grid(origin, h, (CELLS, CELLS)), origin + corners * h)


def asked(code: HasCorners, at: Sample) -> Shape:
    """The code's functions, counted."""
    return counted(code.shape_of_corners(at.corners, at.grid), len(at.corners), at.grid)


def worst(error: Array, at: Sample) -> Observed:
    """Largest of the errors (k, ...), and of which parallelogram."""
    by_point = error.reshape(len(at.corners), -1).max(axis=1)
    p = int(np.argmax(by_point))
    places = ", ".join(f"({x:.4g}, {y:.4g})" for x, y in at.grid.cell_coordinates(at.corners[p]))
    return Observed(float(by_point[p]), f"corners at {places} cells")


def unity(code: HasCorners) -> Observed:
    """|sum N - 1|."""
    at = sample()
    return worst(np.abs(asked(code, at).N.sum(axis=1) - 1), at)


def gradient_sum(code: HasCorners) -> Observed:
    """|sum grad N|."""
    at = sample()
    return worst(np.abs(asked(code, at).grad_N.sum(axis=1)), at)


def completeness(code: HasCorners, h: tuple[float, float]) -> Observed:
    """|sum N x_i - centre| in cells, and |sum grad N x_i - 1|."""
    at = sample(h=h)
    shape = asked(code, at)
    centre = at.grid.cell_coordinates(at.corners.mean(axis=1))
    values = np.abs(np.einsum("kn,kna->ka", shape.N, shape.node.astype(float)) - centre)
    slopes = np.abs(np.einsum("kna,knb->kab", shape.node * at.grid.h, shape.grad_N) - np.eye(2)).reshape(-1, 4)
    return worst(np.concatenate([values, slopes], axis=1), at)


def elsewhere(code: HasCorners, name: str) -> Observed:
    """Difference from the same parallelograms on a grid from (0, 0)."""
    at = sample(ORIGINS[name])
    return worst(np.abs(dense(asked(code, at)) - dense(asked(code, sample()))), at)


def begun_elsewhere(code: HasCorners) -> Observed:
    """Difference where the corners begin with the third."""
    at = sample()
    rolled = Sample(at.grid, np.roll(at.corners, 2, axis=1))
    return worst(np.abs(dense(asked(code, rolled)) - dense(asked(code, at))), at)


def image(code: HasCorners, turn: Callable[[Array], Array], flips: bool) -> Observed:
    """Difference of functions of turned parallelograms from the turned functions, about the middle of the grid."""
    at, middle = sample(), CELLS / 2
    moved = turn((at.corners - middle).reshape(-1, 2)).reshape(at.corners.shape) + middle
    there = dense(asked(code, Sample(at.grid, moved[:, ::-1] if flips else moved)))
    index = np.rint(turn(at.grid.node_positions() - middle) + middle).astype(int) @ [CELLS + 1, 1]
    here, expected = dense(asked(code, at)), np.zeros_like(there)
    expected[:, index, 0] = here[..., 0]
    expected[:, index, 1:] = turn(here[..., 1:].reshape(-1, 2)).reshape(here[..., 1:].shape)
    return worst(np.abs(there - expected), at)


def checks() -> list[Check]:
    """In the order in which a failure is best looked at."""
    ten = 10 * ROUNDING

    def check(
        name: str, observe: Callable[[HasCorners], Observed], look: str, at_most: float, why: str = SUMS
    ) -> Check:
        return Check("sheared domain", name, SHEARED, observe, why, look, at_most)

    far = "eps |x| / h times slopes up to ten"
    return [
        check("unity", unity, "the weights of the four corners; a node that is shared by two of them", ROUNDING),
        check("sum of gradients", gradient_sum, "the four corners' factors sum to zero", ten),
        check(
            "linear fields",
            partial(completeness, h=(1.0, 1.0)),
            "the area; which side belongs to which corner, and its sign",
            ten,
        ),
        check(
            "linear fields on oblong cells",
            partial(completeness, h=(0.25, 2.0)),
            "gradients per cell in place of per length",
            10 * ten,
        ),
        *(
            check(f"origin {name}", partial(elsewhere, name=name), "where a corner is turned into a cell", 1e-11, far)
            for name in ORIGINS
            if "1e6" not in name
        ),
        check("corners from the third on", begun_elsewhere, "a corner that counts as the lower left one", ten),
        check("mirror image", partial(image, turn=mirrored, flips=True), "the sense in which corners go round", ten),
        check("quarter turn", partial(image, turn=turned, flips=False), "a factor that takes one axis for both", ten),
    ]
