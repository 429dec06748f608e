"""Weights of points that move: N, grad N and what an adjoint needs of their dependence on positions and domains.

Position x and half-length l of a point's domain decide its weights on the reset grid. Along one axis, besides N and
dN/dx of `mpmtop.shape_functions`: d2N/dx2, dN/dl and d2N/dx dl; zero for the tent, which jumps from cell to cell.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from mpmtop.arrays import Array, Index, Mask
from mpmtop.errors import PointOutsideGrid
from mpmtop.grid import Grid
from mpmtop.large_deformation.law import cofactor, jacobian
from mpmtop.shape_functions import ShapeFunction, bspline2, tent

Domains = Literal["fixed", "stretched"]
WIDEST = 0.49
"""Half-length [cells] at which a stretched domain is clipped: GIMP's functions are made for domains of one cell at
most, and at exactly one both ends may lie on grid lines at a time."""
KINK = 1e-12
"""Distance [cells] within which a position is on a grid line, see `mpmtop.transfer.located`."""
BEND = np.array([1.0, -2.0, 1.0])


class Axis(NamedTuple):
    """Along one axis: N, dN/dx and, where an adjoint asked for them, N_xx, N_l, N_xl; (p, n) each, [1/length]."""

    N: Array
    x: Array
    xx: Array | None = None
    l: Array | None = None  # noqa: E741
    xl: Array | None = None


@dataclass(frozen=True, eq=False)
class Weights:
    """Lines of a stencil's first node (p, 2), nodes (p, n) of the grid, whether touched (p, n), N (p, n), grad_N
    (p, n, 2) and what they are products of."""

    first: Index
    node: Index
    touched: Mask
    N: Array
    grad_N: Array
    axes: tuple[Axis, Axis]


def weights(
    grid: Grid, x: Array, half_length: Array, shape_function: ShapeFunction, *, second: bool = False
) -> Weights:
    """Weights at x (p, 2) with domains half_length (p, 2); `second` adds the second derivatives.

    PointOutsideGrid names the place where a stencil leaves the grid.
    """
    h = np.array(grid.h)
    xi, length = (x - grid.origin) / h, half_length / h
    stencils = [shape_function(xi[:, a], length[:, a], KINK, None) for a in (0, 1)]
    first = np.stack([s.first for s in stencils], axis=1)
    n = stencils[0].N.shape[1]
    axes = []
    for a, s in enumerate(stencils):
        more = _second(shape_function, xi[:, a], length[:, a], h[a]) if second else ()
        axes.append(Axis(s.N, s.grad_N / h[a], *more))
    X, Y = axes
    N = _product(X.N, Y.N)
    grad_N = np.stack([_product(X.x, Y.N), _product(X.N, Y.x)], axis=-1)
    touched = (N != 0) | np.any(grad_N != 0, axis=-1)
    i = np.repeat(first[:, :1] + np.arange(n), n, axis=1)
    j = np.tile(first[:, 1:] + np.arange(n), (1, n))
    nx, ny = grid.nodes
    outside = touched & ((i < 0) | (i >= nx) | (j < 0) | (j >= ny))
    if np.any(outside):
        gone = np.flatnonzero(outside.any(axis=1))
        at = x[gone[0]].real
        lower, upper = np.array(grid.origin), grid.origin + h * grid.cells
        raise PointOutsideGrid(
            f"the body leaves the box from {lower} to {upper}: {len(gone)} of its {len(x)} points, one at "
            f"({at[0]:.4g}, {at[1]:.4g}); give a larger grid, or a smaller load"
        )
    return Weights(first, np.where(touched, i * ny + j, 0), touched, N, grad_N, (X, Y))


def _product(a: Array, b: Array) -> Array:
    return (a[:, :, None] * b[:, None, :]).reshape(len(a), -1)


def _second(shape_function: ShapeFunction, xi: Array, length: Array, h: float) -> tuple[Array, Array, Array]:
    """N_xx, N_l, N_xl along one axis, (p, n) each, [1/length^2], [1/length], [1/length^2]."""
    zero = np.zeros((len(xi), 2 if shape_function is tent else 3), xi.dtype)
    if shape_function is tent:
        return zero, zero, zero
    if shape_function is bspline2:
        return zero + BEND / h**2, zero, zero
    d = xi - np.rint(xi.real)
    crosses = (np.abs(d) < length.real - KINK)[:, None]  # as in `gimp`
    l, d = length[:, None], d[:, None]  # noqa: E741
    bend = np.where(crosses, BEND, 0)
    return bend / (2 * l * h**2), bend * (l**2 - d**2) / (4 * l**2 * h), -bend * d / (2 * l**2 * h**2)


def pull_back(weights: Weights, N_bar: Array, grad_N_bar: Array) -> tuple[Array, Array]:
    """Derivatives by x and l, (p, 2) each, of what has the derivatives N_bar (p, n) and grad_N_bar (p, n, 2) by the
    weights, which must hold second ones."""
    X, Y = weights.axes
    p, n = X.N.shape
    M, Mx, My = (m.reshape(p, n, n) for m in (N_bar, grad_N_bar[..., 0], grad_N_bar[..., 1]))

    def along(a: Array, m: Array, b: Array) -> Array:
        return np.einsum("pi,pij,pj->p", a, m, b)

    assert X.xx is not None and X.l is not None and X.xl is not None
    assert Y.xx is not None and Y.l is not None and Y.xl is not None
    x = along(X.x, M, Y.N) + along(X.xx, Mx, Y.N) + along(X.x, My, Y.x)
    y = along(X.N, M, Y.x) + along(X.x, Mx, Y.x) + along(X.N, My, Y.xx)
    lx = along(X.l, M, Y.N) + along(X.xl, Mx, Y.N) + along(X.l, My, Y.x)
    ly = along(X.N, M, Y.l) + along(X.x, Mx, Y.l) + along(X.N, My, Y.xl)
    return np.stack([x, y], axis=1), np.stack([lx, ly], axis=1)


def stretched(half_length: Array, F: Array, h: tuple[float, float]) -> tuple[Array, Mask]:
    """Half-lengths l0 U_ii (p, 2) with U = (F^T F)^(1/2), at most WIDEST cells, and which of them were clipped.

    U = (C + J 1) / sqrt(tr C + 2 J) in the plane. A domain that turns by 90 degrees keeps the half-lengths it had: U
    knows no rotation.
    """
    length = half_length * _stretch(F)[0]
    widest = WIDEST * np.array(h)
    clipped = length.real > widest
    return np.where(clipped, widest, length), clipped


def stretched_pull_back(half_length: Array, F: Array, clipped: Mask, length_bar: Array) -> Array:
    """Derivative by F (p, 2, 2) of what has the derivative length_bar (p, 2) by the stretched half-lengths."""
    U, root = _stretch(F)
    bar = np.where(clipped, 0, length_bar * half_length)
    C = cofactor(F)
    by_root = (np.sum(bar * U, axis=1) / root)[:, None, None]
    return (2 * F * bar[:, None, :] + bar.sum(axis=1)[:, None, None] * C - by_root * (F + C)) / root[:, None, None]


def _stretch(F: Array) -> tuple[Array, Array]:
    """U_ii (p, 2), and the root (p,) of tr C + 2 J."""
    J, C = jacobian(F), np.sum(F**2, axis=1)
    root = np.sqrt(C.sum(axis=1) + 2 * J)
    return (C + J[:, None]) / root[:, None], root
