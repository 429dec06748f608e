"""SuperLU: the independent check of the other solvers."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from mpmtop.arrays import Array
from mpmtop.solvers.checked import checked_factor
from mpmtop.solvers.pattern import Pattern, SingularMatrix, Solve


def _symmetric(pattern: Pattern, data: Array) -> sp.csc_array:
    lower = sp.csc_array((data, (pattern.row, pattern.col)), shape=(pattern.m, pattern.m))
    return sp.csc_array(lower + sp.triu(lower.T, k=1))


@dataclass(frozen=True, eq=False)
class SuperLU:
    """SciPy's SuperLU in symmetric mode, minimum-degree order."""

    pattern: Pattern
    tolerance: ClassVar[float] = 1e-9

    def factor(self, data: Array, tolerance: float | None = None) -> Solve:
        """Factorise; SingularMatrix if a pivot is zero to rounding."""
        K = _symmetric(self.pattern, data)
        diagonal = K.diagonal()
        if np.min(diagonal) <= 0:
            raise SingularMatrix(int(np.argmin(diagonal)))
        try:
            lu = splu(K, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError as error:  # "Factor is exactly singular": SuperLU does not say where
            raise SingularMatrix(int(np.argmin(diagonal))) from error
        return checked_factor(lu.solve, diagonal, np.abs(lu.U.diagonal())[lu.perm_c] / diagonal)
