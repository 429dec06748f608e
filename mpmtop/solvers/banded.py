"""Banded Cholesky: the fastest at the sizes of the paper.

No scaling is applied to what is factored: the rounding error of Cholesky does not change under symmetric diagonal
scaling (Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., Sect. 10.1.1), so it would buy nothing.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.linalg.lapack import dpbtrf, dpbtrs

from mpmtop.arrays import Array, Index
from mpmtop.solvers.checked import checked_factor
from mpmtop.solvers.pattern import Pattern, SingularMatrix, Solve


@dataclass(frozen=True, eq=False)
class BandedCholesky:
    """LAPACK's banded Cholesky, dpbtrf."""

    pattern: Pattern
    tolerance: ClassVar[float] = 1e-9

    @cached_property
    def bandwidth(self) -> int:
        """Number of subdiagonals."""
        return int(np.max(self.pattern.row - self.pattern.col, initial=0))

    @cached_property
    def _position(self) -> Index:
        return self.pattern.col * (self.bandwidth + 1) + self.pattern.row - self.pattern.col

    def factor(self, data: Array, tolerance: float | None = None) -> Solve:
        """Factorise; SingularMatrix if a pivot is not positive."""
        flat = np.zeros(self.pattern.m * (self.bandwidth + 1))
        flat[self._position] = data
        band = flat.reshape(self.bandwidth + 1, self.pattern.m, order="F")
        diagonal = band[0].copy()
        if np.min(diagonal) <= 0:
            raise SingularMatrix(int(np.argmin(diagonal)))
        cholesky, failed = dpbtrf(band, lower=1, overwrite_ab=1)
        if failed:
            raise SingularMatrix(failed - 1)
        return checked_factor(lambda b: dpbtrs(cholesky, b, lower=1)[0], diagonal, cholesky[0] ** 2 / diagonal)
