"""Nested dissection by position: the order of elimination of a sparse Cholesky factorisation, and its fronts.

A set of nodes is cut in two at the median of its longer extent; those beyond the cut that are coupled with a node
before it, or those before it where they are fewer (between the lines of biquadratic elements half as many), separate
the two halves and are eliminated after both (George 1973, SIAM J. Numer. Anal. 10:345). On a lattice
of n x n nodes that leaves O(n^2 log n) entries and O(n^3) operations. All sets of a level are cut at once.
"""

from typing import NamedTuple

import numpy as np

from mpmtop.arrays import Array, Index, distinct


class Fronts(NamedTuple):
    """Order of elimination of n nodes, and the f fronts they are eliminated in, children before parents.

    Nodes are named by their place in the order, `order` (n,) tells the node there. Front k eliminates
    `first[k]:first[k + 1]` (f + 1,) and couples them with its `boundary[start[k]:start[k + 1]]`, (f + 1,), later ones,
    sorted; `parent` (f,) is the front that eliminates the first of these, f where there is none. `level` (f,) counts
    the cuts above a front: a parent's is less than its children's.
    """

    order: Index
    first: Index
    boundary: Index
    start: Index
    parent: Index
    level: Index


def dissect(position: Array, one: Index, other: Index, leaf: int) -> Fronts:
    """Fronts for n nodes at `position` (n, d) coupled in pairs `one`, `other` (e,); sets of up to `leaf` stay whole."""
    level, index = _separators(position, one, other, leaf)
    depth = int(level.max(initial=0))
    # of the places at the deepest level that a set covers the last: children before parents, siblings side by side
    last = (index + 1) << (depth - level)
    of_front = np.unique(np.stack([last, -level]), axis=1, return_inverse=True)[1].ravel()
    along = _along(position, of_front)
    order = np.lexsort((*along, of_front))
    front = of_front[order]
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    first = np.searchsorted(front, np.arange(front[-1] + 2))
    one, other = np.minimum(rank[one], rank[other]), np.maximum(rank[one], rank[other])
    apart = front[one] != front[other]
    of_fronts = level[order][first[:-1]]
    boundary, start, parent = _boundaries(front, of_fronts, one[apart], other[apart])
    return Fronts(order, first, boundary, start, parent, of_fronts)


def _separators(position: Array, one: Index, other: Index, leaf: int) -> tuple[Index, Index]:
    """Level (n,) of the set that each node belongs to in the end, a separator or a leaf, and its index in the level."""
    n = len(position)
    level, index = np.zeros(n, dtype=np.intp), np.zeros(n, dtype=np.intp)
    active, part, depth = np.arange(n), np.zeros(n, dtype=np.intp), 0
    side, set_of = np.empty(n, dtype=np.int8), np.empty(n, dtype=np.intp)
    while True:
        level[active], index[active] = depth, part
        head, lower, upper = _sets(part, position[active])
        size = np.diff(head, append=len(part))
        cut_up = np.repeat((size > leaf) & np.any(upper > lower, axis=1), size)
        active, part = active[cut_up], part[cut_up]
        if len(active) == 0:
            return level, index
        head, lower, upper = _sets(part, position[active])
        of_set = np.repeat(np.arange(len(head)), np.diff(head, append=len(part)))
        axis = np.argmax(upper - lower, axis=1)
        along = position[active, axis[of_set]]
        middle = (head + np.append(head[1:], len(part))) // 2
        cut = along[np.lexsort((along, part))[middle]]
        # no half may be empty: where the first line holds half of the nodes the cut is right behind it
        first = lower[np.arange(len(head)), axis]
        cut = np.where(cut > first, cut, np.nextafter(first, np.inf))
        side[:] = -1
        side[active], set_of[active] = along >= cut[of_set], of_set
        inside = (side[one] >= 0) & (side[other] >= 0)
        one, other = one[inside], other[inside]
        across = side[one] != side[other]
        ahead = side[one[across]] == 1
        beyond, before = (np.where(first, one[across], other[across]) for first in (ahead, ~ahead))
        more, fewer = (np.bincount(set_of[distinct(nodes)], minlength=len(head)) for nodes in (beyond, before))
        side[np.where((fewer < more)[set_of[beyond]], before, beyond)] = -1
        kept = ~across & (side[one] >= 0) & (side[other] >= 0)
        one, other = one[kept], other[kept]
        inside = side[active] >= 0
        active, part = active[inside], 2 * part[inside] + side[active[inside]]
        by_part = np.argsort(part, kind="stable")
        active, part, depth = active[by_part], part[by_part], depth + 1


def _sets(part: Index, x: Array) -> tuple[Index, Array, Array]:
    """Where sets begin among nodes at `x` (n, d) sorted by `part` (n,), and the lower and upper ends of each."""
    head = np.flatnonzero(np.diff(part, prepend=-1))
    if len(head) == 0:
        return head, x, x
    return head, np.minimum.reduceat(x, head, axis=0), np.maximum.reduceat(x, head, axis=0)


def _along(position: Array, of_front: Index) -> tuple[Array, ...]:
    """Keys (n,) that sort the nodes of a front along its longest extent, the last key first."""
    by_front = np.argsort(of_front, kind="stable")
    head = np.flatnonzero(np.diff(of_front[by_front], prepend=-1))
    x = position[by_front]
    extent = np.maximum.reduceat(x, head, axis=0) - np.minimum.reduceat(x, head, axis=0)
    axes = np.argsort(extent, axis=1)[of_front]
    return tuple(position[np.arange(len(position)), axes[:, k]] for k in range(position.shape[1]))


def _boundaries(front: Index, level: Index, one: Index, other: Index) -> tuple[Index, Index, Index]:
    """`boundary`, `start` and `parent` of `Fronts`, from the `front` (n,) of each node, the `level` (f,) of each front
    and the couplings of nodes of `one` front with later ones of an `other`.

    A front is coupled with what its nodes are and with what its children leave, level by level.
    """
    n, f = len(front), len(level)
    depth = int(level.max(initial=0))
    key = front[one] * n + other
    of_level = level[front[one]]
    pending: list[list[Index]] = [[key[of_level == k]] for k in range(depth + 1)]
    parent = np.full(f, f)
    found = []
    for k in range(depth, -1, -1):
        keys = distinct(np.concatenate(pending[k]))
        found.append(keys)
        at, node = np.divmod(keys, n)
        head = np.flatnonzero(np.diff(at, prepend=-1))
        parent[at[head]] = front[node[head]]
        up = parent[at]
        passed = front[node] != up
        up, node = up[passed], node[passed]
        for j in range(k):
            there = level[up] == j
            pending[j].append(up[there] * n + node[there])
    keys = np.sort(np.concatenate(found))
    at, boundary = np.divmod(keys, n)
    return boundary, np.searchsorted(at, np.arange(f + 1)), parent
