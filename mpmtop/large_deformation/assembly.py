"""Tangent of a step, assembled by the stencils of its points, and its factorisation.

Points with the same nodes share a stencil: their matrices are summed first, and the sums go to the entries of the
tangent's lower triangle. Where they go depends on which stencils and nodes are in use and not on the points' places in
them: a step and its adjoint share it.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.linalg.lapack import dpotrf, dpotrs
from scipy.sparse.linalg import splu

from mpmtop.arrays import Array, Index, Mask, distinct
from mpmtop.grid import Grid
from mpmtop.large_deformation.kinematics import Weights
from mpmtop.solvers import Pattern, SingularMatrix, Solve, SparseCholesky
from mpmtop.solvers.checked import checked_factor

DENSE = 400
"""Unknowns up to which the whole matrix is factored as one, in the time that the analysis of its pattern would take."""
PIVOT = 1e-3
"""Part of a column's largest entry that the diagonal must have to be the pivot, where the tangent is not positive
definite; past a limit point it is not."""


def scatter(index: Index, values: Array, size: int) -> Array:
    """Sum of `values` at `index`, (size,); real or complex."""
    index, values = index.ravel(), values.ravel()
    if np.iscomplexobj(values):
        return np.bincount(index, values.real, size) + 1j * np.bincount(index, values.imag, size)
    return np.bincount(index, values, size).astype(float, copy=False)


@dataclass(frozen=True, eq=False)
class Stencils:
    """The c stencils of p points: `first` (c, 2) lines of their first nodes, and which of them a point has (p,)."""

    first: Index
    of_point: Index

    @cached_property
    def sums(self) -> sp.csr_array:
        """(c, p): sums over the points of each."""
        p = len(self.of_point)
        return sp.csr_array((np.ones(p), (self.of_point, np.arange(p))), shape=(len(self.first), p))


def stencils(weights: Weights) -> Stencils:
    """Those of the points' weights."""
    key = weights.first - weights.first.min(axis=0)
    width = int(key[:, 1].max()) + 1
    found, of_point = np.unique(key[:, 0] * width + key[:, 1], return_inverse=True)
    return Stencils(np.stack(np.divmod(found, width), axis=1) + weights.first.min(axis=0), of_point)


@dataclass(frozen=True, eq=False)
class Assembly:
    """Where the matrices (c, n, 2, 2, n) of the stencils go, in order node, component, component, node: those `kept`
    (k,), times `sign` (k,) or 1, to the `entry` (k,) of the lower triangle `pattern` of the tangent (m, m).

    `soft` (m, m) is the background's part and `constant` its lower triangle on the pattern. Degree of freedom d of the
    box is a row of `to_unknowns` (m, 2 nodes) at most, with its sign, and `held` (2 nodes,) if of none.
    """

    pattern: Pattern
    position: Array
    kept: Index
    sign: Array | None
    entry: Index
    constant: Array
    soft: sp.csr_array
    to_unknowns: sp.csr_array
    held: Mask

    @cached_property
    def from_unknowns(self) -> sp.csc_array:
        """(2 nodes, m): the transpose of `to_unknowns`."""
        return self.to_unknowns.T

    @property
    def nbytes(self) -> int:
        """Memory [bytes] of what grows with the points."""
        arrays = (self.kept, self.entry, self.constant, self.pattern.row, self.pattern.col, self.soft.data)
        return 2 * sum(array.nbytes for array in arrays)  # the factorisation's analysis is as large again

    def lower(self, local: Array) -> Array:
        """Entries of the lower triangle, of the stencils' matrices local (c, n, 2, 2, n)."""
        values = local.ravel()[self.kept]
        if self.sign is not None:
            values = values * self.sign
        return self.constant + scatter(self.entry, values, len(self.constant))

    @cached_property
    def cholesky(self) -> SparseCholesky:
        """Solver of a positive definite tangent."""
        return SparseCholesky(self.pattern, self.position)

    def factor(self, lower: Array) -> Solve:
        """Solve with K by its lower triangle; SingularMatrix names an unknown that has no stiffness.

        What is not positive definite, or complex, is left to a factorisation with pivots.
        """
        if not np.iscomplexobj(lower):
            try:
                return dense(self.pattern, lower) if self.pattern.m <= DENSE else self.cholesky.factor(lower)
            except SingularMatrix:
                pass
        return factorised(self.full(lower))

    def full(self, lower: Array) -> sp.csc_array:
        """K (m, m) of its lower triangle."""
        below = sp.csc_array((lower, (self.pattern.row, self.pattern.col)), shape=(self.pattern.m,) * 2)
        return sp.csc_array(below + sp.tril(below, -1).T)


def assembly(grid: Grid, used: Stencils, width: int, unknown: Index, sign: Array, soft: sp.csr_array) -> Assembly:
    """Assembly for stencils of `width` nodes along each axis, on the m unknowns of a step: degree of freedom d of the
    box is sign[d] times unknown[d], or not at all where that is -1; `soft` (m, m) is what the points do not give."""
    k = np.arange(width)
    i = np.repeat(used.first[:, :1] + k, width, axis=1)
    j = np.tile(used.first[:, 1:] + k, (1, width))
    nx, ny = grid.nodes
    outside = (i < 0) | (i >= nx) | (j < 0) | (j >= ny)
    dof = 2 * np.where(outside, 0, i * ny + j)[:, :, None] + np.arange(2)  # (c, n, 2)
    mine = np.where(outside[:, :, None], -1, unknown[dof])
    shape = (*mine.shape, *mine.shape[:0:-1])
    row, col = np.broadcast_to(mine[:, :, :, None, None], shape), mine.swapaxes(1, 2)[:, None, None]
    kept = np.flatnonzero((row >= col) & (col >= 0))

    m = soft.shape[0]
    pattern, entry, constant = _pattern(row.ravel()[kept], np.broadcast_to(col, shape).ravel()[kept], soft)
    signs = None
    if np.any(sign < 0):
        s = sign[dof]
        signs = (s[:, :, :, None, None] * s.swapaxes(1, 2)[:, None, None]).ravel()[kept]
    free = np.flatnonzero(unknown >= 0)
    position = np.empty((m, 2))
    # of those that share an unknown one in the body, the last, is as good as any
    position[unknown[free]] = np.stack(np.divmod(free // 2, ny), axis=1) * np.array(grid.h)
    return Assembly(
        pattern,
        position,
        kept.astype(np.int32),
        signs,
        entry,
        constant,
        soft,
        sp.csr_array((sign[free], (unknown[free], free)), shape=(m, len(unknown))),
        unknown < 0,
    )


def _pattern(row: Index, col: Index, soft: sp.csr_array) -> tuple[Pattern, Index, Array]:
    """Pattern of the lower triangle that has places at `row`, `col` (k,) and where `soft` (m, m) has, the entry of each
    of the k, and soft's own values on it.

    Nodes of a stencil have numbers near each other: its places are in a narrow band, and need no sorting.
    """
    m = soft.shape[0]
    width = int(np.max(row - col)) + 1
    place = col * width + row - col
    taken = np.zeros(m * width, bool)
    taken[place] = True
    number = np.flatnonzero(taken)
    stencil_key = number // width * (m + 1) + number % width  # col m + row
    soft_row, soft_col = np.repeat(np.arange(m), np.diff(soft.indptr)), soft.indices.astype(np.intp)
    below = soft_row >= soft_col
    soft_key = (soft_col * m + soft_row)[below]
    key = distinct(np.concatenate([stencil_key, soft_key]))
    entry = np.empty(m * width, np.int32)
    entry[number] = np.searchsorted(key, stencil_key)
    return (
        Pattern(m, *np.divmod(key, m)[::-1]),
        entry[place],
        scatter(np.searchsorted(key, soft_key), soft.data[below], len(key)),
    )


def dense(pattern: Pattern, lower: Array) -> Solve:
    """Solve with a small positive definite K by its lower triangle. SingularMatrix where it is none."""
    K = np.zeros((pattern.m,) * 2, order="F")
    K[pattern.row, pattern.col] = lower
    diagonal = K.diagonal().copy()
    if np.min(diagonal) <= 0:
        raise SingularMatrix(int(np.argmin(diagonal)))
    L, failed = dpotrf(K, lower=1, clean=0, overwrite_a=1)
    if failed:
        raise SingularMatrix(failed - 1)

    def solve(b: Array) -> Array:
        return dpotrs(L, b, lower=1)[0]

    return checked_factor(solve, diagonal, L.diagonal() ** 2 / diagonal)


def factorised(K: sp.csc_array) -> Solve:
    """Solve with K by LU with pivots, scaled to a unit diagonal: K spans the contrast of the design, and pivots are
    told from noise only among equals. SingularMatrix names an unknown that has no stiffness."""
    diagonal = np.abs(K.diagonal())
    if not np.all(diagonal > 0) or not np.all(np.isfinite(diagonal)):
        raise SingularMatrix(int(np.argmin(np.where(np.isfinite(diagonal), diagonal, 0))))
    scale = 1 / np.sqrt(diagonal)
    column = np.repeat(np.arange(len(scale)), np.diff(K.indptr))
    scaled = sp.csc_array((K.data * scale[K.indices] * scale[column], K.indices, K.indptr), shape=K.shape)
    try:
        lu = splu(scaled, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=PIVOT, options={"SymmetricMode": True})
    except RuntimeError as error:  # its way to say that a pivot is exactly zero
        raise SingularMatrix(int(np.argmin(diagonal))) from error

    def solve(b: Array) -> Array:
        return scale * lu.solve(scale * b)

    return solve
