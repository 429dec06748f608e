"""Stiffness: K(E) = sum_p E_p V_p B_p^T D B_p, and a ghost penalty's part, on a fixed sparsity pattern.

K is linear in the point moduli, so its entries are one sparse matrix-vector product with a map built once. Only the
lower triangle between free degrees of freedom is kept; held and untouched ones never exist.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from mpmtop.ghost import GhostPenalty
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


def stiffness(
    grid: Grid, points: MaterialPoints, transfer: Transfer, D: Array, held: Mask, ghost: GhostPenalty
) -> Stiffness:
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
    m = max(len(dof), 1)
    key, data_map = _lower_triangle(local_unknown, local, m)
    if ghost.modulus.shape[0] > 0:
        # each row of the jump is an element of six nodes, once for each component, with half of a face's energy
        node, jump = ghost.jump.indices.reshape(-1, 6), ghost.jump.data.reshape(-1, 6)
        face_unknown = unknown[2 * node[:, None, :] + np.arange(2)[:, None]].reshape(-1, 6)
        face_local = np.repeat(jump[:, :, None] * jump[:, None, :], 2, axis=0)
        face_key, face_map = _lower_triangle(face_unknown, face_local, m)
        face_map = face_map @ ghost.modulus[np.repeat(np.arange(ghost.modulus.shape[0]), 4)]
        both = np.union1d(key, face_key)
        data_map = _among(both, key, data_map) + _among(both, face_key, face_map)
        key = both
    return Stiffness(dof, key % m, key // m, data_map)


def _lower_triangle(unknown: Index, local: Array, m: int) -> tuple[Index, sp.csr_array]:
    """Keys column * m + row (nnz,), sorted, of the lower triangle of matrices (e, k, k) between unknowns (e, k), -1
    where held, and the sum of the e matrices as a map (nnz, e)."""
    row, col = np.broadcast_arrays(unknown[:, :, None], unknown[:, None, :])
    kept = (row >= col) & (col >= 0)
    key, entry = np.unique(col[kept] * m + row[kept], return_inverse=True)
    return key, sp.csr_array((local[kept], (entry, np.nonzero(kept)[0])), shape=(len(key), len(local)))


def _among(all_keys: Index, keys: Index, rows: sp.csr_array) -> sp.csr_array:
    """The rows of `keys` at their places among those of `all_keys`, both sorted; zero elsewhere."""
    place = (np.ones(len(keys)), (np.searchsorted(all_keys, keys), np.arange(len(keys))))
    return sp.csr_array(place, shape=(len(all_keys), len(keys))) @ rows
