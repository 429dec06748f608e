"""Ghost penalty: ties the cells that the body's boundary cuts to their neighbours.

A node at a cut may hang on one point, or on a hair of one: K is singular, or its condition number and the node's
displacement grow without bound as the cut shrinks. For every face F between two cells of the body, at least one of them
cut, a jump of the normal derivative of the grid's bilinear function is given an energy,

    sum_F E_F gamma (h_n / 3) int_F [[d_n u]] . [[d_n v]] ds,

with h_n the cell size across the face. A linear field has no jump, whatever the cut. E_F, the mean of the moduli in the
two cells by volume, keeps K linear in the point moduli. With gamma = 0.01 the condition number of a cantilever cut
along its edges is that of the uncut one to a factor of two, however small the cut (see the tests). What hangs on the
rest of the body by such faces only is as stiff as gamma makes it.

Sources: Burman (2010), C. R. Math. 348:1217; W. M. Coombs (2023), Int. J. Numer. Meth. Engng, doi 10.1002/nme.7332.
Those who follow Sticko, Ludvigsson and Kreiss (2020), Adv. Comput. Math. 46:45, scale it by h^3 / 3, as the mass; the
stiffness takes h^-2 of it, without which gamma would not be a pure number.
"""

from dataclasses import dataclass
from math import isqrt

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array, Index, number
from mpmtop.grid import Grid
from mpmtop.points import GAUSS_2, MaterialPoints
from mpmtop.shape_functions import ShapeFunction, gimp, tent
from mpmtop.transfer import Transfer

CUT = 1e-9
"""A cell that lacks more than this part of its volume is cut."""


@dataclass(frozen=True, eq=False)
class GhostPenalty:
    """Penalty on f of the `between` faces that two cells of the body share, with two Gauss points each.

    `jump` (2f, a) gives [[d_n u]] of nodal values (a,), times sqrt(gamma h_n / 3 x Gauss weight); its rows have six
    entries each. `modulus` (f, p) averages point moduli: E_F. The jump is linear along a face, so the sum is exact.
    """

    gamma: float
    between: int
    jump: sp.csr_array
    modulus: sp.csr_array

    def work(self, v: Array, u: Array) -> Array:
        """v . dK/dE_p u (p,) of the penalty, for nodal displacements v and u (2a,)."""
        product = (self.jump @ v.reshape(-1, 2)) * (self.jump @ u.reshape(-1, 2))
        return self.modulus.T @ product.reshape(-1, 4).sum(axis=1)

    def force(self, moduli: Array, u: Array) -> Array:
        """K u (2a,) of the penalty, with point moduli (p,)."""
        E_F = np.repeat(self.modulus @ moduli, 2)
        return (self.jump.T @ (E_F[:, None] * (self.jump @ u.reshape(-1, 2)))).ravel()


def ghost_penalty(
    gamma: float, grid: Grid, points: MaterialPoints, transfer: Transfer, shape_function: ShapeFunction
) -> GhostPenalty:
    """Penalty of the faces at the cut cells; with gamma = 0, and where no cell is cut, of no face.

    A cell of which no point touches all four nodes has no bilinear function and takes no part: the tent leaves one out
    where a lone point sits on the grid's line crossing. Raises ValueError for gamma < 0 and for B-splines.
    """
    a, p = len(transfer.nodes), len(points.volume)
    if not 0 <= number(gamma) < np.inf:
        raise ValueError(f"ghost penalty {gamma!r}: give a finite number of at least 0")
    if gamma == 0:
        return GhostPenalty(gamma, 0, sp.csr_array((0, a)), sp.csr_array((0, p)))
    if shape_function not in (tent, gimp):
        raise ValueError(
            f"ghost penalty with {shape_function.__name__}: the derivatives of B-splines that jump are higher ones, "
            "which it leaves free; use tent or gimp, or ghost=0"
        )
    cell, volume = cell_volumes(grid, points, transfer)
    row, aspect = grid.nodes[1], grid.h[1] / grid.h[0]
    faces = _faces(cell, row, 1, aspect), _faces(cell, 1, row, 1 / aspect)
    before, after, node, jump = (np.concatenate(part) for part in zip(*faces, strict=True))

    filled = volume.sum(axis=1)
    cut = filled < (1 - CUT) * np.prod(grid.h)
    kept = np.flatnonzero(cut[before] | cut[after])
    column = np.repeat(np.searchsorted(transfer.nodes, node[kept]), 2, axis=0)  # once for each Gauss point
    entries = np.sqrt(gamma) * jump[kept].ravel(), column.ravel(), 6 * np.arange(len(column) + 1)
    first, second = before[kept], after[kept]
    mean = sp.diags_array(1 / (filled[first] + filled[second])) @ (volume[first] + volume[second])
    return GhostPenalty(gamma, len(before), sp.csr_array(entries, shape=(len(column), a)), sp.csr_array(mean))


def cell_volumes(grid: Grid, points: MaterialPoints, transfer: Transfer) -> tuple[Index, sp.csr_array]:
    """Cells (c,) that hold a part of a point, each named by its lower left node, and these parts' volumes (c, p).

    For tent and GIMP: the part of a point in a cell is the one by which the cell's function enters its gradient.
    """
    p, n = len(points.volume), isqrt(transfer.N.shape[1])
    grad_N = transfer.grad_N.reshape(p, n, n, 2)
    # a cell gives its two nodes gradients of one size and of opposite sign, which cancel to the last bit beyond it
    x, y = (-np.cumsum(grid.h[k] * grad_N[..., k].sum(axis=2 - k), axis=1)[:, :-1] for k in (0, 1))
    volume = points.volume[:, None, None] * x[:, :, None] * y[:, None, :]
    point, i, j = np.nonzero(volume)
    lower_left = transfer.nodes[transfer.stencil.reshape(p, n, n)[point, i, j]]
    cell, entry = np.unique(lower_left, return_inverse=True)
    parts = sp.csr_array((volume[point, i, j], (entry, point)), shape=(len(cell), p))
    row = grid.nodes[1]
    whole = np.isin(cell[:, None] + [0, 1, row, row + 1], transfer.nodes).all(axis=1)
    return cell[whole], parts[whole]


def _faces(cell: Index, across: int, along: int, aspect: float) -> tuple[Index, Index, Index, Array]:
    """All f faces between two of the cells (c,): where in `cell` the one before a face is and the one after it, (f,)
    each, the faces' six nodes (f, 6), and sqrt(h_n / 3 x h_t / 2) [[d_n N]] of them (f, 2, 6) at two Gauss points.

    A node's index grows by `across` from one side of the face to the other and by `along` along it; `aspect` is
    h_t / h_n, of the cell's size along the face and across it.
    """
    after = np.minimum(np.searchsorted(cell, cell + across), len(cell) - 1)
    before = np.flatnonzero(cell[after] == cell + across)
    node = cell[before, None] + (along * np.arange(2)[:, None] + across * np.arange(3)).ravel()
    ends = (1 + GAUSS_2 * np.array([[1, -1], [-1, 1]])) / 2  # linear functions along the face, (Gauss point, end)
    jump = np.sqrt(aspect / 6) * np.kron(ends, [1, -2, 1])
    return before, after[before], node, np.broadcast_to(jump, (len(before), 2, 6))
