"""Tangent of a step, assembled through fixed stencils, and its factorisation.

The functions of a point live on n1 x n1 nodes, so a node has at most (2 n1 - 1)^2 neighbours, itself included. Matrices
of points are summed into an array (nodes, neighbours, 2, 2), whose slots are known without any search; the entries of
the sparse tangent are picked from there.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from mpmtop.arrays import Array, Index
from mpmtop.grid import Grid
from mpmtop.large_deformation.kinematics import Weights
from mpmtop.solvers.pattern import SingularMatrix, Solve

PIVOT = 1e-3
"""Part of a column's largest entry that the diagonal must have to be the pivot. The tangent is symmetric and mostly
positive definite, where the diagonal is as good as any; past a limit point it is not."""


def scatter(index: Index, values: Array, size: int) -> Array:
    """Sum of `values` at `index`, (size,); real or complex."""
    index, values = index.ravel(), values.ravel()
    if np.iscomplexobj(values):
        return np.bincount(index, values.real, size) + 1j * np.bincount(index, values.imag, size)
    return np.bincount(index, values, size).astype(float, copy=False)


@dataclass(frozen=True, eq=False)
class Assembly:
    """Where the matrices of the points go: slots (p, n, 2, 2, n), in order node, component, component, node, of an
    array of `slots` entries, of which `kept` (k,), times `sign` (k,), go to the `entry` (k,) of the tangent.

    The tangent (m, m) has the pattern `indices`, `indptr` by columns and the `constant` part of the background.
    """

    slot: Index
    slots: int
    kept: Index
    sign: Array
    entry: Index
    constant: Array
    indices: Index
    indptr: Index

    def tangent(self, local: Array) -> sp.csc_array:
        """K (m, m) of the points' matrices local (p, n, 2, 2, n)."""
        entries = scatter(self.slot, local, self.slots)[self.kept] * self.sign
        data = self.constant + scatter(self.entry, entries, len(self.constant))
        m = len(self.indptr) - 1
        return sp.csc_array((data, self.indices, self.indptr), shape=(m, m))


def assembly(grid: Grid, weights: Weights, unknown: Index, sign: Array, constant: sp.csr_array) -> Assembly:
    """Assembly on the m unknowns of a step: degree of freedom d of the grid is sign[d] times unknown[d], or not at all
    where that is -1; `constant` (m, m) is what the points do not give."""
    node = weights.node
    n1 = weights.axes[0].N.shape[1]
    width = 2 * n1 - 1
    touched = np.unique(node[weights.touched])
    row = np.full(np.prod(grid.nodes), 0)  # what is not touched adds zeros to the first
    row[touched] = np.arange(len(touched))

    k = np.arange(n1)
    step = (k[None, :] - k[:, None] + n1 - 1).astype(np.intp)  # from one node of a stencil to the other, along an axis
    neighbour = (step[:, None, :, None] * width + step[None, :, None, :]).reshape(n1 * n1, n1 * n1)
    block = 4 * (row[node][:, :, None] * width**2 + neighbour)  # (p, n, n)
    slot = block[:, :, None, None, :] + np.array([[0, 1], [2, 3]])[:, :, None]

    d = np.arange(width) - n1 + 1
    i, j = np.divmod(touched, grid.nodes[1])
    i, j = (
        np.broadcast_to(a, (len(touched), width, width)) for a in (i[:, None, None] + d[:, None], j[:, None, None] + d)
    )
    inside = (i >= 0) & (i < grid.nodes[0]) & (j >= 0) & (j < grid.nodes[1])
    other = np.where(inside, i * grid.nodes[1] + j, 0).reshape(len(touched), -1, 1, 1)
    c = np.arange(2)
    one, other = np.broadcast_arrays(2 * touched[:, None, None, None] + c[:, None], 2 * other + c)
    both = inside.reshape(len(touched), -1, 1, 1) & (unknown[one] >= 0) & (unknown[other] >= 0)
    kept = np.flatnonzero(both)
    one, other = one.ravel()[kept], other.ravel()[kept]

    m = constant.shape[0]
    fixed = constant.tocoo()
    fixed_row, fixed_column = fixed.coords
    key = np.concatenate([unknown[other] * m + unknown[one], fixed_column.astype(np.intp) * m + fixed_row])
    pattern, entry = np.unique(key, return_inverse=True)
    indptr = np.searchsorted(pattern, m * np.arange(m + 1))
    return Assembly(
        slot,
        4 * len(touched) * width**2,
        kept,
        sign[one] * sign[other],
        entry[: len(kept)],
        scatter(entry[len(kept) :], fixed.data, len(pattern)),
        (pattern % m).astype(np.int32),
        indptr.astype(np.int32),
    )


def factorised(K: sp.csc_array) -> Solve:
    """Solve with K, scaled to a unit diagonal: K spans the contrast of the design, and pivots are told from noise only
    among equals. SingularMatrix names an unknown that has no stiffness."""
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
