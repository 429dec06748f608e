"""Stiffness: K(E) = sum_p E_p V_p B_p^T D B_p, and a ghost penalty's part, on a fixed sparsity pattern.

K is linear in the point moduli, so its entries are the product of a map built once with them. Only the lower triangle
between free degrees of freedom is kept; held and untouched ones never exist.

The map is built by cells, sets of points on the same nodes: a cell's place in the pattern is found once for all of its
points. Points that lie alike in cells of one size have one matrix B_p^T D B_p, so on a lattice only a few are distinct
and each of them is stored once. Of points that all differ the same map is smaller as one sparse matrix, and kept so.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array, Index, Mask, distinct
from mpmtop.ghost import GhostPenalty
from mpmtop.grid import Grid
from mpmtop.points import MaterialPoints
from mpmtop.ties import Ties
from mpmtop.transfer import Transfer
from mpmtop.voigt import local_B

CELLS_AT_ONCE = 4096
"""Cells of a block: what it computes with stays in the processor's cache."""
SPARSE_ENTRY = 12
"""Bytes of a sparse matrix's entry, a double and the index of its column."""
ALIKE = 1e-11
"""Gradients and volumes, in units of the cell, that differ by no more are alike: the rounding of positions is below."""


@dataclass(frozen=True, eq=False)
class CellMap:
    """Map from moduli (p,) to entries (nnz,) by cells, sets of points on the same nodes.

    `point` (p,) are the points in the order of their cells, those of cell c from `start[c]` (c + 1,) on; `kind` (p,)
    tells which of the k distinct `local` matrices (k, t), lower triangles, is theirs. Cells are in the order of their
    first entries, and each block of CELLS_AT_ONCE adds to its `span` (blocks, 2) of the entries, from first to end:
    `place` (c, t) is where in there, and the end for what is held.
    """

    shape: tuple[int, int]
    point: Index
    start: Index
    kind: Index
    local: Array
    place: Index
    span: Index

    def __matmul__(self, moduli: Array) -> Array:
        result = np.zeros(self.shape[0])
        for block, (first, end) in enumerate(self.span):
            cells = slice(block * CELLS_AT_ONCE, (block + 1) * CELLS_AT_ONCE)
            start = self.start[cells.start : cells.stop + 1]
            points = slice(start[0], start[-1])
            by_kind = (moduli[self.point[points]], self.kind[points], start - start[0])
            matrices = sp.csr_array(by_kind, shape=(len(start) - 1, len(self.local))) @ self.local
            sums = np.bincount(self.place[cells].ravel(), matrices.ravel(), minlength=end - first)
            result[first:end] += sums[: end - first]
        return result

    def smaller(self) -> "CellMap | sp.csr_array":
        """This map, or the same as one sparse matrix: what takes less memory.

        On a lattice that is this one, by a factor of five. Where domains of GIMP cross the cells by different nodes it
        is the sparse one, which leaves out the nodes that a point does not touch, and is five times as fast there;
        elsewhere it takes 0.3 to 1 of this one's time (3,200 to 28,800 points).
        """
        products = np.diff(self.start) @ np.count_nonzero(self.entry < self.shape[0], axis=1)
        stored = self.local.nbytes + self.place.nbytes + self.kind.nbytes
        return self if stored <= products * SPARSE_ENTRY else self.tocsr()

    @property
    def entry(self) -> Index:
        """Where the matrices (c, t) of the cells go, nnz for what is held."""
        first, end = np.repeat(self.span, CELLS_AT_ONCE, axis=0)[: len(self.place)].T[:, :, None]
        return np.where(self.place < end - first, self.place + first, self.shape[0])

    def tocsr(self) -> sp.csr_array:
        """The same map as one sparse matrix (nnz, p)."""
        entry = np.repeat(self.entry, np.diff(self.start), axis=0)
        kept = entry < self.shape[0]
        point = np.broadcast_to(self.point[:, None], entry.shape)
        return sp.csr_array((self.local[self.kind][kept], (entry[kept], point[kept])), shape=self.shape)


@dataclass(frozen=True, eq=False)
class Stiffness:
    """Lower triangle of K in the numbering of the unknowns.

    `dof` (m,) is the degree of freedom (2 node + component, see `Transfer`) of each unknown; `row` >= `col` (nnz,) the
    pattern, exact zeros included, sorted by column; `maps` turn moduli (p,) into entries (nnz,), which add up, and
    springs add a `constant` (nnz,). `D` is the tangent at unit modulus that they were made of, (3, 3) or
    (p, 3, 3).
    """

    dof: Index
    row: Index
    col: Index
    maps: tuple[sp.csr_array | CellMap, ...]
    D: Array
    constant: Array | None = None

    def data(self, moduli: Array) -> Array:
        """Entries (nnz,) of the lower triangle for point moduli (p,)."""
        entries = sum((part @ moduli for part in self.maps[1:]), start=self.maps[0] @ moduli)
        return entries if self.constant is None else entries + self.constant

    @cached_property
    def data_map(self) -> sp.csr_array:
        """The map (nnz, p) as one sparse matrix, which no analysis needs; without the constant part."""
        parts = [part.tocsr() for part in self.maps]
        return sum(parts[1:], start=parts[0])


def narrow_order(grid: Grid, transfer: Transfer) -> Index:
    """Order (a,) of the active nodes that keeps the band of K narrow: by columns, rows or diagonals of the grid,
    whichever spreads a point's nodes least. Columns suit a long body, diagonals an L."""
    i, j = np.divmod(transfer.nodes, grid.nodes[1])

    def spread(order: Index) -> int:
        rank = np.argsort(order)[transfer.stencil]
        last = np.max(rank, axis=1, initial=0, where=transfer.touched)
        return int(np.max(last - np.min(rank, axis=1, initial=len(order), where=transfer.touched)))

    return min((np.lexsort((j, i)), np.lexsort((i, j)), np.lexsort((i, i - j)), np.lexsort((i, i + j))), key=spread)


def stiffness(
    grid: Grid, points: MaterialPoints, transfer: Transfer, D: Array, held: Mask, ghost: GhostPenalty, ties: Ties
) -> Stiffness:
    """Pattern and map of K, with tangent D (3, 3) or (p, 3, 3) at unit modulus, without the `held` (2a,) degrees of
    freedom."""
    order = narrow_order(grid, transfer)
    dof = (2 * order[:, None] + np.arange(2)).ravel()
    dof = dof[~held[dof]]
    unknown = np.full(len(held), -1)
    unknown[dof] = np.arange(len(dof))

    m = max(len(dof), 1)
    key, cells = _cell_map(grid, points, transfer, D, unknown, m)
    others = []
    if ghost.modulus.shape[0] > 0:
        others.append(_face_map(ghost, unknown, m))
    if ties.modulus.shape[0] > 0:
        others.append(_edge_map(ties, unknown, m))
    springs = _spring_map(ties, unknown, m) if ties.spring.shape[0] > 0 else None
    if others or springs is not None:
        own = key
        key = distinct(np.concatenate([own, *(keys for keys, _ in (*others, *([springs] if springs else ())))]))
        among = np.append(np.searchsorted(key, own), len(key))
        place, span = _in_blocks(among[cells.entry], len(key))
        cells = replace(cells, shape=(len(key), cells.shape[1]), place=place, span=span)
    maps = (cells.smaller(), *(_among(key, keys, part) for keys, part in others))
    constant = None if springs is None else _among(key, *springs).sum(axis=1)
    return Stiffness(dof, key % m, key // m, maps, D, constant)


def _local(grad_N: Array, b_bar: Array | None, volume: Array, D: Array) -> Array:
    """V_p B_p^T D B_p, (p, 2n, 2n), of points with gradients (p, n, 2), and B-bar's part (p, n, 2) of them if any, for
    one tangent D (3, 3) or those of the points (p, 3, 3)."""
    strain = local_B(grad_N, b_bar).reshape(len(grad_N), D.shape[-1], -1)
    return np.einsum("pai,pab,pbj->pij", strain, volume[:, None, None] * D, strain, optimize=True)


def _local_unknown(stencil: Index, touched: Mask, unknown: Index) -> Index:
    """Unknowns (c, 2n) on stencils (c, n), -1 where held or not touched."""
    local = unknown[2 * stencil[:, :, None] + np.arange(2)]
    local[~touched] = -1
    return local.reshape(len(stencil), -1)


def _cell_map(
    grid: Grid, points: MaterialPoints, transfer: Transfer, D: Array, unknown: Index, m: int
) -> tuple[Index, CellMap]:
    """Keys column * m + row (nnz,), sorted, of the points' entries of the lower triangle, and their map.

    Every distinct local matrix is that of the first point of its kind, with this point's own gradients: it is free of
    energy under rigid motion to the last bit, as the others are.
    """
    p, n = transfer.touched.shape
    n_max = int(np.max(np.count_nonzero(transfer.touched, axis=1)))
    # a stencil is told by its first node and which of the others are touched: it is a rectangle of known size
    used = np.argsort(~transfer.touched, axis=1, kind="stable")[:, :n_max]
    first = transfer.stencil[np.arange(p), np.argmax(transfer.touched, axis=1)]
    pattern = transfer.touched @ (1 << np.arange(n))
    _, of_cell, cell = np.unique(first << n | pattern, return_index=True, return_inverse=True)
    kind_point, kind = _kinds(grid, points, transfer, D)

    a, b = np.tril_indices(2 * n_max)
    of_kind = kind_point[:, None], used[kind_point]
    b_bar = None if transfer.b_bar is None else transfer.b_bar[of_kind]
    of_points = D if D.ndim == 2 else D[kind_point]
    local = _local(transfer.grad_N[of_kind], b_bar, points.volume[kind_point], of_points)[:, a, b]
    nodes = of_cell[:, None], used[of_cell]
    local_unknown = _local_unknown(transfer.stencil[nodes], transfer.touched[nodes], unknown)
    one, other = local_unknown[:, a], local_unknown[:, b]
    held = np.minimum(one, other) < 0
    lower = np.where(held, np.iinfo(np.intp).max, np.minimum(one, other) * m + np.maximum(one, other))
    key, entry = np.unique(lower, return_inverse=True)
    if np.any(held):
        key = key[:-1]
    entry = entry.reshape(lower.shape)
    order = np.argsort(entry.min(axis=1), kind="stable")
    by_cell = np.argsort(np.argsort(order)[cell], kind="stable")
    start = np.concatenate([[0], np.cumsum(np.bincount(cell)[order])])
    place, span = _in_blocks(entry[order], len(key))
    # the matrices in the order in which they are read: of points all different that is four times as fast
    kind = kind[by_cell]
    as_read = np.argsort(np.unique(kind, return_index=True)[1])
    kind, local = np.argsort(as_read)[kind], local[as_read]
    return key, CellMap((len(key), p), by_cell, start, kind, local, place, span)


def _in_blocks(entry: Index, nnz: int) -> tuple[Index, Index]:
    """`place` and `span` of a `CellMap` whose matrices go to `entry` (c, t), nnz for what is held."""
    block = np.arange(0, len(entry), CELLS_AT_ONCE)
    first = np.minimum.reduceat(entry.min(axis=1), block)
    end = np.maximum.reduceat(np.max(entry + 1, axis=1, initial=0, where=entry < nnz), block)
    span = np.stack([first, np.maximum(first, end)], axis=1)
    first, end = np.repeat(span, CELLS_AT_ONCE, axis=0)[: len(entry)].T[:, :, None]
    return np.minimum(entry, end) - first, span


def _kinds(grid: Grid, points: MaterialPoints, transfer: Transfer, D: Array) -> tuple[Index, Index]:
    """One point (k,) of each kind, and the kind (p,) of every point: what its local matrix depends on is ALIKE.

    Kinds are told apart by one number, a sum with random weights, and compared in full afterwards; if two of a kind do
    differ, every point is a kind of its own.
    """
    p = len(points.volume)
    # points that touch different nodes are not alike, whatever the gradients there: a hair at a cut, or none with B-bar
    parts = [(transfer.grad_N * grid.h).reshape(p, -1), points.volume[:, None] / np.prod(grid.h), transfer.touched]
    if transfer.b_bar is not None:
        parts.append((transfer.b_bar * grid.h).reshape(p, -1))
    if D.ndim == 3:
        parts.append(D.reshape(p, -1))
    features = np.concatenate(parts, axis=1)
    weights = np.random.default_rng(0).uniform(0.5, 1, features.shape[1])
    _, first, kind = np.unique(np.rint(features @ (weights / ALIKE)), return_index=True, return_inverse=True)
    if np.all(np.abs(features - features[first[kind]]) <= 10 * ALIKE):
        return first, kind
    return np.arange(p), np.arange(p)


def _face_map(ghost: GhostPenalty, unknown: Index, m: int) -> tuple[Index, sp.csr_array]:
    """Keys and map (nnz, p) of the ghost penalty's entries."""
    # each row of the jump is an element of six nodes, once for each component, with half of a face's energy
    node, jump = ghost.jump.indices.reshape(-1, 6), ghost.jump.data.reshape(-1, 6)
    face_unknown = unknown[2 * node[:, None, :] + np.arange(2)[:, None]].reshape(-1, 6)
    face_local = np.repeat(jump[:, :, None] * jump[:, None, :], 2, axis=0)
    key, face_map = _lower_triangle(face_unknown, face_local, m)
    return key, face_map @ ghost.modulus[np.repeat(np.arange(ghost.modulus.shape[0]), 4)]


def _edge_map(ties: Ties, unknown: Index, m: int) -> tuple[Index, sp.csr_array]:
    """Keys and map (nnz, p) of the entries of supports along the outline."""
    both = sp.csr_array(abs(ties.hold) + abs(ties.pull))
    column, (hold, pull) = _by_row(both, ties.hold, ties.pull)
    crossed = hold[:, :, None] * pull[:, None, :]
    local = ties.penalty[:, None, None] * hold[:, :, None] * hold[:, None, :] - crossed - crossed.swapaxes(1, 2)
    key, edge_map = _lower_triangle(np.where(column >= 0, unknown[column], -1), local, m)
    return key, edge_map @ ties.modulus


def _spring_map(ties: Ties, unknown: Index, m: int) -> tuple[Index, sp.csr_array]:
    """Keys and map (nnz, s) of the springs' entries."""
    column, (spring,) = _by_row(ties.spring, ties.spring)
    return _lower_triangle(np.where(column >= 0, unknown[column], -1), spring[:, :, None] * spring[:, None, :], m)


def _by_row(pattern: sp.csr_array, *matrices: sp.csr_array) -> tuple[Index, list[Array]]:
    """Columns (r, k) of the rows of a pattern, -1 beyond their number, and entries (r, k) of matrices there."""
    count = np.diff(pattern.indptr)
    place = np.repeat(np.arange(len(count)), count), np.arange(pattern.nnz) - np.repeat(pattern.indptr[:-1], count)
    column = np.full((len(count), count.max()), -1)
    column[place] = pattern.indices
    found = []
    for matrix in matrices:
        entries = np.zeros(column.shape)
        entries[place] = np.asarray(matrix[place[0], pattern.indices]).ravel()
        found.append(entries)
    return column, found


def _lower_triangle(unknown: Index, local: Array, m: int) -> tuple[Index, sp.csr_array]:
    """Keys column * m + row (nnz,), sorted, of the lower triangle of matrices (e, k, k) between unknowns (e, k), -1
    where held, and the sum of the e matrices as a map (nnz, e)."""
    row, col = np.broadcast_arrays(unknown[:, :, None], unknown[:, None, :])
    kept = (row >= col) & (col >= 0)
    key, entry = np.unique(col[kept] * m + row[kept], return_inverse=True)
    return key, sp.csr_array((local[kept], (entry, np.nonzero(kept)[0])), shape=(len(key), len(local)))


def _among(all_keys: Index, keys: Index, rows: sp.csr_array) -> sp.csr_array:
    """The rows of `keys` at their places among those of `all_keys`, both sorted; zero elsewhere."""
    place = (np.ones(len(keys)), (np.searchsorted(all_keys, keys), np.arange(len(keys))))
    return sp.csr_array(place, shape=(len(all_keys), len(keys))) @ rows
