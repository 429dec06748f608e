"""Sparse Cholesky: multifrontal on a nested dissection, in BLAS and LAPACK.

Every front of the dissection is dense: its pivots L11, what couples them with its boundary, L21, and the update that
their elimination leaves there, C = sum of the children's - L21 L21^T. K's entries go to L11 and L21 in one pass, a
child's update goes to its parent's three parts by runs of neighbours: all indices are known from the pattern. Children
come right before their parents, so that updates are still in the processor's cache.

Nearly all fronts are small. A solution would spend its time on calling for each of them, so that it takes those of one
size on one level of the dissection, which do not meet, together; for that L11 is inverted once, which is as stable as
solving with it (Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., Sect. 14.2).
Sources: Duff and Reid (1983), ACM Trans. Math. Softw. 9:302; Liu (1992), SIAM Rev. 34:82.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import ClassVar, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import get_blas_funcs
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf, dtrtri

from mpmtop.arrays import Array, Index, distinct
from mpmtop.solvers.checked import checked_factor
from mpmtop.solvers.dissection import Fronts, dissect
from mpmtop.solvers.pattern import Pattern, SingularMatrix, Solve

LEAF = 32
"""Nodes that are not dissected further: less, and Python's share grows, more, and the zeros within do."""

INVERTED = 64
"""Pivots of the largest front whose L11 is inverted: a larger one is worth its own calls, and not the inversion."""

BY_INDEX = 256
"""Entries of an update that are added to the parent by index in the time of one slice: 200 to 400 were as fast."""

Runs = list[tuple[int, int, int, bool]]


class Front(NamedTuple):
    """One front, unknowns by their place in the order of elimination: those eliminated and the size of its boundary;
    where L11 and L21 begin among all values; its `parent` and the runs (start, stop, to, among pivots) of the boundary
    that are neighbours there, too, `to` being the first one's place among the parent's pivots or in its boundary. Of
    small updates in many runs the `places` instead, among the pivots and in the boundary."""

    first: int
    last: int
    boundary: int
    L11: int
    L21: int
    parent: int
    runs: Runs
    places: tuple[Index, Index] | None


class Alike(NamedTuple):
    """Fronts (k,) of one level and size: their `pivots` (k, ns) and `boundary` (k, nb), and where L11 and L21 of the
    first begin among all values; those of the others follow."""

    pivots: Index
    boundary: Index
    L11: int
    L21: int


class Level(NamedTuple):
    """Fronts of a level by size; what is left on the unknowns `reached` (r,) is what `spread` adds up of all
    boundaries."""

    groups: Sequence[Alike]
    reached: Index
    spread: sp.csr_array


class Analysis(NamedTuple):
    """What the pattern tells: unknowns in the order of elimination (m,), fronts and, the deepest first, levels, where
    each entry (nnz,) of the lower triangle goes among the values of all L11 and L21, and how many these are."""

    order: Index
    fronts: Sequence[Front]
    levels: Sequence[Level]
    place: Index
    size: int


Blocks = Sequence[tuple[Array, Array]]
"""L11 (ns, ns) and L21 (nb, ns) of every front."""


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
        first, node = _distinct(position)
        n = len(first)
        one, other = node[pattern.row], node[pattern.col]
        pair = distinct((np.minimum(one, other) * n + np.maximum(one, other))[one != other])
        return _analysis(pattern, node, dissect(position[first], *np.divmod(pair, n), LEAF))

    def factor(self, data: Array, tolerance: float | None = None) -> Solve:
        """Factorise; SingularMatrix if a pivot is not positive."""
        solve, pivot, diagonal = self.unchecked(data)
        return checked_factor(solve, diagonal, pivot / diagonal)

    def unchecked(self, data: Array, dtype: type[np.floating] = np.float64) -> tuple[Solve, Array, Array]:
        """Factorisation, its pivots and K's diagonal, (m,) each; SingularMatrix only where no pivot is left. L is kept,
        and solved with, in a `dtype`."""
        order, fronts, _, place, size = self.analysis
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
        for L11, _ in blocks:
            if len(L11) <= INVERTED:
                dtrtri(L11, lower=1, overwrite_c=1)
        return partial(_solve, self.analysis, values.astype(dtype, copy=False)), pivot, diagonal


def _distinct(position: Array) -> tuple[Index, Index]:
    """The first unknown (n,) at each position, these in lexical order, and which position each of the m is at.

    As `np.unique` along an axis, which compares rows byte by byte and takes several times as long.
    """
    order = np.lexsort(position.T[::-1])
    new = np.concatenate([[True], np.any(np.diff(position[order], axis=0) != 0, axis=1)])[: len(order)]
    of = np.empty_like(order)
    of[order] = np.cumsum(new) - 1
    return order[new], of


def _positions(pattern: Pattern) -> Array:
    if pattern.lattice is None:
        return np.arange(pattern.m, dtype=float)[:, None]
    return pattern.lattice.node * np.asarray(pattern.lattice.h)


def _blocks(values: Array, front: Front) -> tuple[Array, Array]:
    ns, nb = front.last - front.first, front.boundary
    L11 = values[front.L11 : front.L11 + ns * ns].reshape((ns, ns), order="F")
    return L11, values[front.L21 : front.L21 + ns * nb].reshape((nb, ns), order="F")


def _eliminate(fronts: Sequence[Front], blocks: Blocks) -> int | None:
    """Turn the blocks of K into those of L; the unknown, by its place in the order, that has no positive pivot."""
    updates: dict[int, Array] = {}  # of fronts that are still to come; dense lower triangles
    for k, (front, (L11, L21)) in enumerate(zip(fronts, blocks, strict=True)):
        failed = dpotrf(L11, lower=1, clean=0, overwrite_a=1)[1]
        if failed:
            return front.first + failed - 1
        nb = front.boundary
        if nb == 0:
            continue
        dtrsm(1.0, L11, L21, side=1, lower=1, trans_a=1, overwrite_b=1)
        update = updates.pop(k) if k in updates else np.zeros((nb, nb), order="F")
        dsyrk(-1.0, L21, beta=1.0, c=update, lower=1, overwrite_c=1)
        up11, up21 = blocks[front.parent]
        if front.parent not in updates:
            updates[front.parent] = np.zeros((len(up21),) * 2, order="F")
        _add(front, update, up11, up21, updates[front.parent])
    return None


def _add(front: Front, update: Array, up11: Array, up21: Array, up: Array) -> None:
    """Add the update (nb, nb) of a front to the three parts of its parent; above the diagonal all are zero."""
    if front.places is not None:
        pivots, around = front.places
        a, columns = len(pivots), update.T  # as they lie in memory
        up11.T[pivots[:, None], pivots] += columns[:a, :a]
        up21.T[pivots[:, None], around] += columns[:a, a:]
        up.T[around[:, None], around] += columns[a:, a:]
        return
    for j, (start, stop, to, column_among) in enumerate(front.runs):
        within = slice(to, to + stop - start)
        for above, below, at, among in front.runs[j:]:
            into = up if not column_among else up11 if among else up21
            part = into[at : at + below - above, within]  # named: `into[...] +=` would copy it onto itself
            part += update[above:below, start:stop]


def _solve(analysis: Analysis, values: Array, b: Array) -> Array:
    """K^-1 b for b (m,) or (m, k)."""
    order, levels = analysis.order, analysis.levels
    x = b.reshape(len(order), -1)[order].astype(values.dtype, copy=False)
    for groups, reached, spread in levels:
        left = []
        for group in groups:
            L11, L21 = _stacked(values, group)
            x[group.pivots] = y = _triangles(L11, x[group.pivots], transposed=False)
            left.append((L21 @ y).reshape(-1, x.shape[1]))
        x[reached] -= spread @ np.concatenate(left)
    for groups, *_ in reversed(levels):
        for group in groups:
            L11, L21 = _stacked(values, group)
            y = x[group.pivots] - L21.transpose(0, 2, 1) @ x[group.boundary]
            x[group.pivots] = _triangles(L11, y, transposed=True)
    u = np.empty_like(x)
    u[order] = x
    return u.reshape(b.shape)


def _stacked(values: Array, group: Alike) -> tuple[Array, Array]:
    """L11 (k, ns, ns) and L21 (k, nb, ns)."""
    (k, ns), nb = group.pivots.shape, group.boundary.shape[1]
    L11 = values[group.L11 : group.L11 + k * ns * ns].reshape(k, ns, ns)
    return L11.transpose(0, 2, 1), values[group.L21 : group.L21 + k * ns * nb].reshape(k, ns, nb).transpose(0, 2, 1)


def _triangles(L11: Array, b: Array, transposed: bool) -> Array:
    """L11^-1 b (k, ns, columns), or those of the transposes; L11^-1 is what there is of the small ones."""
    if L11.shape[1] <= INVERTED:
        return (L11.transpose(0, 2, 1) if transposed else L11) @ b
    trsv, trsm = get_blas_funcs(("trsv", "trsm"), dtype=L11.dtype)
    if b.shape[2] == 1:
        alone = [trsv(L, f[:, 0], lower=1, trans=transposed)[:, None] for L, f in zip(L11, b, strict=True)]
    else:  # f.T is as BLAS wants it
        alone = [trsm(1.0, L, f.T, side=1, lower=1, trans_a=not transposed).T for L, f in zip(L11, b, strict=True)]
    return np.stack(alone)


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
    levels, L11, L21, size = _by_size(nodes.level, first, boundary, start)
    key = np.repeat(np.arange(len(ns)), nb) * m + boundary  # sorted: finds an unknown in a front's boundary
    one, other = places[pattern.row], places[pattern.col]
    col, row = np.minimum(one, other), np.maximum(one, other)
    front = np.repeat(np.arange(len(ns)), ns)[col]
    place = L11[front] + (col - first[front]) * ns[front] + row - first[front]
    below = np.flatnonzero(row >= first[front + 1])
    k = front[below]
    among = np.searchsorted(key, k * m + row[below]) - start[k]
    place[below] = L21[k] + (col[below] - first[k]) * nb[k] + among
    runs = _runs(boundary, start, first, nodes.parent, key, m)
    ends_of = (part.tolist() for part in (first[:-1], first[1:], nb, L11, L21, nodes.parent))
    fronts = [
        Front(begins, last, b, at, below, parent, run, _places(run, b))
        for begins, last, b, at, below, parent, run in zip(*ends_of, runs, strict=True)
    ]
    return Analysis(order, fronts, levels, place, size)


def _by_size(level: Index, first: Index, boundary: Index, start: Index) -> tuple[list[Level], Index, Index, int]:
    """Levels, the deepest first, their fronts by size; where L11 and L21 of each front (f,) begin, and all values."""
    ns, nb = np.diff(first), np.diff(start)
    by_size = np.lexsort((nb, ns, -level))
    groups = np.split(by_size, np.flatnonzero(np.diff(np.stack([level, ns, nb])[:, by_size]).any(axis=0)) + 1)
    L11, L21 = np.empty_like(ns), np.empty_like(ns)
    by_level: dict[int, list[Alike]] = {}
    begin = 0
    for g in groups:
        s, b = int(ns[g[0]]), int(nb[g[0]])
        # of one group all L11, then all L21
        L11[g] = begin + np.arange(len(g)) * s * s
        L21[g] = begin + len(g) * s * s + np.arange(len(g)) * s * b
        pivots, around = first[g, None] + np.arange(s), boundary[start[g, None] + np.arange(b)]
        by_level.setdefault(int(level[g[0]]), []).append(Alike(pivots, around, begin, begin + len(g) * s * s))
        begin += len(g) * s * (s + b)
    return [_level(alike) for alike in by_level.values()], L11, L21, begin


def _level(groups: Sequence[Alike]) -> Level:
    boundary = np.concatenate([group.boundary.ravel() for group in groups])
    reached, to = np.unique(boundary, return_inverse=True)
    shape = len(reached), len(to)
    ones = np.ones(len(to), np.float32)  # which sum in the precision of what they multiply
    return Level(groups, reached, sp.csr_array((ones, (to, np.arange(len(to)))), shape=shape))


def _runs(boundary: Index, start: Index, first: Index, parent: Index, key: Index, m: int) -> list[Runs]:
    """The runs of every `Front`; `key` (boundaries,) is front * m + unknown, sorted."""
    f = len(parent)
    own = np.repeat(np.arange(f), np.diff(start))
    up = parent[own]  # whoever has a boundary has a parent
    among = boundary < first[up + 1]
    to = np.where(among, boundary - first[up], np.searchsorted(key, up * m + boundary) - start[up])
    follows = (np.diff(own) == 0) & (np.diff(to) == 1) & ~np.diff(among)
    head = np.flatnonzero(np.concatenate([[True], ~follows])[: len(own)])
    a, b = head - start[own[head]], np.append(head[1:], len(own)) - start[own[head]]
    runs: list[Runs] = [[] for _ in range(f)]
    for k, *run in zip(*(part.tolist() for part in (own[head], a, b, to[head], among[head])), strict=True):
        runs[k].append(tuple(run))
    return runs


def _places(runs: Runs, boundary: int) -> tuple[Index, Index] | None:
    """The `places` of a `Front` of so many in its boundary, None where runs are quicker."""
    if boundary**2 >= BY_INDEX * len(runs) * (len(runs) + 1) // 2:
        return None
    of = [(np.arange(to, to + stop - start), among) for start, stop, to, among in runs]
    pivots, around = ([at for at, among in of if among is which] for which in (True, False))
    return np.concatenate([np.empty(0, np.intp), *pivots]), np.concatenate([np.empty(0, np.intp), *around])
