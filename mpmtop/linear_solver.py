"""Direct solvers for the symmetric positive definite K: analysed once, factored per design, many right-hand sides.

Banded Cholesky (LAPACK) is the fastest that SciPy brings at the sizes of this project; SuperLU is its independent
check and takes over when the band would not fit in memory; PARDISO, if pypardiso is installed, takes the large
systems. No scaling is applied: the rounding error of Cholesky does not change under symmetric diagonal scaling
(Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., Sect. 10.1.1), so it would buy nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from scipy.linalg.lapack import dpbtrf, dpbtrs
from scipy.sparse.linalg import splu

from mpmtop.scene import Array, Index

Solve = Callable[[Array], Array]
"""Solves K x = b for b (m,) or (m, k)."""

BAND_BYTES = 2 * 2**30
"""Largest band kept in memory; SuperLU needs less beyond it (250k unknowns of a 2:1 body)."""
PARDISO_FROM = 100_000
"""Unknowns from which PARDISO was measured faster than the banded solver (one thread, 2:1 body, analysis included)."""
SINGULAR = 1e-14
"""A pivot below this part of its diagonal entry is rounding noise: what it stands for carries no stiffness."""


class SingularMatrix(ArithmeticError):
    """The matrix is singular to working precision at the given unknown."""

    def __init__(self, unknown: int) -> None:
        super().__init__(f"the stiffness is singular at unknown {unknown}")
        self.unknown = unknown


class Solver(Protocol):
    """A solver bound to a pattern: `factor` takes the lower triangle's entries."""

    def factor(self, data: Array) -> Solve:
        """Factorise; SingularMatrix if a pivot is not positive."""
        ...


@dataclass(frozen=True, eq=False)
class BandedCholesky:
    """LAPACK's banded Cholesky, dpbtrf; pattern row >= col (nnz,), m unknowns."""

    m: int
    row: Index
    col: Index

    @cached_property
    def bandwidth(self) -> int:
        """Number of subdiagonals."""
        return int(np.max(self.row - self.col, initial=0))

    @cached_property
    def _position(self) -> Index:
        return self.col * (self.bandwidth + 1) + self.row - self.col

    def factor(self, data: Array) -> Solve:
        """Factorise; SingularMatrix if a pivot is not positive."""
        flat = np.zeros(self.m * (self.bandwidth + 1))
        flat[self._position] = data
        band = flat.reshape(self.bandwidth + 1, self.m, order="F")
        diagonal = band[0].copy()
        if np.min(diagonal) <= 0:
            raise SingularMatrix(int(np.argmin(diagonal)))
        cholesky, failed = dpbtrf(band, lower=1, overwrite_ab=1)
        if failed:
            raise SingularMatrix(failed - 1)
        pivot = cholesky[0] ** 2 / diagonal
        if np.min(pivot) < SINGULAR:
            raise SingularMatrix(int(np.argmin(pivot)))
        return lambda b: dpbtrs(cholesky, b, lower=1)[0]


def _symmetric(m: int, row: Index, col: Index, data: Array) -> sp.csc_array:
    lower = sp.csc_array((data, (row, col)), shape=(m, m))
    return sp.csc_array(lower + sp.triu(lower.T, k=1))


@dataclass(frozen=True, eq=False)
class SuperLU:
    """SciPy's SuperLU in symmetric mode, minimum-degree order."""

    m: int
    row: Index
    col: Index

    def factor(self, data: Array) -> Solve:
        """Factorise; SingularMatrix if a pivot is zero to rounding."""
        K = _symmetric(self.m, self.row, self.col, data)
        diagonal = K.diagonal()
        if np.min(diagonal) <= 0:
            raise SingularMatrix(int(np.argmin(diagonal)))
        try:
            lu = splu(K, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError as error:  # "Factor is exactly singular": SuperLU does not say where
            raise SingularMatrix(int(np.argmin(diagonal))) from error
        pivot = np.abs(lu.U.diagonal()) / diagonal[np.argsort(lu.perm_c)]
        if np.min(pivot) < SINGULAR:
            raise SingularMatrix(int(np.argsort(lu.perm_c)[np.argmin(pivot)]))
        return lu.solve


@dataclass(frozen=True, eq=False)
class Pardiso:
    """Intel MKL's PARDISO through pypardiso (optional), real symmetric positive definite."""

    m: int
    row: Index
    col: Index

    def factor(self, data: Array) -> Solve:
        """Factorise; SingularMatrix if PARDISO meets a pivot that is not positive."""
        from pypardiso import PyPardisoSolver
        from pypardiso.pardiso_wrapper import PyPardisoError

        # PARDISO reads the upper triangle by rows: our lower one by columns
        upper = sp.csr_matrix((data, (self.col, self.row)), shape=(self.m, self.m))
        solver = PyPardisoSolver(mtype=2)
        try:
            solver.factorize(upper)
        except PyPardisoError as error:
            raise SingularMatrix(int(np.argmin(upper.diagonal()))) from error
        return lambda b: solver.solve(upper, b)


def choose_solver(m: int, row: Index, col: Index) -> Solver:
    """The solver measured fastest for the size among those that can be imported."""
    if m >= PARDISO_FROM and find_spec("pypardiso"):
        return Pardiso(m, row, col)
    banded = BandedCholesky(m, row, col)
    return banded if 8 * m * (banded.bandwidth + 1) <= BAND_BYTES else SuperLU(m, row, col)
