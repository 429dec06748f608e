"""Solvers for the symmetric positive definite K: analysed once, factored per design, many right-hand sides.

`BandedCholesky` is the fastest at the sizes of the paper, `SparseCholesky` beyond them; `MultigridCG` takes the large
systems and leaves to sparse Cholesky what it does not converge for, or must not be off by much. `SuperLU` is the
independent check of all. `choose_solver` chooses by the pattern alone.
"""

from mpmtop.solvers.banded import BandedCholesky
from mpmtop.solvers.multigrid_cg import MAX_ITERATIONS, MultigridCG
from mpmtop.solvers.pattern import Lattice, Pattern, SingularMatrix, Solve, Solver
from mpmtop.solvers.sparse_cholesky import SparseCholesky
from mpmtop.solvers.superlu import SuperLU

__all__ = [
    "MAX_ITERATIONS",
    "BandedCholesky",
    "Lattice",
    "MultigridCG",
    "Pattern",
    "SingularMatrix",
    "Solve",
    "Solver",
    "SparseCholesky",
    "SuperLU",
    "choose_solver",
]

SPARSE_FROM = 25_000
"""Unknowns from which sparse Cholesky is taken in place of the banded one: CPU of an iteration, banded over sparse, was
0.7 at 10,200, 0.94 at 22,800, 1.07 at 29,200, 1.5 at 63,000 (one thread, 2:1 body; the scale study times both)."""
MULTIGRID_FROM = 100_000
"""Unknowns from which multigrid is tried before sparse Cholesky: a choice, on the side of the one that never iterates
(the scale study times both, `make benchmark`). What multigrid takes moves with the design, 6 to 26 cycles for designs
of an optimisation of compliance at 251,000 unknowns, 9 to 32 to a p-norm's tolerance; a factorisation's price does not.
An adjoint, for which a direct solver pays next to nothing, moves the crossover up."""


TIGHTEST = 1e-6
"""Tolerance below which sparse Cholesky is chosen at any size: an objective of stress asks for 1e-8, and for an
adjoint. On the L-bracket with 206,000 unknowns that took 17 cycles at first and 41 to 74 from iteration 14 on, where a
factorisation has the price of about 20."""


def choose_solver(pattern: Pattern) -> Solver:
    """The solver for the size, see SPARSE_FROM and MULTIGRID_FROM; of multigrid's, for the tolerance, see TIGHTEST."""
    if pattern.m >= MULTIGRID_FROM and pattern.lattice is not None:
        return MultigridCG(pattern, tightest=TIGHTEST)
    return BandedCholesky(pattern) if pattern.m < SPARSE_FROM else SparseCholesky(pattern)
