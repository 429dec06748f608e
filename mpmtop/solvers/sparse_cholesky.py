"""Sparse Cholesky: multifrontal on a nested dissection, in BLAS and LAPACK.

Every front of the dissection is dense: its pivots L11, what couples them with its boundary, L21, and the update that
their elimination leaves there, C = sum of the children's - L21 L21^T. K's entries go to L11 and L21 in one pass, a
child's update goes to its parent's three parts by runs of neighbours: all indices are known from the pattern.
Sources: Duff and Reid (1983), ACM Trans. Math. Softw. 9:302; Liu (1992), SIAM Rev. 34:82.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.linalg.blas import dsyrk, dtrsm, dtrsv
from scipy.linalg.lapack import dpotrf

from mpmtop.arrays import Array, Index
from mpmtop.solvers.checked import checked_factor
from mpmtop.solvers.dissection import Fronts, dissect
from mpmtop.solvers.pattern import Pattern, SingularMatrix, Solve

LEAF = 32
"""Nodes that are not dissected further: less, and Python's share grows, more, and the zeros within do."""


class Front(NamedTuple):
    """One front, unknowns by their place in the order of elimination: those eliminated, the `boundary` (nb,), and
    where L11 and L21 begin among all values; its `parent` and the runs (start, stop, to, among pivots) of the boundary
    that are neighbours there, too, `to` being the first one's place among the parent's pivots or in its boundary."""

    first: int
    last: int
    boundary: Index
    begin: int
    parent: int
    runs: list[tuple[int, int, int, bool]]


class Analysis(NamedTuple):
    """What the pattern tells: unknowns in the order of elimination (m,), fronts, where each entry (nnz,) of the lower
    triangle goes among the values of all L11 and L21, and how many these are."""

    order: Index
    fronts: Sequence[Front]
    place: Index
    size: int


Blocks = Sequence[tuple[Array, Array]]
"""L11 (ns, ns), of which the upper triangle means nothing, and L21 (nb, ns) of every front."""


@dataclass(frozen=True, eq=False)
class SparseCholesky:
    """Multifrontal Cholesky; unknowns at one `position` (m, d) are eliminated together.

    Positions are those of the lattice unless given, and without either the unknowns' numbers, which is right for any
    matrix and as good as a band.
    """

    pattern: Pattern
    position: Array | None = None
    tolerance: ClassVar[float] = 1e-9

    @cached_property
    def analysis(self) -> Analysis:
        """Order, fronts and places, once for a pattern."""
        pattern = self.pattern
        position = _positions(pattern) if self.position is None else self.position
        _, first, node = np.unique(position, axis=0, return_index=True, return_inverse=True)
        node, n = node.ravel(), len(first)
        one, other = node[pattern.row], node[pattern.col]
        pair = np.unique((np.minimum(one, other) * n + np.maximum(one, other))[one != other])
        return _analysis(pattern, node, dissect(position[first], *np.divmod(pair, n), LEAF))

    def factor(self, data: Array, tolerance: float | None = None) -> Solve:
        """Factorise; SingularMatrix if a pivot is not positive."""
        solve, pivot, diagonal = self.unchecked(data)
        return checked_factor(solve, diagonal, pivot / diagonal)

    def unchecked(self, data: Array) -> tuple[Solve, Array, Array]:
        """Factorisation, its pivots and K's diagonal, (m,) each; SingularMatrix only where no pivot is left."""
        order, fronts, place, size = self.analysis
        values = np.zeros(size)
        values[place] = data
        blocks = [_blocks(values, front) for front in fronts]
        diagonal, pivot = np.empty(self.pattern.m), np.empty(self.pattern.m)
        diagonal[order] = np.concatenate([L11.diagonal() for L11, _ in blocks])
        if np.min(diagonal) <= 0:
            raise SingularMatrix(int(np.argmin(diagonal)))
        failed = _eliminate(fronts, blocks)
        if failed is not None:
            raise SingularMatrix(int(order[failed]))
        pivot[order] = np.concatenate([L11.diagonal() for L11, _ in blocks]) ** 2
        return partial(_solve, self.analysis, blocks), pivot, diagonal


def _positions(pattern: Pattern) -> Array:
    if pattern.lattice is None:
        return np.arange(pattern.m, dtype=float)[:, None]
    return pattern.lattice.node * np.asarray(pattern.lattice.h)


def _blocks(values: Array, front: Front) -> tuple[Array, Array]:
    ns, nb = front.last - front.first, len(front.boundary)
    middle, end = front.begin + ns * ns, front.begin + ns * (ns + nb)
    L11 = values[front.begin : middle].reshape((ns, ns), order="F")
    return L11, values[middle:end].reshape((nb, ns), order="F")


def _eliminate(fronts: Sequence[Front], blocks: Blocks) -> int | None:
    """Turn the blocks of K into those of L; the unknown, by its place in the order, that has no positive pivot."""
    updates: dict[int, Array] = {}  # of fronts that are still to come; dense lower triangles
    for k, ((first, _, boundary, _, parent, runs), (L11, L21)) in enumerate(zip(fronts, blocks, strict=True)):
        failed = dpotrf(L11, lower=1, clean=0, overwrite_a=1)[1]
        if failed:
            return first + failed - 1
        if len(boundary) == 0:
            continue
        dtrsm(1.0, L11, L21, side=1, lower=1, trans_a=1, overwrite_b=1)
        update = updates.pop(k) if k in updates else np.zeros((len(boundary),) * 2, order="F")
        dsyrk(-1.0, L21, beta=1.0, c=update, lower=1, overwrite_c=1)
        up11, up21 = blocks[parent]
        if parent not in updates and len(up21) > 0:
            updates[parent] = np.zeros((len(up21),) * 2, order="F")
        for j, (start, stop, to, column_among) in enumerate(runs):
            columns = slice(to, to + stop - start)
            for above, below, at, among in runs[j:]:
                into = updates[parent] if not column_among else up11 if among else up21
                into[at : at + below - above, columns] += update[above:below, start:stop]
    return None


def _solve(analysis: Analysis, blocks: Blocks, b: Array) -> Array:
    """K^-1 b for b (m,) or (m, k)."""
    order, fronts = analysis.order, analysis.fronts
    x = b[order].astype(float, copy=False)
    for (first, last, boundary, *_), (L11, L21) in zip(fronts, blocks, strict=True):
        x[first:last] = y = _triangle(L11, x[first:last], transposed=False)
        if len(boundary) > 0:
            x[boundary] -= L21 @ y
    for (first, last, boundary, *_), (L11, L21) in zip(reversed(fronts), reversed(blocks), strict=True):
        y = x[first:last] - L21.T @ x[boundary] if len(boundary) > 0 else x[first:last]
        x[first:last] = _triangle(L11, y, transposed=True)
    u = np.empty_like(x)
    u[order] = x
    return u


def _triangle(L11: Array, b: Array, transposed: bool) -> Array:
    """L11^-1 b, or that of its transpose."""
    if b.ndim == 1:
        return dtrsv(L11, b, lower=1, trans=transposed)
    return dtrsm(1.0, L11, b.T, side=1, lower=1, trans_a=not transposed).T  # b.T is as BLAS wants it


def _analysis(pattern: Pattern, node: Index, nodes: Fronts) -> Analysis:
    """From fronts of nodes to fronts of the unknowns, which are at the `node` (m,)."""
    n, m = len(nodes.order), pattern.m
    rank = np.empty(n, dtype=np.intp)
    rank[nodes.order] = np.arange(n)
    order = np.argsort(rank[node], kind="stable")
    places = np.empty(m, dtype=np.intp)
    places[order] = np.arange(m)
    count = np.bincount(rank[node], minlength=n)
    offset = np.concatenate([[0], np.cumsum(count)])
    first = offset[nodes.first]
    ends = np.concatenate([[0], np.cumsum(count[nodes.boundary])])
    boundary = np.repeat(offset[nodes.boundary] - ends[:-1], count[nodes.boundary]) + np.arange(ends[-1])
    start = ends[nodes.start]

    ns, nb = np.diff(first), np.diff(start)
    begin = np.concatenate([[0], np.cumsum(ns * (ns + nb))])
    key = np.repeat(np.arange(len(ns)), nb) * m + boundary  # sorted: finds an unknown in a front's boundary
    one, other = places[pattern.row], places[pattern.col]
    col, row = np.minimum(one, other), np.maximum(one, other)
    front = np.repeat(np.arange(len(ns)), ns)[col]
    place = begin[front] + (col - first[front]) * ns[front] + row - first[front]
    below = np.flatnonzero(row >= first[front + 1])
    k = front[below]
    among = np.searchsorted(key, k * m + row[below]) - start[k]
    place[below] = begin[k] + ns[k] ** 2 + (col[below] - first[k]) * nb[k] + among
    runs = _runs(boundary, start, first, nodes.parent, key, m)
    ends_of = (part.tolist() for part in (first[:-1], first[1:], start[:-1], start[1:], begin[:-1], nodes.parent))
    fronts = [
        Front(begins, last, boundary[a:b], at, parent, run)
        for begins, last, a, b, at, parent, run in zip(*ends_of, runs, strict=True)
    ]
    return Analysis(order, fronts, place, int(begin[-1]))


def _runs(
    boundary: Index, start: Index, first: Index, parent: Index, key: Index, m: int
) -> list[list[tuple[int, int, int, bool]]]:
    """The runs of every `Front`; `key` (boundaries,) is front * m + unknown, sorted."""
    f = len(parent)
    own = np.repeat(np.arange(f), np.diff(start))
    up = parent[own]  # whoever has a boundary has a parent
    among = boundary < first[up + 1]
    to = np.where(among, boundary - first[up], np.searchsorted(key, up * m + boundary) - start[up])
    follows = (np.diff(own) == 0) & (np.diff(to) == 1) & ~np.diff(among)
    head = np.flatnonzero(np.concatenate([[True], ~follows])[: len(own)])
    a, b = head - start[own[head]], np.append(head[1:], len(own)) - start[own[head]]
    runs: list[list[tuple[int, int, int, bool]]] = [[] for _ in range(f)]
    for k, *run in zip(*(part.tolist() for part in (own[head], a, b, to[head], among[head])), strict=True):
        runs[k].append(tuple(run))
    return runs
