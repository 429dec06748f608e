"""Solvers for the symmetric positive definite K: analysed once, factored per design, many right-hand sides.

Banded Cholesky (LAPACK) is the fastest that SciPy brings at the sizes of the paper; conjugate gradients with multigrid
take the large systems; SuperLU is the independent check of both, and takes what is large and on no lattice. PARDISO,
if pypardiso is installed, goes before multigrid. No scaling is applied to what is factored: the rounding error of
Cholesky does not change under symmetric diagonal scaling (Higham, Accuracy and Stability of Numerical Algorithms, 2nd
ed., Sect. 10.1.1), so it would buy nothing.
"""

from dataclasses import InitVar, dataclass
from functools import cached_property, partial
from importlib.util import find_spec
from typing import ClassVar, Protocol

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh
from scipy.linalg.lapack import dpbtrf, dpbtrs
from scipy.sparse.linalg import splu

from mpmtop.multigrid import (
    COARSEST,
    Blocks,
    Cycle,
    Lattice,
    Places,
    Solve,
    Step,
    assembled,
    coarsening,
    places,
    rigid_motions,
    v_cycle,
)
from mpmtop.scene import Array, Index, NotConverged

BAND_BYTES = 2 * 2**30
"""Largest band kept in memory; SuperLU needs less beyond it (250k unknowns of a 2:1 body)."""
PARDISO_FROM = 100_000
"""Unknowns from which PARDISO was measured faster than the banded solver (one thread, 2:1 body, analysis included)."""
SINGULAR = 1e-14
"""A pivot below this part of its diagonal entry is rounding noise: what it stands for carries no stiffness."""
SUSPECT = 1e-6
"""A pivot below this part of its diagonal entry may be one of a mechanism: behind other small pivots, rounding leaves
its own far above SINGULAR. 1e-3 and more is what bodies and designs without one have."""
MULTIGRID_FROM = 80_000
"""Unknowns from which multigrid was measured faster than the banded solver (one thread, 2:1 body, designs of an
optimisation with members of three cells); an adjoint, for which a direct solver pays next to nothing, moves it up."""
STRESS_TOLERANCE = 1e-8
"""Of MultigridCG for objectives of stress: keeps them to 1e-6 over ten iterations (20,000 points, p = 12)."""
MAX_ITERATIONS = 300
"""Of conjugate gradients. Filtered designs take 10 to 30. Cells solid or void at random, without a filter, converge at
a contrast of 1e-3 and not at 1e-6: pieces that hang on void alone have modes that no coarse level represents."""


class SingularMatrix(ArithmeticError):
    """The matrix is singular to working precision at the given unknown."""

    def __init__(self, unknown: int) -> None:
        super().__init__(f"the stiffness is singular at unknown {unknown}")
        self.unknown = unknown


class Solver(Protocol):
    """A solver bound to a pattern: `factor` takes the lower triangle's entries.

    All are made of the number m of unknowns, the pattern row >= col (nnz,), and where the unknowns are; a direct solver
    has no use for the last.
    """

    @property
    def tolerance(self) -> float:
        """|b - K x| / |b| that a solution x is held to."""

    def factor(self, data: Array) -> Solve:
        """Factorise; SingularMatrix if a pivot is not positive."""
        ...


def checked_factor(solve: Solve, diagonal: Array, pivot: Array | None) -> Solve:
    """A factorisation with pivots (m,) in units of the diagonal (m,), both in the order of the unknowns; SingularMatrix
    if what it factored is singular to rounding.

    Where a pivot is SUSPECT, or none is known (None), two steps of inverse iteration on the scaled matrix, at the price
    of two solves, find the direction of least stiffness and what is left of it.
    """
    if pivot is not None and np.min(pivot) >= SUSPECT:
        return solve
    root = np.sqrt(diagonal)
    loosest = np.random.default_rng(0).normal(size=len(root))
    with np.errstate(all="ignore"):  # a pivot may be zero
        for _ in range(2):
            loosest = root * solve(root * loosest / np.linalg.norm(loosest))
    if pivot is not None and np.min(pivot) < SINGULAR:
        raise SingularMatrix(int(np.argmax(np.abs(loosest)) if np.all(np.isfinite(loosest)) else np.argmin(pivot)))
    if not np.linalg.norm(loosest) < 1 / SINGULAR:
        raise SingularMatrix(int(np.argmax(np.abs(loosest))))
    return solve


@dataclass(frozen=True, eq=False)
class BandedCholesky:
    """LAPACK's banded Cholesky, dpbtrf; pattern row >= col (nnz,), m unknowns."""

    m: int
    row: Index
    col: Index
    lattice: InitVar[Lattice | None] = None
    tolerance: ClassVar[float] = 1e-9

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
        return checked_factor(lambda b: dpbtrs(cholesky, b, lower=1)[0], diagonal, cholesky[0] ** 2 / diagonal)


def _symmetric(m: int, row: Index, col: Index, data: Array) -> sp.csc_array:
    lower = sp.csc_array((data, (row, col)), shape=(m, m))
    return sp.csc_array(lower + sp.triu(lower.T, k=1))


@dataclass(frozen=True, eq=False)
class SuperLU:
    """SciPy's SuperLU in symmetric mode, minimum-degree order."""

    m: int
    row: Index
    col: Index
    lattice: InitVar[Lattice | None] = None
    tolerance: ClassVar[float] = 1e-9

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
        return checked_factor(lu.solve, diagonal, np.abs(lu.U.diagonal())[lu.perm_c] / diagonal)


@dataclass(frozen=True, eq=False)
class Pardiso:
    """Intel MKL's PARDISO through pypardiso (optional), real symmetric positive definite."""

    m: int
    row: Index
    col: Index
    lattice: InitVar[Lattice | None] = None
    tolerance: ClassVar[float] = 1e-9

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
        return checked_factor(lambda b: solver.solve(upper, b), upper.diagonal(), None)


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

    m: int
    row: Index
    col: Index
    lattice: Lattice
    tolerance: float = 1e-6
    coarsest: int = COARSEST

    @cached_property
    def _places(self) -> Places:
        return places(self.lattice, self.row, self.col)

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


def choose_solver(
    m: int, row: Index, col: Index, lattice: Lattice | None = None, tolerance: float = MultigridCG.tolerance
) -> Solver:
    """The solver measured fastest for the size among those that can be imported; `tolerance` is for iterative ones."""
    if m >= PARDISO_FROM and find_spec("pypardiso"):
        return Pardiso(m, row, col)
    if m >= MULTIGRID_FROM and lattice is not None:
        return MultigridCG(m, row, col, lattice, tolerance)
    banded = BandedCholesky(m, row, col)
    return banded if 8 * m * (banded.bandwidth + 1) <= BAND_BYTES else SuperLU(m, row, col)
