"""Stiffness: K(E) = sum_p E_p V_p B_p^T D B_p on a fixed sparsity pattern.

K is linear in the point moduli, so its entries are one sparse matrix-vector product with a map built once. Only the
lower triangle between free degrees of freedom is kept; held and untouched ones never exist.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from mpmtop.grid import Grid
from mpmtop.points import MaterialPoints
from mpmtop.scene import Array, Index, Mask
from mpmtop.transfer import Transfer


@dataclass(frozen=True, eq=False)
class Stiffness:
    """Lower triangle of K in the numbering of the unknowns.

    `dof` (m,) is the degree of freedom (2 node + component, see `Transfer`) of each unknown; `row` >= `col` (nnz,) the
    pattern, exact zeros included, sorted by column; `data_map` (nnz, p) turns moduli into entries.
    """

    dof: Index
    row: Index
    col: Index
    data_map: sp.csr_array

    def data(self, moduli: Array) -> Array:
        """Entries (nnz,) of the lower triangle for point moduli (p,)."""
        return self.data_map @ moduli


def narrow_order(grid: Grid, transfer: Transfer) -> Index:
    """Order (a,) of the active nodes that keeps the band of K narrow: by columns, rows or diagonals of the grid,
    whichever spreads a point's nodes least. Columns suit a long body, diagonals an L."""
    i, j = np.divmod(transfer.nodes, grid.nodes[1])

    def spread(order: Index) -> int:
        rank = np.argsort(order)[transfer.stencil]
        last = np.max(rank, axis=1, initial=0, where=transfer.touched)
        return int(np.max(last - np.min(rank, axis=1, initial=len(order), where=transfer.touched)))

    return min((np.lexsort((j, i)), np.lexsort((i, j)), np.lexsort((i, i - j)), np.lexsort((i, i + j))), key=spread)


def stiffness(grid: Grid, points: MaterialPoints, transfer: Transfer, D: Array, held: Mask) -> Stiffness:
    """Pattern and map of K, with tangent D (3, 3) at unit modulus and the `held` (2a,) degrees of freedom left out."""
    order = narrow_order(grid, transfer)
    dof = (2 * order[:, None] + np.arange(2)).ravel()
    dof = dof[~held[dof]]
    unknown = np.full(len(held), -1)
    unknown[dof] = np.arange(len(dof))

    p, n = transfer.stencil.shape
    gx, gy = np.moveaxis(transfer.grad_N, -1, 0)
    B = np.zeros((p, 3, n, 2))
    B[:, 0, :, 0] = B[:, 2, :, 1] = gx
    B[:, 1, :, 1] = B[:, 2, :, 0] = gy
    strain = B.reshape(p, 3, 2 * n)
    local = np.einsum("pai,pab,pbj->pij", strain, points.volume[:, None, None] * D, strain, optimize=True)

    local_unknown = unknown[2 * transfer.stencil[:, :, None] + np.arange(2)]
    local_unknown[~transfer.touched] = -1
    local_unknown = local_unknown.reshape(p, 2 * n)
    row, col = np.broadcast_arrays(local_unknown[:, :, None], local_unknown[:, None, :])
    kept = (row >= col) & (col >= 0)
    key, entry = np.unique(col[kept] * len(dof) + row[kept], return_inverse=True)
    point = np.nonzero(kept)[0]
    data_map = sp.csr_array((local[kept], (entry, point)), shape=(len(key), p))
    return Stiffness(dof, key % max(len(dof), 1), key // max(len(dof), 1), data_map)
