"""Soft background: a stiffness on every cell of the fixed box, whether or not points are in it.

Its energy on the increment du of a step is (1/2) alpha E0 int |grad du|^2 over the box, with bilinear functions: small
enough to leave the answer alone, and it gives every node of the box a stiffness that no moving point switches on or
off. Without it the tangent is singular as soon as a cell at the body's boundary holds too few points, and stabilisations
that follow the cut cells make the objective jump whenever the cells change.

What the points do not touch in a step is eliminated before it: K_aa - K_ae K_ee^-1 K_ea, exactly.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from mpmtop.grid import Grid
from mpmtop.scene import Array, Index, Mask


@dataclass(frozen=True, eq=False)
class Background:
    """Stiffness K (m, m) on the m unknowns of the box, symmetric and positive definite once something holds it."""

    K: sp.csr_array

    def condensed(self, active: Mask) -> sp.csr_array:
        """Its stiffness (a, a) on the `active` (m,) unknowns, with all others free of force."""
        K_aa = self.K[active][:, active]
        if np.all(active):
            return sp.csr_array(K_aa)
        K_ea = self.K[~active][:, active]
        edge = np.unique(K_ea.indices)
        solve = splu(sp.csc_array(self.K[~active][:, ~active]), permc_spec="MMD_AT_PLUS_A", options=SYMMETRIC).solve
        K_eb = K_ea[:, edge].toarray()
        less = K_eb.T @ solve(K_eb)
        row, column = np.meshgrid(edge, edge, indexing="ij")
        return sp.csr_array(K_aa - sp.csr_array((less.ravel(), (row.ravel(), column.ravel())), shape=K_aa.shape))


SYMMETRIC = {"SymmetricMode": True, "DiagPivotThresh": 0.0}
"""SuperLU, told that the diagonal serves as pivots."""


def background(grid: Grid, unknown: Index, sign: Array, size: float) -> Background:
    """Background of `size` alpha E0 on unknowns: degree of freedom d of the box is `sign[d]` times unknown[d], or held
    where that is -1; both (2 nodes,)."""
    hx, hy = grid.h
    along, mass = np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([[2.0, 1.0], [1.0, 2.0]]) / 6
    cell = size * (np.kron(along, mass) * hy / hx + np.kron(mass, along) * hx / hy)
    nx, ny = grid.nodes
    lower_left = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    nodes = lower_left[:, None] + np.array([0, 1, ny, ny + 1])
    dof = np.stack([2 * nodes, 2 * nodes + 1])  # (component, cell, corner)
    row, column = np.broadcast_arrays(dof[..., :, None], dof[..., None, :])
    kept = (unknown[row] >= 0) & (unknown[column] >= 0)
    row, column = row[kept], column[kept]
    value = np.broadcast_to(cell, kept.shape)[kept] * sign[row] * sign[column]
    m = int(unknown.max()) + 1
    return Background(sp.csr_array((value, (unknown[row], unknown[column])), shape=(m, m)))
