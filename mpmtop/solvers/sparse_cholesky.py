"""Sparse Cholesky: multifrontal on a nested dissection, in BLAS and LAPACK.

Every front of the dissection is dense: its pivots L11, what couples them with its boundary, L21, and the update that
their elimination leaves there, C = sum of the children's - L21 L21^T. A child's update goes to its parent's three parts
by runs of neighbours: all indices are known from the pattern.

Nearly all fronts are small, and time would go to calling for each of them where little is computed: so those of one
size on one level of the dissection, which do not meet, are solved with together; for that L11 is inverted once, which
is as stable as solving with it (Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., Sect. 14.2).
Sources: Duff and Reid (1983), ACM Trans. Math. Softw. 9:302; Liu (1992), SIAM Rev. 34:82.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from threading import RLock
from typing import ClassVar
from weakref import WeakValueDictionary

import numpy as np
from scipy.linalg import get_blas_funcs
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf, dtrtri

from mpmtop.arrays import Array, Index, distinct
from mpmtop.solvers.checked import checked_factor
from mpmtop.solvers.dissection import dissect
from mpmtop.solvers.fronts import Analysis, Front, analyse
from mpmtop.solvers.pattern import Pattern, SingularMatrix, Solve

LEAF = 32
"""Nodes that are not dissected further: less, and Python's share grows, more, and the zeros within do."""

INVERTED = 64
"""Pivots of the largest front whose L11 is inverted: a larger one is worth its own calls, and not the inversion."""


@dataclass(frozen=True, eq=False)
class SparseCholesky:
    """Multifrontal Cholesky; unknowns at one `position` (m, d) are eliminated together.

    Positions are those of the lattice unless given, and without either the unknowns' numbers, which is right for any
    matrix and as good as a band.
    """

    pattern: Pattern
    position: Array | None = None
    latest: "Latest" = field(default_factory=lambda: Latest(), init=False, repr=False)
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
        return analyse(pattern, node, dissect(position[first], *np.divmod(pair, n), LEAF))

    def factor(self, data: Array, tolerance: float | None = None) -> Solve:
        """Factorise; SingularMatrix if a pivot is not positive."""
        factored = Factored(self, data, np.float64)
        pivot, diagonal = np.empty(self.pattern.m), data[self._diagonal]
        with self.latest.lock:
            values = factored.values()
            for group in (group for level in self.analysis.levels for group in level.groups):
                root = np.diagonal(group.columns(values)[0], axis1=1, axis2=2)
                pivot[self.analysis.order[group.pivots]] = root**-2 if group.pivots.shape[1] <= INVERTED else root**2
        return checked_factor(factored, diagonal, pivot / diagonal)

    def unchecked(self, data: Array, dtype: type[np.floating]) -> Solve:
        """Factorise; SingularMatrix only where no pivot is left. L is kept, and solved with, in a `dtype`."""
        factored = Factored(self, data, dtype)
        factored.values()
        return factored

    def eliminated(self, data: Array, values: Array) -> None:
        """Fill in the `values` of all L11, the small ones inverted, and L21."""
        diagonal = data[self._diagonal]
        if np.min(diagonal) <= 0:
            raise SingularMatrix(int(np.argmin(diagonal)))
        failed = _eliminate(self.analysis.fronts, data[self.analysis.by_front], values)
        if failed is not None:
            raise SingularMatrix(int(self.analysis.order[failed]))

    @cached_property
    def _diagonal(self) -> Index:
        """Which entries (m,) are on the diagonal, by unknown."""
        entry = np.flatnonzero(self.pattern.row == self.pattern.col)
        return entry[np.argsort(self.pattern.row[entry])]


class Latest:
    """Of one solver the factorisation that has values, of each type, and the lock of whoever works with them, as a
    thread may take them away from another; a copy by pickle has none."""

    def __init__(self) -> None:
        self.lock = RLock()
        self.of: WeakValueDictionary[type[np.floating], Factored] = WeakValueDictionary()

    def __reduce__(self) -> tuple[type["Latest"], tuple[()]]:
        return Latest, ()


class Factored:
    """K x = b for b (m,) or (m, k).

    The values of L are most of what a large analysis holds, and an optimisation has the last design in hand while it
    factors the next: so of one solver only the latest factorisation keeps them, where those of the one before were, and
    that one is made anew if it is asked again.
    """

    def __init__(self, solver: SparseCholesky, data: Array, dtype: type[np.floating]) -> None:
        self.solver, self.data, self.dtype = solver, data, dtype
        self.kept: Array | None = None

    def __call__(self, b: Array) -> Array:
        """x."""
        with self.solver.latest.lock:
            return _solve(self.solver.analysis, self.values(), b)

    def values(self) -> Array:
        """Of all L11, the small ones inverted, and L21."""
        latest = self.solver.latest
        with latest.lock:
            if self.kept is None:
                values, before = None, latest.of.pop(self.dtype, None)
                if before is not None:
                    values, before.kept = before.kept, None
                if values is None:
                    values = np.empty(self.solver.analysis.size, self.dtype)
                self.solver.eliminated(self.data, values)
                self.kept, latest.of[self.dtype] = values, self
            return self.kept


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


def _eliminate(fronts: Sequence[Front], entries: Array, values: Array) -> int | None:
    """Turn the entries of K, sorted by fronts, into the `values` of L, in double precision before they are stored; the
    unknown, by its place in the order, that has no positive pivot."""
    largest = max(front.pivots * (front.pivots + front.boundary) for front in fronts)
    scratch = None if values.dtype == np.float64 else np.empty(largest)
    updates: dict[int, Array] = {}  # (nb, nb) of fronts whose parent is still to come, triangles by columns
    for number, (first, ns, nb, begin, of_front, place, children) in enumerate(fronts):
        stored = values[begin : begin + ns * (ns + nb)]
        block = stored if scratch is None else scratch[: len(stored)]
        block.fill(0)
        block[place] = entries[of_front]
        parts = block[: ns * ns].reshape(ns, ns), block[ns * ns :].reshape(ns, nb), np.zeros((nb, nb))
        L11, L21, update = parts
        for child, passed in children:
            left = updates.pop(child)
            for part, into, of in passed:
                where = parts[part][into]
                where += left[of]
        failed = dpotrf(L11.T, lower=1, clean=0, overwrite_a=1)[1]
        if failed:
            return first + failed - 1
        if nb > 0:
            dtrsm(1.0, L11.T, L21.T, side=1, lower=1, trans_a=1, overwrite_b=1)
            dsyrk(-1.0, L21.T, beta=1.0, c=update.T, lower=1, overwrite_c=1)
            updates[number] = update
        if ns <= INVERTED:
            dtrtri(L11.T, lower=1, overwrite_c=1)
        if scratch is not None:
            stored[:] = block
    return None


def _solve(analysis: Analysis, values: Array, b: Array) -> Array:
    """K^-1 b for b (m,) or (m, k)."""
    order, levels = analysis.order, analysis.levels
    x = b.reshape(len(order), -1)[order].astype(values.dtype, copy=False)
    for groups, reached, spread in levels:
        left = []
        for group in groups:
            L11, L21 = (part.transpose(0, 2, 1) for part in group.columns(values))
            x[group.pivots] = y = _triangles(L11, x[group.pivots], transposed=False)
            left.append((L21 @ y).reshape(-1, x.shape[1]))
        x[reached] -= spread @ np.concatenate(left)
    for groups, *_ in reversed(levels):
        for group in groups:
            L11, L21 = (part.transpose(0, 2, 1) for part in group.columns(values))
            y = x[group.pivots] - L21.transpose(0, 2, 1) @ x[group.boundary]
            x[group.pivots] = _triangles(L11, y, transposed=True)
    u = np.empty_like(x)
    u[order] = x
    return u.reshape(b.shape)


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
