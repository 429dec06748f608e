"""B-bar: the dilatation of a cell's points replaced by its mean, against volumetric locking as nu -> 1/2.

Every point asks for its own dilatation to vanish, and these may be more conditions than the nodes can meet. With
g_p = grad N (p, n, 2), the volume-weighted mean over the points whose positions a cell c holds, and e = (1, 1, 0),

    g_c = sum_(p in c) V_p g_p / sum_(p in c) V_p,    B_p -> B_p + e (g_c - g_p)^T / 2,

so that a cell asks for one. The factor is 1/2, not 1/3, because the strain stays plane: eps_zz = 0, and D splits into
the mean of eps_xx and eps_yy, which is averaged, and the rest, which is not. A point alone in its cell keeps its B.
A linear displacement keeps its strain. The mean stress is then one value for each cell and modulus, also with
B-splines, which bring a smoother one where they do not lock. Plane stress does not lock, and is refused.
K stays as ill-conditioned as the material is: close to nu = 1/2 multigrid fails and hands over to the direct solver.

Sources: Hughes (1980), Int. J. Numer. Meth. Engng 15:1413; for material points Coombs, Charlton, Cortis and Augarde
(2018), Comput. Methods Appl. Mech. Engrg. 333:115.
"""

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array
from mpmtop.grid import Grid
from mpmtop.points import MaterialPoints
from mpmtop.transfer import Transfer, located, operators


def with_mean_dilatation(grid: Grid, points: MaterialPoints, transfer: Transfer) -> Transfer:
    """The same weights with B averaged over the cells; a point's stencil becomes that of all points of its cell."""
    _, cell, _ = located(grid, points.x)
    own, row = transfer.touched, grid.nodes[1]
    from_cell = np.stack(np.divmod(transfer.nodes[transfer.stencil], row), axis=-1) - cell[:, None]
    first = from_cell[own].min(axis=0)
    window = from_cell[own].max(axis=0) + 1 - first  # nodes that some point touches, as seen from its cell
    p, n = len(own), int(np.prod(window))
    place = np.nonzero(own)[0], ((from_cell - first) @ [window[1], 1])[own]

    def widened(values: Array) -> Array:
        wide = np.zeros((p, n, *values.shape[2:]))
        wide[place] = values[own]
        return wide

    lower_left, of_cell = np.unique(cell @ [row, 1], return_inverse=True)
    share = points.volume / np.bincount(of_cell, points.volume)[of_cell]
    mean = sp.csr_array((share, (of_cell, np.arange(p))))  # (c, p)
    grad_N = widened(transfer.grad_N)
    b_bar = ((mean @ grad_N.reshape(p, -1))[of_cell].reshape(grad_N.shape) - grad_N) / 2

    in_cell = mean @ widened(own.astype(float)) > 0
    node = lower_left[:, None] + ((first + np.indices(window).reshape(2, n).T) @ [row, 1])
    stencil = np.where(in_cell, np.searchsorted(transfer.nodes, node), 0)[of_cell]
    touched = in_cell[of_cell]
    N = widened(transfer.N)
    N_matrix, B = operators(stencil, touched, N, grad_N, len(transfer.nodes), b_bar)
    return replace(transfer, stencil=stencil, touched=touched, N=N, grad_N=grad_N, N_matrix=N_matrix, B=B, b_bar=b_bar)
