"""Fronts of a sparse Cholesky factorisation: from the nodes' dissection to the unknowns, and where everything goes.

Fronts of one size on one level of the dissection do not meet: they are stored one behind the other, and what is done to
one of them is done to all at once. Most fronts of a lattice are alike in how they hang on their parents, too.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array, Index
from mpmtop.solvers.dissection import Fronts
from mpmtop.solvers.pattern import Pattern

BY_INDEX = 256
"""Entries of updates that are added to parents by index in the time of one slice: 200 to 400 were as fast."""

Runs = tuple[tuple[int, int, int, bool], ...]


class Passed(NamedTuple):
    """Updates that go to their parents alike: those of the fronts `own` (k,) of a group go to the fronts `parent` (k,)
    of group number `group`, no two of them to one.

    `runs` (start, stop, to, among pivots) are those of the boundary that are neighbours in the parent, too, `to` being
    the first one's place among the parent's pivots or in its boundary. Of small updates in many runs the `places`
    instead, among the pivots and in the boundary.
    """

    own: Index | slice
    group: int
    parent: Index | slice
    runs: Runs
    places: tuple[Index, Index] | None


class Alike(NamedTuple):
    """A group: fronts (k,) of one level and size, their `pivots` (k, ns) and `boundary` (k, nb), unknowns by their
    place in the order of elimination; where L11 and L21 of the first begin among all values, those of the others
    follow; and what becomes of the updates that their elimination leaves."""

    pivots: Index
    boundary: Index
    L11: int
    L21: int
    passed: Sequence[Passed]

    def columns(self, values: Array) -> tuple[Array, Array]:
        """L11 (k, ns, ns) and L21 (k, ns, nb) as they are stored, by columns."""
        (k, ns), nb = self.pivots.shape, self.boundary.shape[1]
        L11 = values[self.L11 : self.L11 + k * ns * ns].reshape(k, ns, ns)
        return L11, values[self.L21 : self.L21 + k * ns * nb].reshape(k, ns, nb)


class Level(NamedTuple):
    """Fronts of a level by size; what is left on the unknowns `reached` (r,) is what `spread` adds up of all
    boundaries."""

    groups: Sequence[Alike]
    reached: Index
    spread: sp.csr_array


class Analysis(NamedTuple):
    """What the pattern tells: unknowns in the order of elimination (m,), the deepest first, levels, where each entry
    (nnz,) of the lower triangle goes among the values of all L11 and L21, and how many these are.

    Groups are numbered in the order of the levels, so that a front's parent is in a later one.
    """

    order: Index
    levels: Sequence[Level]
    place: Index
    size: int


class Sizes(NamedTuple):
    """Fronts (f,) of each group; of each front the number (f,) of its group and its place (f,) there; where L11 and L21
    of each (f,) begin, and all values."""

    groups: Sequence[Index]
    number: Index
    among: Index
    L11: Index
    L21: Index
    size: int


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
    by = _by_size(nodes.level, ns, nb)
    key = np.repeat(np.arange(len(ns)), nb) * m + boundary  # sorted: finds an unknown in a front's boundary
    one, other = places[pattern.row], places[pattern.col]
    col, row = np.minimum(one, other), np.maximum(one, other)
    front = np.repeat(np.arange(len(ns)), ns)[col]
    place = by.L11[front] + (col - first[front]) * ns[front] + row - first[front]
    below = np.flatnonzero(row >= first[front + 1])
    k = front[below]
    among = np.searchsorted(key, k * m + row[below]) - start[k]
    place[below] = by.L21[k] + (col[below] - first[k]) * nb[k] + among

    passed = _passed(by, nodes.parent, _runs(boundary, start, first, nodes.parent, key, m))
    levels: dict[int, list[Alike]] = {}
    for number, g in enumerate(by.groups):
        pivots, around = first[g, None] + np.arange(ns[g[0]]), boundary[start[g, None] + np.arange(nb[g[0]])]
        begins = int(by.L11[g[0]]), int(by.L21[g[0]])
        levels.setdefault(int(nodes.level[g[0]]), []).append(Alike(pivots, around, *begins, passed[number]))
    return Analysis(order, [_level(alike) for alike in levels.values()], place, by.size)


def _by_size(level: Index, ns: Index, nb: Index) -> Sizes:
    """Fronts by level, the deepest first, and size; ns, nb (f,) are their pivots and unknowns in the boundary."""
    by_size = np.lexsort((nb, ns, -level))
    groups = np.split(by_size, np.flatnonzero(np.diff(np.stack([level, ns, nb])[:, by_size]).any(axis=0)) + 1)
    number, among, L11, L21 = (np.empty_like(ns) for _ in range(4))
    begin = 0
    for k, g in enumerate(groups):
        s, b = int(ns[g[0]]), int(nb[g[0]])
        number[g], among[g] = k, np.arange(len(g))
        # of one group all L11, then all L21
        L11[g] = begin + among[g] * s * s
        L21[g] = begin + len(g) * s * s + among[g] * s * b
        begin += len(g) * s * (s + b)
    return Sizes(groups, number, among, L11, L21, begin)


def _level(groups: Sequence[Alike]) -> Level:
    boundary = np.concatenate([group.boundary.ravel() for group in groups])
    reached, to = np.unique(boundary, return_inverse=True)
    shape = len(reached), len(to)
    ones = np.ones(len(to), np.float32)  # which sum in the precision of what they multiply
    return Level(groups, reached, sp.csr_array((ones, (to, np.arange(len(to)))), shape=shape))


def _runs(boundary: Index, start: Index, first: Index, parent: Index, key: Index, m: int) -> list[Runs]:
    """The runs of every front, see `Passed`; `key` (boundaries,) is front * m + unknown, sorted."""
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


def _passed(by: Sizes, parent: Index, runs: Sequence[Runs]) -> list[list[Passed]]:
    """By group, what becomes of updates: fronts of it that have the same runs, their parents in one group."""
    by_parent = np.argsort(parent, kind="stable")
    sibling = np.empty_like(parent)  # the how manieth child of its parent
    sibling[by_parent] = np.arange(len(parent)) - np.searchsorted(parent[by_parent], parent[by_parent])
    found: list[list[Passed]] = []
    for g in by.groups:
        alike: dict[tuple[int, int, Runs], list[int]] = {}
        for k in g.tolist():
            if runs[k]:
                alike.setdefault((int(by.number[parent[k]]), int(sibling[k]), runs[k]), []).append(k)
        found.append([])
        for (group, _, of), fronts in alike.items():
            own, to = by.among[fronts], by.among[parent[fronts]]
            places = _places(of, len(fronts))
            ends = (own, to) if places is not None else (_sliced(own), _sliced(to))
            found[-1].append(Passed(ends[0], group, ends[1], of, places))
    return found


def _sliced(index: Index) -> Index | slice:
    """The index (k,) as a slice, which copies nothing, if it rises in equal steps."""
    step = int(index[1] - index[0]) if len(index) > 1 else 1
    equal = step > 0 and np.array_equal(index, index[0] + step * np.arange(len(index)))
    return slice(int(index[0]), int(index[-1]) + 1, step) if equal else index


def _places(runs: Runs, fronts: int) -> tuple[Index, Index] | None:
    """The `places` of so many fronts with the same runs, None where runs are quicker."""
    if fronts * runs[-1][1] ** 2 >= BY_INDEX * len(runs) * (len(runs) + 1) // 2:
        return None
    of = [(np.arange(to, to + stop - start), among) for start, stop, to, among in runs]
    pivots, around = ([at for at, among in of if among is which] for which in (True, False))
    return np.concatenate([np.empty(0, np.intp), *pivots]), np.concatenate([np.empty(0, np.intp), *around])
