"""Conjugate gradients with multigrid: the large systems."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from scipy.linalg import eigh
from scipy.linalg.blas import daxpy

from mpmtop.arrays import Array, Index
from mpmtop.solvers.checked import SINGULAR
from mpmtop.solvers.multigrid import COARSEST, Coarsest, Cycle, Step, coarsening, coarsest_of, v_cycle
from mpmtop.solvers.pattern import Lattice, Pattern, SingularMatrix, Solve
from mpmtop.solvers.sparse_cholesky import SparseCholesky
from mpmtop.solvers.stencil import Blocks, Places, assembled, places, rigid_motions

MAX_ITERATIONS = 40
"""Of conjugate gradients, before the direct solver takes over: what is lost then is bounded by their price, about that
of two factorisations. Designs of an optimisation of 251,000 unknowns took 32 at most, for a p-norm's 1e-8."""


@dataclass(frozen=True, eq=False)
class MultigridCG:
    """Conjugate gradients, preconditioned by a multigrid V-cycle on the lattice of the unknowns.

    They start from zero, so that a solution depends on K and b alone. Compliance is off by about the square of
    `tolerance`, its gradient by a seventh of it. Gradients that are off lead to other designs, though: over 60
    iterations of the scale study objectives differ from the direct solver's by up to 3e-5 at a tolerance of 1e-3, 6e-5
    at 1e-4, 9e-8 at 1e-5 and 9e-9 at 3e-6 on 20,000 points, by 3.1e-6 at 1e-5 and 1.3e-8 at 3e-6 on 320,000. No
    tolerance bounds that: MMA goes by the signs of a variable's last two steps, and one that is about to turn is moved
    otherwise by any difference (at 1e-7, one with steps below 2e-9: 7e-7). A smaller one finds what is left on pieces
    that hang on void, in designs whose members form: 1e-6 takes 17 cycles for 8, and 39 for 28.
    A p-norm of stress is off by the tolerance itself, and its optimisation multiplies that by ten in a few
    iterations: such an objective asks for another one. Tolerances below the `tightest` are left to sparse Cholesky.
    Limits: a mechanism that the load does not move goes unseen, unless the whole body moves; the solution is right but
    for it. A piece that hangs on void alone is displaced by what residual is left on it over the void's stiffness: its
    place is known to fewer digits than the objectives, in which it hardly counts.
    Source: Hestenes and Stiefel (1952), J. Res. Natl. Bur. Stand. 49:409.
    """

    pattern: Pattern
    tolerance: float = 3e-6
    coarsest: int = COARSEST
    tightest: float = 0.0

    @property
    def lattice(self) -> Lattice:
        """Of the unknowns."""
        if self.pattern.lattice is None:
            raise ValueError("multigrid needs to know where the unknowns are: give the pattern a lattice")
        return self.pattern.lattice

    @cached_property
    def _places(self) -> Places:
        return places(self.lattice, self.pattern.row, self.pattern.col)

    @cached_property
    def _steps(self) -> list[Step]:
        stencil = self._places.stencil
        # of an L a third of the lattice around it is empty
        return coarsening(stencil.lines, self.lattice.h, self.coarsest * stencil.size // self.pattern.m)

    @cached_property
    def _coarsest(self) -> Coarsest:
        return coarsest_of(assembled(self._places, np.ones(len(self.pattern.row))), self._steps)

    @cached_property
    def _direct(self) -> SparseCholesky:
        return SparseCholesky(self.pattern)

    def factor(self, data: Array, tolerance: float | None = None) -> Solve:
        """Set up the hierarchy of one K; SingularMatrix if a diagonal entry is not positive.

        Where the iteration does not converge in MAX_ITERATIONS the function returned factors K by sparse Cholesky, once
        for all right sides to come, and raises SingularMatrix if that is singular.
        """
        tolerance = self.tolerance if tolerance is None else tolerance
        if self.too_tight(tolerance):
            return self._direct.factor(data)
        K = assembled(self._places, data)
        diagonal = K.diagonal[self._places.unknown]
        if np.min(diagonal) <= 0:
            raise SingularMatrix(int(np.argmin(diagonal)))
        if "_supported" not in self.__dict__:  # designs of one body do not differ by what holds it
            self._check_rigid_motions(K)
            self.__dict__["_supported"] = True
        try:
            cycle = v_cycle(K, self._steps, self._coarsest)
        except SingularMatrix:  # coarser than the mechanism, which the direct solver names
            return self._direct.factor(data)
        return IteratedSolve(K, cycle, self._places.unknown, tolerance, partial(self._direct.factor, data))

    def too_tight(self, tolerance: float) -> bool:
        """Whether a tolerance is left to sparse Cholesky."""
        return tolerance < self.tightest

    def _check_rigid_motions(self, K: Blocks) -> None:
        """SingularMatrix if the whole body can move: under a load that does not move it, the iteration converges."""
        motions = rigid_motions(self._places, self.lattice.h)
        forces = np.stack([K @ motion for motion in motions])
        energy, scale = motions @ forces.T, (motions * K.diagonal) @ motions.T
        part, combination = eigh(energy, scale)
        if part[0] < SINGULAR:
            loosest = combination[:, 0] @ motions[:, self._places.unknown]
            raise SingularMatrix(int(np.argmax(np.abs(loosest))))


@dataclass(frozen=True, eq=False)
class IteratedSolve:
    """K x = b for b (m,) or (m, k) by conjugate gradients, and directly from the first b on that takes too many."""

    K: Blocks
    cycle: Cycle
    unknown: Index
    tolerance: float
    factor: Callable[[], Solve]

    @cached_property
    def direct(self) -> Solve:
        """The direct solver, from the first right side on that needs it."""
        return self.factor()

    def __call__(self, b: Array) -> Array:
        """x."""
        if b.ndim == 2:
            return np.stack([self(column) for column in b.T], axis=1)
        found = None if "direct" in self.__dict__ else self._iterate(b)
        return self.direct(b) if found is None else found

    def _iterate(self, b: Array) -> Array | None:
        """x, or None after MAX_ITERATIONS or on a direction without energy."""
        K, unknown = self.K, self.unknown
        residual = np.zeros(K.stencil.size)
        residual[unknown] = b
        # half, so that what rounding adds to the residual does not call for another solve
        goal = self.tolerance / 2 * np.linalg.norm(b)
        u, direction, last = np.zeros_like(residual), np.zeros_like(residual), np.inf
        scaled = residual.astype("float32")
        for _ in range(MAX_ITERATIONS + 1):
            size = np.linalg.norm(residual)
            if size <= goal:
                return u[unknown]
            np.divide(residual, size, out=scaled, casting="same_kind")
            z = self.cycle(scaled) * size
            product = float(residual @ z)
            direction = daxpy(direction, z, a=product / last)
            image = K @ direction
            curvature = float(direction @ image)
            if not curvature > 0:
                return None
            daxpy(direction, u, a=product / curvature)
            daxpy(image, residual, a=-product / curvature)
            last = product
        return None
