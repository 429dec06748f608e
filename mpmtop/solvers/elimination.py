"""Elimination of the fronts of a sparse Cholesky factorisation, one after the other, in memory that is laid out once.

Most fronts are small, and time would go to finding out for each of them, design by design, where its parts are: so they
are worked on at places that depend on the pattern alone. A front's L11 and L21 are made where those of the one before
were, and copied from there, its update where no other waits for its parent.
"""

from bisect import insort
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf, dtrtri

from mpmtop.arrays import Array
from mpmtop.solvers.fronts import UPDATE, Front

INVERTED = 64
"""Pivots of the largest front whose L11 is inverted: a larger one is worth its own calls, and not the inversion."""


Passed = tuple[Array, Array]
"""What a front gets of a child: the part it goes into, and the part of the child's update that it is."""


class Workplace(NamedTuple):
    """Where a front is eliminated: its `block`, L11 and behind it L21, (ns (ns + nb),), these two and its update as
    LAPACK takes them, by columns, and what its children pass on: what is the first at its place is `copied`, at a
    quarter of the price, then the rest is `added`."""

    block: Array
    L11: Array
    L21: Array
    update: Array
    copied: Sequence[Passed]
    added: Sequence[Passed]


def workplaces(fronts: Sequence[Front]) -> list[Workplace]:
    """Those of all fronts, in the order of elimination."""
    updates = _updates(fronts)
    shared = np.empty(max(front.pivots * (front.pivots + front.boundary) for front in fronts))
    result = []
    for front, update in zip(fronts, updates, strict=True):
        ns, nb = front.pivots, front.boundary
        block = shared[: ns * (ns + nb)]
        parts = block[: ns * ns].reshape(ns, ns), block[ns * ns :].reshape(ns, nb), update
        copied: list[Passed] = []
        added: list[Passed] = []
        filled: list[slice] = []  # lines of the update, by children before
        for child, blocks in front.children:
            for part, into, of in blocks:
                met = part != UPDATE or all(any(_meet(lines, other) for other in filled) for lines in into)
                (added if met else copied).append((parts[part][into], updates[child][of]))
            filled += [into[0] for part, into, _ in blocks if part == UPDATE and into[0] == into[1]]
        L11, L21 = parts[0].T, parts[1].T
        result.append(Workplace(block, L11, L21, update.T, copied, added))
    return result


def _meet(one: slice, other: slice) -> bool:
    return bool(one.start < other.stop and other.start < one.stop)


def _updates(fronts: Sequence[Front]) -> list[Array]:
    """Where the update (nb, nb) of each front waits for its parent, triangles by columns: at the first gap between
    those that wait."""
    waiting: list[tuple[int, int]] = []  # from where to where, sorted
    taken = []
    for front in fronts:
        begin = 0
        for start, stop in waiting:
            if start - begin >= front.boundary**2:
                break
            begin = stop
        taken.append((begin, begin + front.boundary**2))
        if front.boundary > 0:
            insort(waiting, taken[-1])
        for child, _ in front.children:
            waiting.remove(taken[child])
    memory = np.empty(max(stop for _, stop in taken))
    return [
        memory[start:stop].reshape(front.boundary, front.boundary)
        for front, (start, stop) in zip(fronts, taken, strict=True)
    ]


def eliminate(fronts: Sequence[Front], at: Sequence[Workplace], entries: Array, values: Array) -> int | None:
    """Turn the entries of K, sorted by fronts, into the `values` of L, in double precision before they are stored; the
    unknown, by its place in the order, that has no positive pivot."""
    for front, (block, L11, L21, update, copied, added) in zip(fronts, at, strict=True):
        block.fill(0)
        block[front.place] = entries[front.entries]
        update.fill(0)
        for into, of in copied:
            into[:] = of
        for into, of in added:
            into += of
        failed = dpotrf(L11, lower=1, clean=0, overwrite_a=1)[1]
        if failed:
            return front.first + failed - 1
        if front.boundary > 0:
            dtrsm(1.0, L11, L21, side=1, lower=1, trans_a=1, overwrite_b=1)
            dsyrk(-1.0, L21, beta=1.0, c=update, lower=1, overwrite_c=1)
        if front.pivots <= INVERTED:
            dtrtri(L11, lower=1, overwrite_c=1)
        values[front.begin : front.begin + len(block)] = block
    return None
