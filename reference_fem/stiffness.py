"""K of a finite element model as a map of the moduli, on a fixed pattern."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array, Index
from reference_fem.ties import Ties


@dataclass(frozen=True, eq=False)
class StiffnessMap:
    """Free stiffness as a map of the moduli: K.data = weights @ young + constant on a fixed pattern, (n, n) in full.

    An exact zero of an element matrix stays an entry, so the pattern depends on the mesh alone. Only springs make the
    `constant` (nnz,).
    """

    weights: sp.csr_matrix
    indices: Index
    indptr: Index
    constant: Array | None = None

    def __call__(self, young: Array) -> sp.csc_matrix:
        """K (n, n) for element moduli young (e,), rows and columns in order of elimination."""
        n = len(self.indptr) - 1
        data = self.weights @ young
        return sp.csc_matrix(
            (data if self.constant is None else data + self.constant, self.indices, self.indptr), shape=(n, n)
        )


def numbering(total: int, numbered: Index) -> Index:
    """Inverse (total,) of a choice of dofs: its place in `numbered`, -1 for a dof that is not in it."""
    number = np.full(total, -1)
    number[numbered] = np.arange(len(numbered))
    return number


def stiffness_map(number: Index, element_dofs: Index, matrices: Array, n: int, ties: Ties) -> StiffnessMap:
    """Map from moduli (e,) to K.data for the `number` (N,) of each dof, -1 where held, element dofs (e, d), unit
    matrices (e, d, d), and ties."""
    e = len(element_dofs)
    edge_dofs, edge, owner, spring_dofs, spring = ties.matrices()
    parts = [_entries(number, element_dofs, matrices, np.arange(e), n)]
    if len(edge):
        parts.append(_entries(number, edge_dofs, edge, owner, n))
    if len(spring):
        parts.append(_entries(number, spring_dofs, spring, np.full(len(spring), e), n))
    key, value, column = (np.concatenate(part) for part in zip(*parts, strict=True))
    keys, entry = np.unique(key, return_inverse=True)
    weights = sp.csr_matrix((value, (entry, column)), shape=(len(keys), e + 1))
    constant = weights[:, [e]].toarray().ravel() if len(spring) else None
    indptr = np.searchsorted(keys // n, np.arange(n + 1))
    return StiffnessMap(weights[:, :e], (keys % n).astype(np.int32), indptr.astype(np.int32), constant)


def _entries(number: Index, dofs: Index, matrices: Array, of: Index, n: int) -> tuple[Index, Array, Index]:
    """Keys column * n + row, values and sources of matrices (m, k, k) between dofs (m, k), -1 for none."""
    at = np.where(dofs >= 0, number[dofs], -1)
    rows, columns = np.broadcast_arrays(at[:, :, None], at[:, None, :])
    free = (rows >= 0) & (columns >= 0)
    return columns[free] * n + rows[free], matrices[free], np.broadcast_to(of[:, None, None], rows.shape)[free]
