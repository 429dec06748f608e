"""Voigt notation: symmetric tensors as vectors, strains with engineering shear. The one place that knows the order.

In d dimensions component v of a strain is eps_ii, or 2 eps_ij, for (i, j) = PAIRS[d][v]: the normal ones come first.
"""

import numpy as np

from mpmtop.arrays import Array, Mask

PAIRS = {
    2: ((0, 0), (1, 1), (0, 1)),
    3: ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)),
}
"""Components of the tensor by dimension: xx, yy, xy; and xx, yy, zz, xy, yz, xz."""


def local_B(grad_N: Array, b_bar: Array | None = None) -> Array:
    """B (p, v, n, d) of points with gradients (p, n, d): eps_v = sum_nc B_vnc u_nc on their n nodes.

    eps_ii = u_i,i and 2 eps_ij = u_i,j + u_j,i. `b_bar` (p, n, d) is added to every normal strain, see `mpmtop.b_bar`.
    """
    p, n, d = grad_N.shape
    B = np.zeros((p, len(PAIRS[d]), n, d))
    for v, (i, j) in enumerate(PAIRS[d]):
        B[:, v, :, i] = grad_N[:, :, j]
        B[:, v, :, j] = grad_N[:, :, i]
    if b_bar is not None:
        B[:, :d] += b_bar[:, None]
    return B


def entries(d: int, mean_dilatation: bool) -> Mask:
    """Which entries (v, d) of `local_B` are not zero for want of a derivative: those to store."""
    stored = np.zeros((len(PAIRS[d]), d), dtype=bool)
    for v, pair in enumerate(PAIRS[d]):
        stored[v, list(pair)] = True
    stored[:d] |= mean_dilatation
    return stored
