"""Direct solution of K u = f: order of elimination and factorisation, by SciPy alone."""

from collections.abc import Callable

import numpy as np
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg

from mpmtop.arrays import Array, Index
from mpmtop.errors import UnsupportedBody

Solve = Callable[[Array], Array]
Factorise = Callable[[sp.csc_matrix], Solve]

# Band storage (entries) up to which banded Cholesky is taken. Measured on 2:1 bodies against SuperLU in nested
# dissection: 2.6 times as fast at 80 x 40 bilinear elements (0.6 M entries), 0.5 times at 160 x 80 biquadratic (67 M).
BANDED_ENTRIES = 20_000_000
LEAF = 4  # lattice spacings below which nested dissection stops; 2 and 8 measured slower


def choose_elimination(ix: Index, element_dofs: Index, step: int) -> tuple[Index, Factorise]:
    """Order of elimination (n,) of the dofs at lattice positions ix (n, 2), and the factorisation that suits it.

    `element_dofs` (e, d) numbers the dofs of each element, -1 where held; elements are `step` lattice spacings wide.
    """
    i, j = ix.T
    orders = [np.lexsort(keys) for keys in ((j, i), (i, j), (i, i - j), (i, i + j))]  # columns, rows, diagonals
    half_bands = [half_band(order, element_dofs) for order in orders]
    narrowest = int(np.argmin(half_bands))
    if len(ix) * (half_bands[narrowest] + 1) <= BANDED_ENTRIES:
        return orders[narrowest], banded_cholesky
    return nested_dissection(ix, step), nested_superlu


def half_band(order: Index, element_dofs: Index) -> int:
    """Largest distance in `order` (n,) of two dofs of one element, held ones (-1) left out."""
    place = np.append(np.argsort(order), -1)  # the last entry is read by held dofs
    places = place[element_dofs]
    held = places < 0
    last, first = np.where(held, -1, places).max(axis=1), np.where(held, len(order), places).min(axis=1)
    return int((last - first).max())


def nested_dissection(ix: Index, step: int) -> Index:
    """Order (n,) of lattice positions ix (n, 2): both halves of a box come before the line that separates them.

    Separating lines lie on element edges, every `step` spacings, and cross the longer side (George, 1973).
    """
    n = np.arange(len(ix))
    lower, upper = np.tile(ix.min(axis=0), (len(ix), 1)), np.tile(ix.max(axis=0), (len(ix), 1))
    rank = np.zeros(len(ix), np.int64)  # base 3: 0 left of a line, 1 right of it, 2 on it
    active = np.ones(len(ix), bool)
    while active.any():
        axis = np.argmax(upper - lower, axis=1)
        active &= (upper - lower)[n, axis] > LEAF
        line = (lower + upper)[n, axis] // 2 // step * step
        side = np.sign(ix[n, axis] - line)
        rank = 3 * rank + np.where(active, np.where(side == 0, 2, side > 0), 0)
        left, right = active & (side < 0), active & (side > 0)
        upper[n[left], axis[left]] = line[left] - 1
        lower[n[right], axis[right]] = line[right] + 1
        active &= side != 0
    return np.lexsort((ix[:, 1], ix[:, 0], rank))


def banded_cholesky(K: sp.csc_matrix) -> Solve:
    """Banded Cholesky factorisation (LAPACK pbtrf) of K (n, n), symmetric positive definite and stored in full."""
    n = K.shape[0]
    columns = np.repeat(np.arange(n), np.diff(K.indptr))
    offsets = K.indices - columns
    lower = offsets >= 0
    band = np.zeros((n, int(offsets.max()) + 1)).T  # column-major, as LAPACK wants it
    band[offsets[lower], columns[lower]] = K.data[lower]
    try:
        factor = scipy.linalg.cholesky_banded(band, overwrite_ab=True, lower=True, check_finite=False)
    except scipy.linalg.LinAlgError as error:
        raise _singular() from error
    return lambda f: scipy.linalg.cho_solve_banded((factor, True), f, check_finite=False)


def nested_superlu(K: sp.csc_matrix) -> Solve:
    """SuperLU factorisation of K (n, n), symmetric and stored in full, in the order given and without pivoting."""
    return _superlu(K, "NATURAL")


def minimum_degree_superlu(K: sp.csc_matrix) -> Solve:
    """The same in an order of minimum degree that SuperLU finds itself: for a K of any pattern."""
    return _superlu(K, "MMD_AT_PLUS_A")


def _superlu(K: sp.csc_matrix, order: str) -> Solve:
    try:
        factor = scipy.sparse.linalg.splu(K, permc_spec=order, diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError as error:  # SuperLU's "Factor is exactly singular"
        raise _singular() from error
    return factor.solve


def _singular() -> UnsupportedBody:
    return UnsupportedBody(
        "the stiffness is not positive definite: hold the part that is free to move, or raise the modulus contrast if "
        "it hangs on void"
    )
