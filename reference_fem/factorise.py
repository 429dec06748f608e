"""Direct solution of K u = f: order of elimination and factorisation.

The narrow systems by LAPACK's banded Cholesky, the others by the sparse Cholesky of `mpmtop.solvers`, which is linear
algebra on a pattern and knows no mechanics; SuperLU, in an order of its own, is the check of both.
"""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg
from scipy.linalg.lapack import dpbtrf, dpbtrs

from mpmtop.arrays import Array, Index, Mask
from mpmtop.errors import UnsupportedBody
from mpmtop.solvers.pattern import Pattern, SingularMatrix
from mpmtop.solvers.sparse_cholesky import SparseCholesky

Solve = Callable[[Array], Array]
Factorise = Callable[[sp.csc_matrix], Solve]

# Band storage (entries) up to which banded Cholesky is taken. CPU seconds of a design's evaluation and gradient on 2:1
# bodies, banded over sparse: bilinear 0.5 at 6,560 dofs (0.5 M entries), 1.0 at 25,900 (4.2 M), 1.1 at 40,400
# (8.3 M), 1.7 at 79,000 (23 M); biquadratic 1.0 at 6,560 (1.1 M), 2.3 at 25,900 (8.5 M), 3.1 at 40,400 (17 M).
BANDED_ENTRIES = 4_000_000


def choose_elimination(ix: Index, element_dofs: Index) -> tuple[Index, Factorise]:
    """Order of elimination (n,) of the dofs at lattice positions ix (n, 2), and the factorisation that suits it.

    `element_dofs` (e, d) numbers the dofs of each element, -1 where held.
    """
    i, j = ix.T
    orders = [np.lexsort(keys) for keys in ((j, i), (i, j), (i, i - j), (i, i + j))]  # columns, rows, diagonals
    half_bands = [half_band(order, element_dofs) for order in orders]
    narrowest = int(np.argmin(half_bands))
    if len(ix) * (half_bands[narrowest] + 1) <= BANDED_ENTRIES:
        return orders[narrowest], BandedCholesky()
    return np.arange(len(ix)), NestedCholesky(ix)


def half_band(order: Index, element_dofs: Index) -> int:
    """Largest distance in `order` (n,) of two dofs of one element, held ones (-1) left out."""
    place = np.append(np.argsort(order), -1)  # the last entry is read by held dofs
    places = place[element_dofs]
    held = places < 0
    last, first = np.where(held, -1, places).max(axis=1), np.where(held, len(order), places).min(axis=1)
    return int((last - first).max())


class BandedCholesky:
    """Banded Cholesky (LAPACK pbtrf) in the order given, for any K of one pattern.

    The first K tells the pattern: K (n, n), symmetric positive definite and stored in full.
    """

    def __init__(self) -> None:
        self.band: tuple[int, Mask, Index] | None = None  # height, entries of the lower triangle, where they go

    def __call__(self, K: sp.csc_matrix) -> Solve:
        """K^-1; UnsupportedBody if a pivot is not positive."""
        n = K.shape[0]
        if self.band is None:
            row, column, lower = lower_triangle(K)
            height = int((row - column).max(initial=0)) + 1
            self.band = height, lower, column * height + row - column
        height, lower, place = self.band
        flat = np.zeros(n * height)
        flat[place] = K.data[lower]
        factor, failed = dpbtrf(flat.reshape((height, n), order="F"), lower=1, overwrite_ab=1)
        if failed:
            raise _singular()
        return lambda f: dpbtrs(factor, f, lower=1)[0]


class NestedCholesky:
    """Sparse Cholesky in a nested dissection of the dofs at lattice positions ix (n, 2), for any K of one pattern.

    The first K tells the pattern: K (n, n), symmetric positive definite and stored in full.
    """

    def __init__(self, ix: Index) -> None:
        self.ix = ix
        self.bound: tuple[Mask, SparseCholesky] | None = None  # entries of the lower triangle, and their solver

    def __call__(self, K: sp.csc_matrix) -> Solve:
        """K^-1; UnsupportedBody if a pivot is not positive or rounding alone."""
        if self.bound is None:
            row, column, lower = lower_triangle(K)
            self.bound = lower, SparseCholesky(Pattern(K.shape[0], row, column), self.ix.astype(float))
        lower, cholesky = self.bound
        try:
            return cholesky.factor(K.data[lower])
        except SingularMatrix as error:
            raise _singular() from error


def lower_triangle(K: sp.csc_matrix) -> tuple[Index, Index, Mask]:
    """Rows and columns (k,) of the lower triangle's entries, and which of all entries (nnz,) these are."""
    column = np.repeat(np.arange(K.shape[0]), np.diff(K.indptr))
    lower = K.indices >= column
    return K.indices[lower].astype(np.intp), column[lower], lower


def minimum_degree_superlu(K: sp.csc_matrix) -> Solve:
    """SuperLU factorisation of K (n, n), symmetric and stored in full, in an order of minimum degree that it finds
    itself and without pivoting: for a K of any pattern."""
    options = {"SymmetricMode": True}
    try:
        factor = scipy.sparse.linalg.splu(K, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    except RuntimeError as error:  # SuperLU's "Factor is exactly singular"
        raise _singular() from error
    return factor.solve


def _singular() -> UnsupportedBody:
    return UnsupportedBody(
        "the stiffness is not positive definite: hold the part that is free to move, or raise the modulus contrast if "
        "it hangs on void"
    )
