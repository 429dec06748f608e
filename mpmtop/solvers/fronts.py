"""Fronts of a sparse Cholesky factorisation: from the nodes' dissection to the unknowns, and where everything goes.

They are eliminated one after the other, a front right after those that it is made of: what these leave is still in the
processor's cache. They are solved with together, those of one size on one level of the dissection, which do not meet:
their values are stored one behind the other.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array, Index
from mpmtop.solvers.dissection import Fronts
from mpmtop.solvers.pattern import Pattern

Runs = tuple[tuple[int, int, int, bool], ...]
"""Of a front's boundary, from start to stop: what are neighbours in its parent, too, the first one's place there, and
whether it is among the parent's pivots or in its boundary."""


UPDATE = 2


class Block(NamedTuple):
    """What a front passes on of its update, by columns: the part `of` it goes `into` the parent's L11 (0), L21 (1) or
    own update (UPDATE)."""

    part: int
    into: tuple[slice, slice]
    of: tuple[slice, slice]


class Front(NamedTuple):
    """A front to eliminate, `pivots` unknowns from the `first` on, by their place in the order of elimination, and the
    number of those in its `boundary`; where its values begin, L11 and behind it L21; the `entries` of K that go there,
    once they are sorted by fronts, and at which `place` (k,); and its children, by their number, with what they pass
    on."""

    first: int
    pivots: int
    boundary: int
    begin: int
    entries: slice
    place: Index
    children: Sequence[tuple[int, Sequence[Block]]]


class Alike(NamedTuple):
    """Fronts (k,) of one level and size: their `pivots`, k times ns unknowns in a row, and `boundary` (k, nb), by their
    place in the order of solution, and where the values of the first begin; those of the others follow."""

    pivots: slice
    boundary: Index
    begin: int

    def parts(self, values: Array) -> tuple[Array, Array]:
        """L11 (k, ns, ns) and L21 (k, nb, ns), which are stored by columns."""
        k, nb = self.boundary.shape
        ns = (self.pivots.stop - self.pivots.start) // k
        blocks = values[self.begin : self.begin + k * ns * (ns + nb)].reshape(k, -1)
        L11, L21 = blocks[:, : ns * ns].reshape(k, ns, ns), blocks[:, ns * ns :].reshape(k, ns, nb)
        return L11.transpose(0, 2, 1), L21.transpose(0, 2, 1)


class Level(NamedTuple):
    """Fronts of a level by size; what is left on the unknowns `reached` (r,) is what `spread` adds up of all
    boundaries."""

    groups: Sequence[Alike]
    reached: Index
    spread: sp.csr_array


class Analysis(NamedTuple):
    """What the pattern tells: unknowns in the order of elimination (m,), front by front, the deepest first, and in that
    of solution (m,), group by group; the entries (nnz,) of the lower triangle sorted by fronts; fronts in the order of
    elimination, children before parents, and by levels, the deepest first; and how many values all L11 and L21 have."""

    order: Index
    solved: Index
    by_front: Index
    fronts: Sequence[Front]
    levels: Sequence[Level]
    size: int

    def values(self, dtype: type[np.floating]) -> "Values":
        """Memory for those."""
        flat = np.empty(self.size, dtype)
        return Values(flat, [[(group, *group.parts(flat)) for group in level.groups] for level in self.levels])


class Values(NamedTuple):
    """Values of L, and by levels its groups, each with its L11 (k, ns, ns) and L21 (k, nb, ns) among them."""

    flat: Array
    levels: Sequence[Sequence[tuple[Alike, Array, Array]]]


def analyse(pattern: Pattern, node: Index, nodes: Fronts) -> Analysis:
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
    groups, begin = _by_size(nodes.level, ns, nb)
    key = np.repeat(np.arange(len(ns)), nb) * m + boundary  # sorted: finds an unknown in a front's boundary
    one, other = places[pattern.row], places[pattern.col]
    col, row = np.minimum(one, other), np.maximum(one, other)
    front = np.repeat(np.arange(len(ns)), ns)[col]
    place = (col - first[front]) * ns[front] + row - first[front]
    below = np.flatnonzero(row >= first[front + 1])
    k = front[below]
    among = np.searchsorted(key, k * m + row[below]) - start[k]
    place[below] = ns[k] * ns[k] + (col[below] - first[k]) * nb[k] + among
    by_front = np.argsort(front, kind="stable")
    place, entries = place[by_front], np.concatenate([[0], np.cumsum(np.bincount(front, minlength=len(ns)))])

    children = _children(nodes.parent, _runs(boundary, start, first, nodes.parent, key, m))
    whole = zip(*(part.tolist() for part in (first[:-1], ns, nb, begin, entries[:-1], entries[1:])), strict=True)
    fronts = [
        Front(i, s, b, at, slice(e, end), place[e:end], children[f]) for f, (i, s, b, at, e, end) in enumerate(whole)
    ]
    pivots = [first[g, None] + np.arange(ns[g[0]]) for g in groups]
    solved = np.concatenate([of.ravel() for of in pivots])
    places[solved] = np.arange(m)
    levels: dict[int, list[Alike]] = {}
    stop = np.cumsum([of.size for of in pivots])
    for g, of, end in zip(groups, pivots, stop.tolist(), strict=True):
        around = places[boundary[start[g, None] + np.arange(nb[g[0]])]]
        alike = Alike(slice(end - of.size, end), around, int(begin[g[0]]))
        levels.setdefault(int(nodes.level[g[0]]), []).append(alike)
    size = int(np.sum(ns * (ns + nb)))
    return Analysis(order, order[solved], by_front, fronts, [_level(alike) for alike in levels.values()], size)


def _by_size(level: Index, ns: Index, nb: Index) -> tuple[list[Index], Index]:
    """Fronts by level, the deepest first, and size, and where the values of each (f,) begin; ns, nb (f,) are their
    pivots and unknowns in the boundary."""
    by_size = np.lexsort((nb, ns, -level))
    groups = np.split(by_size, np.flatnonzero(np.diff(np.stack([level, ns, nb])[:, by_size]).any(axis=0)) + 1)
    size = (ns * (ns + nb))[by_size]
    begin = np.empty_like(ns)
    begin[by_size] = np.cumsum(size) - size
    return groups, begin


def _level(groups: Sequence[Alike]) -> Level:
    boundary = np.concatenate([group.boundary.ravel() for group in groups])
    reached, to = np.unique(boundary, return_inverse=True)
    shape = len(reached), len(to)
    ones = np.ones(len(to), np.float32)  # which sum in the precision of what they multiply
    return Level(groups, reached, sp.csr_array((ones, (to, np.arange(len(to)))), shape=shape))


def _runs(boundary: Index, start: Index, first: Index, parent: Index, key: Index, m: int) -> list[Runs]:
    """The runs of every front; `key` (boundaries,) is front * m + unknown, sorted."""
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
    return [tuple(each) for each in runs]


def _children(parent: Index, runs: Sequence[Runs]) -> list[list[tuple[int, Sequence[Block]]]]:
    """Of every front its children and what they pass on."""
    known: dict[Runs, Sequence[Block]] = {}
    children: list[list[tuple[int, Sequence[Block]]]] = [[] for _ in runs]
    for k, (up, of) in enumerate(zip(parent.tolist(), runs, strict=True)):
        if of:
            if of not in known:
                known[of] = _blocks(of)
            children[up].append((k, known[of]))
    return children


def _blocks(runs: Runs) -> Sequence[Block]:
    """The lower triangle of an update, by columns, cut into runs."""
    blocks = []
    for j, (start, stop, to, among_pivots) in enumerate(runs):
        for above, below, at, also in runs[j:]:
            into = slice(to, to + stop - start), slice(at, at + below - above)
            part = UPDATE if not among_pivots else 0 if also else 1
            blocks.append(Block(part, into, (slice(start, stop), slice(above, below))))
    return blocks
