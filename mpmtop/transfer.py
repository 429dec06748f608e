"""Transfer between material points and grid nodes: N and B as sparse operators, built once.

    p2g   f_i = sum_p N_ip f_p     N.T @ f
    g2p   u_p = sum_i N_ip u_i     N @ u
    strain, Voigt (xx, yy, 2 xy)   eps_p = B u

Degrees of freedom are numbered 2 node + component over the nodes that some point touches; others do not exist.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from mpmtop.arrays import Array, Index, Mask
from mpmtop.errors import PositionOutsideBody
from mpmtop.grid import Grid
from mpmtop.points import MaterialPoints
from mpmtop.shape_functions import Ends, ShapeFunction, gimp, stencil
from mpmtop.voigt import entries, local_B

REACH = 1.0
"""Cells from which a position on the outline may take its functions: a corner of a body on stairs is less than the
diagonal of a cell off its points' cells, with two points per cell or more."""
NEAREST = 16
"""Cells of which one is the nearest to a position at most REACH away."""
INSIDE = 1e-10
"""Of a cell: functions are continued from this far inside, not from its edge, where their gradient is the next cell's.
It is above the rounding of positions, and what it changes is below that of a solve."""


@dataclass(frozen=True, eq=False)
class Transfer:
    """Weights of every point on its n stencil nodes, and the operators made of them.

    `nodes` (a,) are the active grid nodes; `stencil` (p, n) the positions in `nodes` of each point's nodes, valid where
    `touched` (p, n); N (p, n) and grad_N (p, n, 2) [1/length] their weights; `N_matrix` (p, a) and `B` (3p, 2a).
    `b_bar` (p, n, 2) [1/length] is what a mean dilatation, see `mpmtop.b_bar`, adds to both normal strains; else None.
    """

    nodes: Index
    stencil: Index
    touched: Mask
    N: Array
    grad_N: Array
    N_matrix: sp.csr_array
    B: sp.csr_array
    b_bar: Array | None = None

    def interpolate(self, nodal: Array) -> Array:
        """g2p of a nodal vector field (2a,): (p, 2)."""
        return self.N_matrix @ nodal.reshape(-1, 2)

    def strain(self, u: Array) -> Array:
        """Strains (p, 3), Voigt with engineering shear, of nodal displacements u (2a,)."""
        return (self.B @ u).reshape(-1, 3)


def located(grid: Grid, x: Array) -> tuple[Array, Index, float]:
    """Positions x (p, 2) in units of cells, the half-open cells (p, 2) that hold them, and the tolerance [cells] to
    which a position is on a grid line."""
    xi = grid.cell_coordinates(x)
    # what forming xi from x and the origin can lose, and never less than a test by hand would call equal
    largest = max(float(np.max(np.abs(x), initial=0.0)), *map(abs, grid.origin))
    tol = max(1e-12, 8 * np.finfo(float).eps * largest / min(grid.h))
    return xi, np.floor(xi + tol).astype(int), tol


def body_ends(grid: Grid, points: MaterialPoints) -> tuple[Ends, Ends]:
    """The body's ends along each axis: those of the outermost cells that hold a point."""
    cell = located(grid, points.x)[1]
    (i0, j0), (i1, j1) = cell.min(axis=0), cell.max(axis=0) + 1
    return (int(i0), int(i1)), (int(j0), int(j1))


def weights(
    grid: Grid, x: Array, half_length: Array, shape_function: ShapeFunction, ends: tuple[Ends, Ends]
) -> tuple[Index, Mask, Array, Array]:
    """Grid nodes (p, n), whether touched (p, n), N (p, n) and grad_N (p, n, 2) [1/length] of the stencil of every
    position x (p, 2) with a domain of half_length (p, 2), in a body of the given ends."""
    xi, _, tol = located(grid, x)
    length = half_length / grid.h
    sx, sy = (stencil(shape_function, xi[:, a], length[:, a], tol, ends[a]) for a in (0, 1))
    hx, hy = grid.h
    n = sx.N.shape[1]

    def product(a: Array, b: Array) -> Array:
        return (a[:, :, None] * b[:, None, :]).reshape(len(xi), n * n)

    N = product(sx.N, sy.N)
    grad_N = np.stack([product(sx.grad_N / hx, sy.N), product(sx.N, sy.grad_N / hy)], axis=-1)
    touched = (N != 0) | np.any(grad_N != 0, axis=-1)
    i = np.repeat(sx.first[:, None] + np.arange(n), n, axis=1)
    j = np.tile(sy.first[:, None] + np.arange(n), (1, n))
    nodes = np.zeros(touched.shape, np.intp)
    nodes[touched] = grid.node_index(i[touched], j[touched])
    return nodes, touched, N, grad_N


def transfer(grid: Grid, points: MaterialPoints, shape_function: ShapeFunction, ends: tuple[Ends, Ends]) -> Transfer:
    """Operators of `points` on `grid`. A point whose stencil leaves the grid raises PointOutsideGrid."""
    node, touched, N, grad_N = weights(grid, points.x, points.half_length, shape_function, ends)
    active, inverse = np.unique(node[touched], return_inverse=True)
    stencil = np.zeros_like(node)
    stencil[touched] = inverse
    return Transfer(active, stencil, touched, N, grad_N, *operators(stencil, touched, N, grad_N, len(active)))


def operators(
    stencil: Index, touched: Mask, N: Array, grad_N: Array, a: int, b_bar: Array | None = None
) -> tuple[sp.csr_array, sp.csr_array]:
    """N (p, a) and B (3p, 2a) of weights on stencils (p, n) among a nodes; see `mpmtop.voigt` for the order of rows."""
    B, d = local_B(grad_N, b_bar), grad_N.shape[-1]
    stored = touched[:, None, :, None] & entries(d, b_bar is not None)[:, None, :]
    column = np.broadcast_to((d * stencil[:, :, None] + np.arange(d))[:, None], B.shape)
    return _rows(N, touched, stencil, a), _rows(B, stored, column, d * a)


class Functions(NamedTuple):
    """Functions at k positions: u = N u (k, 2) for nodal u (a, 2), and strains B u (3k,) for u (2a,)."""

    N: sp.csr_array
    B: sp.csr_array

    def displacement(self, u: Array) -> Array:
        """(k, 2), of nodal displacements u (2a,)."""
        return self.N @ u.reshape(-1, 2)

    def strain(self, u: Array) -> Array:
        """(k, 3), Voigt with engineering shear, of nodal displacements u (2a,)."""
        return (self.B @ u).reshape(-1, 3)

    def force(self, forces: Array) -> Array:
        """Nodal forces (2a,) of forces (k, 2) at the positions."""
        return (self.N.T @ forces).ravel()


def functions_at(
    grid: Grid,
    nodes: Index,
    shape_function: ShapeFunction,
    ends: tuple[Ends, Ends],
    x: Array,
    half_length: Array | float = 0.0,
) -> Functions:
    """The functions of the active `nodes` (a,) at positions x (k, 2), as at points with domains of `half_length` there.

    On the body's last grid line they are those of the cell inside. PositionOutsideBody where one has another node.
    """
    x = np.asarray(x, float).reshape(-1, 2)
    xi, _, tol = located(grid, x)
    first, last = np.transpose(ends)
    inside = np.all((xi >= first - tol) & (xi <= last + tol), axis=1)
    length = np.broadcast_to(np.asarray(half_length, float), x.shape)
    node, touched, N, grad_N = weights(grid, x[inside], length[inside], shape_function, ends)
    stencil = np.minimum(np.searchsorted(nodes, node), len(nodes) - 1)
    inside[inside] = np.all((nodes[stencil] == node) | ~touched, axis=1)
    if not np.all(inside):
        raise PositionOutsideBody(
            f"position {tuple(x[~inside][0].tolist())}: no material point touches its nodes; move it inwards"
        )
    return Functions(*operators(stencil, touched, N, grad_N, len(nodes)))


class Near(NamedTuple):
    """Functions at k positions on the body's outline, and the cell (k, 2) that they are of, which holds a point."""

    functions: Functions
    cell: Index


def functions_near(
    grid: Grid,
    points: MaterialPoints,
    nodes: Index,
    shape_function: ShapeFunction,
    x: Array,
) -> Near:
    """The functions of the active `nodes` (a,) at positions x (k, 2) of the outline, which the points' cells need not
    reach: that of a curved body runs through cells without a point, and along the edge of others.

    A position there takes the functions of the nearest cell that holds a point, or with GIMP a part of its domain,
    continued linearly from its nearest position x0: N(x0) + grad N(x0) . (x - x0). They still sum to one and reproduce
    linear fields, so that forces keep their resultant and their moment. PositionOutsideBody if that cell is further
    than REACH cells.
    """
    x = np.asarray(x, float)
    xi, cell, _ = located(grid, x)
    held = _cells_of(grid, points, shape_function)
    (i0, j0), (i1, j1) = held.min(axis=0), held.max(axis=0) + 1
    ends = (int(i0), int(i1)), (int(j0), int(j1))
    row = grid.nodes[1]
    beyond = np.flatnonzero(~np.isin(cell @ [row, 1], held @ [row, 1]))
    if len(beyond):
        # the box nearest to a position is among those of the nearest centres, up to REACH away
        near = cKDTree(held + 0.5).query(xi[beyond], k=np.arange(1, min(NEAREST, len(held)) + 1))[1]
        apart = np.maximum(np.abs(xi[beyond, None] - held[near] - 0.5) - 0.5, 0) * np.divide(grid.h, max(grid.h))
        distance = np.hypot(*np.moveaxis(apart, -1, 0))
        first = np.argmin(distance, axis=1)
        if np.any(distance.min(axis=1) > REACH):
            x_far = x[beyond][np.argmax(distance.min(axis=1))]
            raise PositionOutsideBody(
                f"position {tuple(x_far.tolist())} of the outline: no material point within {REACH:g} cells of it"
            )
        cell[beyond] = held[near[np.arange(len(beyond)), first]]
    x0 = x.copy()
    from_ = np.clip(xi[beyond], cell[beyond] + INSIDE, cell[beyond] + 1 - INSIDE)
    x0[beyond] = from_ * grid.h + grid.origin
    no_domain = np.zeros_like(x)
    node, touched, N, grad_N = weights(grid, x0, no_domain, shape_function, ends)
    stencil = np.minimum(np.searchsorted(nodes, node), len(nodes) - 1)
    alone = ~np.all((nodes[stencil] == node) | ~touched, axis=1)
    if np.any(alone):  # pieces of a quadratic are not the cells: one may hold no point in a cell that does
        x0[alone] = points.x[cKDTree(points.x / grid.h).query(x[alone] / grid.h)[1]]
        node, touched, N, grad_N = weights(grid, x0, no_domain, shape_function, ends)
        stencil = np.searchsorted(nodes, node)
    N = N + np.einsum("pnk,pk->pn", grad_N, x - x0)
    stencil = np.where(touched, stencil, 0)
    return Near(Functions(*operators(stencil, touched, N, grad_N, len(nodes))), cell)


def _cells_of(grid: Grid, points: MaterialPoints, shape_function: ShapeFunction) -> Index:
    """Cells (c, 2) that hold a point, or with GIMP a part of its domain: all functions there have their nodes."""
    if shape_function is not gimp:
        return np.unique(located(grid, points.x)[1], axis=0)
    # a hair inside the domain, as its edge may be a line of the grid
    reach = points.half_length - 1e-9 * np.asarray(grid.h)
    corners = [points.x + np.multiply(side, reach) for side in ((-1, -1), (-1, 1), (1, -1), (1, 1))]
    return np.unique(located(grid, np.concatenate(corners))[1], axis=0)


def _rows(values: Array, stored: Mask, column: Index, columns: int) -> sp.csr_array:
    """Sparse matrix of the values that are `stored`: one row (n,) for each point, or v rows (v, n, d) for each, along
    which the columns ascend; all of one shape."""
    count = np.count_nonzero(stored, axis=1 if stored.ndim == 2 else (2, 3)).ravel()
    start = np.concatenate([[0], np.cumsum(count)])
    return sp.csr_array((values[stored], column[stored], start), shape=(len(count), columns))
