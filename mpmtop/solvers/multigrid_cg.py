"""Conjugate gradients with multigrid: the large systems."""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from scipy.linalg import eigh

from mpmtop.scene import Array, NotConverged
from mpmtop.solvers.checked import SINGULAR
from mpmtop.solvers.multigrid import COARSEST, Cycle, Step, coarsening, v_cycle
from mpmtop.solvers.pattern import Lattice, Pattern, SingularMatrix, Solve
from mpmtop.solvers.stencil import Blocks, Places, assembled, places, rigid_motions

STRESS_TOLERANCE = 1e-8
"""Of MultigridCG for objectives of stress: keeps them to 1e-6 over ten iterations (20,000 points, p = 12)."""
MAX_ITERATIONS = 300
"""Of conjugate gradients. Filtered designs take 10 to 30. Cells solid or void at random, without a filter, converge at
a contrast of 1e-3 and not at 1e-6: pieces that hang on void alone have modes that no coarse level represents."""


@dataclass(frozen=True, eq=False)
class MultigridCG:
    """Conjugate gradients, preconditioned by a multigrid V-cycle on the lattice of the unknowns.

    They start from zero, so that a solution depends on K and b alone. An optimisation for compliance does not see more
    of it than `tolerance`: the gradient is off by about a seventh of it, compliance by its square. A p-norm of stress
    is off by the tolerance itself, and its optimisation multiplies that by ten in a few iterations: STRESS_TOLERANCE.
    Limits: a mechanism that the load does not move goes unseen, unless the whole body moves; the solution is right but
    for it. A piece that hangs on void alone is displaced by what residual is left on it over the void's stiffness: its
    place is known to fewer digits than the objectives, in which it hardly counts.
    Source: Hestenes and Stiefel (1952), J. Res. Natl. Bur. Stand. 49:409.
    """

    pattern: Pattern
    tolerance: float = 1e-6
    coarsest: int = COARSEST

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
        return coarsening(self._places.stencil.lines, self.lattice.h, self.coarsest)

    def factor(self, data: Array) -> Solve:
        """Set up the hierarchy of one K; SingularMatrix if a diagonal entry is not positive.

        The function returned raises SingularMatrix on a direction without energy, NotConverged after MAX_ITERATIONS.
        """
        K = assembled(self._places, data)
        diagonal = K.diagonal[self._places.unknown]
        if np.min(diagonal) <= 0:
            raise SingularMatrix(int(np.argmin(diagonal)))
        self._check_rigid_motions(K)
        return partial(self._solve, K, v_cycle(K, self._steps))

    def _check_rigid_motions(self, K: Blocks) -> None:
        """SingularMatrix if the whole body can move: under a load that does not move it, the iteration converges."""
        motions = rigid_motions(self._places, self.lattice.h)
        energy, scale = motions @ (K.matrix @ motions.T), (motions * K.diagonal) @ motions.T
        part, combination = eigh(energy, scale)
        if part[0] < SINGULAR:
            loosest = combination[:, 0] @ motions[:, self._places.unknown]
            raise SingularMatrix(int(np.argmax(np.abs(loosest))))

    def _solve(self, K: Blocks, cycle: Cycle, b: Array) -> Array:
        if b.ndim == 2:
            return np.stack([self._solve(K, cycle, column) for column in b.T], axis=1)
        residual, unknown = np.zeros(K.stencil.size), self._places.unknown
        residual[unknown] = b
        # half, so that what rounding adds to the residual does not call for another solve
        goal = self.tolerance / 2 * np.linalg.norm(b)
        u, direction, last = np.zeros_like(residual), np.zeros_like(residual), np.inf
        for _ in range(MAX_ITERATIONS):
            if np.linalg.norm(residual) <= goal:
                return u[unknown]
            z = cycle(residual)
            product = float(residual @ z)
            direction *= product / last
            direction += z
            image = K.matrix @ direction
            curvature = float(direction @ image)
            if not curvature > 0:
                raise SingularMatrix(int(np.argmax(np.abs(direction[unknown]))))
            u += np.multiply(direction, product / curvature, out=z)
            image *= product / curvature
            residual -= image
            last = product
        raise NotConverged(
            f"residual {np.linalg.norm(residual) / np.linalg.norm(b):.1e} |b| after {MAX_ITERATIONS} iterations of "
            f"conjugate gradients with multigrid (tolerance {self.tolerance:.0e}): raise E_min / E0 (`contrast`), "
            "support the body better, or use a direct solver, `discretise(..., solver=SuperLU)`"
        )
