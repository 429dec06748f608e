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
from itertools import chain
from threading import RLock
from typing import ClassVar
from weakref import WeakValueDictionary

import numpy as np
from scipy.linalg import get_blas_funcs

from mpmtop.arrays import Array, Index, distinct
from mpmtop.solvers.checked import checked_factor
from mpmtop.solvers.dissection import dissect
from mpmtop.solvers.elimination import INVERTED, Workplace, eliminate, workplaces
from mpmtop.solvers.fronts import Analysis, Values, analyse
from mpmtop.solvers.pattern import Pattern, SingularMatrix, Solve

LEAF = 32
"""Nodes that are not dissected further: less, and Python's share grows, more, and the zeros within do."""


@dataclass(frozen=True, eq=False)
class SparseCholesky:
    """Multifrontal Cholesky; unknowns at one `position` (m, d) are eliminated together.

    Positions are those of the lattice unless given, and without either the unknowns' numbers, which is right for any
    matrix and as good as a band.
    """

    pattern: Pattern
    position: Array | None = None
    shared: "Shared" = field(default_factory=lambda: Shared(), init=False, repr=False)
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
        solved, pivot = self.analysis.solved, np.empty(self.pattern.m)
        with self.shared.lock:
            for group, L11, _ in chain.from_iterable(factored.values().levels):
                root = np.diagonal(L11, axis1=1, axis2=2).ravel()
                pivot[solved[group.pivots]] = root**-2 if L11.shape[1] <= INVERTED else root**2
        diagonal = data[self._diagonal]
        return checked_factor(factored, diagonal, pivot / diagonal)

    def unchecked(self, data: Array, dtype: type[np.floating]) -> Solve:
        """Factorise; SingularMatrix only where no pivot is left. L is kept, and solved with, in a `dtype`."""
        factored = Factored(self, data, dtype)
        factored.values()
        return factored

    def eliminate(self, data: Array, values: Array) -> None:
        """Fill in the `values` of all L11, the small ones inverted, and L21."""
        diagonal = data[self._diagonal]
        if np.min(diagonal) <= 0:
            raise SingularMatrix(int(np.argmin(diagonal)))
        fronts = self.analysis.fronts
        if self.shared.workplaces is None:
            self.shared.workplaces = workplaces(fronts)
        failed = eliminate(fronts, self.shared.workplaces, data[self.analysis.by_front], values)
        if failed is not None:
            raise SingularMatrix(int(self.analysis.order[failed]))

    @cached_property
    def _diagonal(self) -> Index:
        """Which entries (m,) are on the diagonal, by unknown."""
        entry = np.flatnonzero(self.pattern.row == self.pattern.col)
        return entry[np.argsort(self.pattern.row[entry])]


class Shared:
    """What the factorisations of one solver share: the lock of whoever works with it, where fronts are eliminated, and
    of each type the one that has values, as another may take them away; a copy by pickle has none."""

    def __init__(self) -> None:
        self.lock = RLock()
        self.workplaces: Sequence[Workplace] | None = None
        self.latest: WeakValueDictionary[type[np.floating], Factored] = WeakValueDictionary()

    def __reduce__(self) -> tuple[type["Shared"], tuple[()]]:
        return Shared, ()


class Factored:
    """K x = b for b (m,) or (m, k).

    The values of L are most of what a large analysis holds, and an optimisation has the last design in hand while it
    factors the next: so of one solver only the latest factorisation keeps them, where those of the one before were, and
    that one is made anew if it is asked again.
    """

    def __init__(self, solver: SparseCholesky, data: Array, dtype: type[np.floating]) -> None:
        self.solver, self.data, self.dtype = solver, data, dtype
        self.kept: Values | None = None

    def __call__(self, b: Array) -> Array:
        """x."""
        with self.solver.shared.lock:
            return _solve(self.solver.analysis, self.values(), b)

    def values(self) -> Values:
        """Of all L11, the small ones inverted, and L21."""
        latest = self.solver.shared.latest
        with self.solver.shared.lock:
            if self.kept is None:
                values, before = None, latest.pop(self.dtype, None)
                if before is not None:
                    values, before.kept = before.kept, None
                if values is None:
                    values = self.solver.analysis.values(self.dtype)
                self.solver.eliminate(self.data, values.flat)
                self.kept, latest[self.dtype] = values, self
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


def _solve(analysis: Analysis, values: Values, b: Array) -> Array:
    """K^-1 b for b (m,) or (m, k)."""
    solved = analysis.solved
    x = b.reshape(len(solved), -1)[solved].astype(values.flat.dtype, copy=False)
    columns = x.shape[1]
    for level, groups in zip(analysis.levels, values.levels, strict=True):
        left = []
        for group, L11, L21 in groups:
            own = x[group.pivots].reshape(len(L11), -1, columns)
            own[:] = _triangles(L11, own, transposed=False)
            left.append((L21 @ own).reshape(-1, columns))
        x[level.reached] -= level.spread @ np.concatenate(left)
    for groups in reversed(values.levels):
        for group, L11, L21 in groups:
            own = x[group.pivots].reshape(len(L11), -1, columns)
            own -= L21.transpose(0, 2, 1) @ x[group.boundary]
            own[:] = _triangles(L11, own, transposed=True)
    u = np.empty_like(x)
    u[solved] = x
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
