"""Codes with one planted fault each, made from ours, and an independent GIMP: sound, and 10 % off in one gradient."""

from dataclasses import dataclass, replace

import numpy as np

from mpmtop.arrays import Array
from mpmtop.grid import Grid
from mpmtop.shape_functions import Ends, ShapeFunction, Stencil, gimp, tent
from validation.methods.points import PointMethod
from validation.methods.protocol import Answer, Capability, Case, Shape


def own_gimp(xi: Array, half_length: Array, tol: float = 0.0, ends: Ends | None = None) -> Stencil:
    """The tent's mean over a domain, by its antiderivative, on the three nodes from the domain's first cell on."""
    first = np.floor(xi - half_length + tol).astype(np.intp)
    node = first[:, None] + np.arange(3)
    a, b = (xi - half_length)[:, None] - node, (xi + half_length)[:, None] - node

    def hat(s: Array) -> Array:
        return np.maximum(1 - np.abs(s), 0)

    def area(s: Array) -> Array:
        return np.where(s < 0, (1 + np.clip(s, -1, 0)) ** 2 / 2, 1 - (1 - np.clip(s, 0, 1)) ** 2 / 2)

    N, grad_N = (area(b) - area(a)) / (b - a), (hat(b) - hat(a)) / (b - a)
    none = np.abs(N) < 1e-14
    return Stencil(first, np.where(none, 0, N), np.where(none, 0, grad_N))


def off_by_a_tenth(xi: Array, half_length: Array, tol: float = 0.0, ends: Ends | None = None) -> Stencil:
    first, N, grad_N = own_gimp(xi, half_length, tol, ends)
    return Stencil(first, N, grad_N * [0.9, 1, 1])


def clipped(xi: Array, half_length: Array, tol: float = 0.0, ends: Ends | None = None) -> Stencil:
    """Weights of nodes beyond the point's own cell are dropped."""
    first, N, grad_N = gimp(xi, half_length, tol, ends)
    node = first[:, None] + np.arange(3) - np.floor(xi + tol)[:, None]
    kept = (node == 0) | (node == 1)
    return Stencil(first, N * kept, grad_N * kept)


def wrong_sign(xi: Array, half_length: Array, tol: float = 0.0, ends: Ends | None = None) -> Stencil:
    """The last branch of the gradient of a domain that crosses a line."""
    first, N, grad_N = gimp(xi, half_length, tol, ends)
    return Stencil(first, N, grad_N * np.where(N[:, 2:] != 0, [1, 1, -1], 1))


def half_open(xi: Array, half_length: Array, tol: float = 0.0, ends: Ends | None = None) -> Stencil:
    """Tents from their nodes: the left branch is (-1, 0] and not [-1, 0), the right one [0, 1)."""
    first = np.floor(xi + tol).astype(np.intp) - 1
    d = xi[:, None] - first[:, None] - np.arange(4)
    d = np.where(np.abs(d - np.rint(d)) <= tol, np.rint(d), d)
    left, right = (d > -1) & (d <= 0), (d >= 0) & (d < 1)
    N = np.where(left, 1 + d, np.where(right, 1 - d, 0))
    return Stencil(first, N, np.where(left, 1.0, np.where(right, -1.0, 0)))


def nothing(xi: Array, half_length: Array, tol: float = 0.0, ends: Ends | None = None) -> Stencil:
    first, N, grad_N = tent(xi, half_length, tol, ends)
    return Stencil(first, 0 * N, 0 * grad_N)


@dataclass(frozen=True)
class Elevated(PointMethod):
    """Nodes are taken at heights h j, without the grid's origin: no point of an elevated grid is near one."""

    def at(self, grid: Grid) -> PointMethod:
        return PointMethod(self.name, self.shape_function if grid.origin[1] == 0 else nothing)

    def shape(self, x: Array, half_length: Array, grid: Grid) -> Shape:
        return self.at(grid).shape(x, half_length, grid)

    def analyse(self, case: Case) -> Answer:
        return self.at(case.grid).analyse(case)


@dataclass(frozen=True)
class ByCount(PointMethod):
    """The body's weight is shared out by the number of its points."""

    def analyse(self, case: Case) -> Answer:
        if case.body_force is not None:
            volume = case.points.volume
            case = replace(case, body_force=case.body_force * (volume.mean() / volume)[:, None])
        return super().analyse(case)


WITHOUT: frozenset[Capability] = frozenset({"loads at positions"})
"""The independent GIMP divides by the size of a domain: it has no functions at a position."""
SOUND = PointMethod("own GIMP", own_gimp, without=WITHOUT)
TENTH = PointMethod("own GIMP, one gradient 10 % off", off_by_a_tenth, without=WITHOUT)


def planted(shape_function: ShapeFunction) -> PointMethod:
    return PointMethod(shape_function.__name__, shape_function)


FAULTS: dict[str, PointMethod] = {
    "weights end at the cell": planted(clipped),
    "origin of the grid left out along y": Elevated("elevated", gimp),
    "wrong sign in a gradient": planted(wrong_sign),
    "weight shared by count, not by volume": ByCount("by count", gimp),
    "half-open convention reversed on one side": planted(half_open),
}
"""Broken codes by the kind of their fault."""
