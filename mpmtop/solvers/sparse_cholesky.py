"""Sparse Cholesky: multifrontal on a nested dissection, in BLAS and LAPACK.

Every front of the dissection is dense: its pivots L11, what couples them with its boundary, L21, and the update that
their elimination leaves there, C = sum of the children's - L21 L21^T. K's entries go to L11 and L21 in one pass, a
child's update goes to its parent's three parts by runs of neighbours: all indices are known from the pattern.

Nearly all fronts are small, and time would go to calling for each of them. So those of one size on one level of the
dissection, which do not meet, pass their updates on together, and are solved together; for that L11 is inverted once,
which is as stable as solving with it (Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., Sect. 14.2).
Sources: Duff and Reid (1983), ACM Trans. Math. Softw. 9:302; Liu (1992), SIAM Rev. 34:82.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import ClassVar

import numpy as np
from scipy.linalg import get_blas_funcs
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf, dtrtri

from mpmtop.arrays import Array, Index, distinct
from mpmtop.solvers.checked import checked_factor
from mpmtop.solvers.dissection import dissect
from mpmtop.solvers.fronts import Alike, Analysis, Passed, analyse
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
        solve, pivot, diagonal = self.unchecked(data)
        return checked_factor(solve, diagonal, pivot / diagonal)

    def unchecked(self, data: Array, dtype: type[np.floating] = np.float64) -> tuple[Solve, Array, Array]:
        """Factorisation, its pivots and K's diagonal, (m,) each; SingularMatrix only where no pivot is left. L is kept,
        and solved with, in a `dtype`."""
        order, levels, place, size = self.analysis
        groups = [group for level in levels for group in level.groups]
        values = np.zeros(size)
        values[place] = data
        diagonal = self._diagonal(groups, values)
        if np.min(diagonal) <= 0:
            raise SingularMatrix(int(np.argmin(diagonal)))
        failed = _eliminate(groups, values)
        if failed is not None:
            raise SingularMatrix(int(order[failed]))
        pivot = self._diagonal(groups, values) ** 2
        for group in groups:
            if group.pivots.shape[1] <= INVERTED:
                for L11 in group.columns(values)[0]:
                    dtrtri(L11.T, lower=1, overwrite_c=1)
        return partial(_solve, self.analysis, values.astype(dtype, copy=False)), pivot, diagonal

    def _diagonal(self, groups: Sequence[Alike], values: Array) -> Array:
        """What is on the diagonal of all L11, by unknown (m,)."""
        diagonal = np.empty(self.pattern.m)
        for group in groups:
            L11 = group.columns(values)[0]
            diagonal[self.analysis.order[group.pivots]] = np.diagonal(L11, axis1=1, axis2=2)
        return diagonal


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


def _eliminate(groups: Sequence[Alike], values: Array) -> int | None:
    """Turn the values of K into those of L; the unknown, by its place in the order, that has no positive pivot."""
    updates: dict[int, Array] = {}  # (k, nb, nb) of groups that are still to come, triangles by columns
    for number, group in enumerate(groups):
        L11, L21 = group.columns(values)
        for k, L in enumerate(L11):
            failed = dpotrf(L.T, lower=1, clean=0, overwrite_a=1)[1]
            if failed:
                return int(group.pivots[k, 0]) + failed - 1
        nb = L21.shape[2]
        if nb == 0:
            continue
        update = updates.pop(number) if number in updates else np.zeros((len(L11), nb, nb))
        for L, below, left in zip(L11, L21, update, strict=True):
            dtrsm(1.0, L.T, below.T, side=1, lower=1, trans_a=1, overwrite_b=1)
            dsyrk(-1.0, below.T, beta=1.0, c=left.T, lower=1, overwrite_c=1)
        for passed in group.passed:
            up11, up21 = groups[passed.group].columns(values)
            if passed.group not in updates:
                updates[passed.group] = np.zeros((len(up21), up21.shape[2], up21.shape[2]))
            _add(passed, update, up11, up21, updates[passed.group])
    return None


def _add(passed: Passed, update: Array, up11: Array, up21: Array, up: Array) -> None:
    """Add updates (k, nb, nb) to the three parts of their parents, all by columns; above the diagonal all are zero."""
    own, parent = passed.own, passed.parent
    if passed.places is not None and isinstance(parent, np.ndarray):
        pivots, around = passed.places
        a, left = len(pivots), update[own]
        for into, columns, rows, of in (
            (up11, pivots, pivots, left[:, :a, :a]),
            (up21, pivots, around, left[:, :a, a:]),
            (up, around, around, left[:, a:, a:]),
        ):
            into[parent[:, None, None], columns[:, None], rows] += of
        return
    for j, (start, stop, to, column_among) in enumerate(passed.runs):
        across = slice(to, to + stop - start)
        for above, below, at, among in passed.runs[j:]:
            into = up if not column_among else up11 if among else up21
            where = parent, across, slice(at, at + below - above)
            part = into[where]
            part += update[own, start:stop, above:below]
            if not isinstance(parent, slice):  # it is a copy
                into[where] = part


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
