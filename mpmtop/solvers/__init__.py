"""Solvers for the symmetric positive definite K: analysed once, factored per design, many right-hand sides.

`BandedCholesky` is the fastest at the sizes of the paper, `MultigridCG` takes the large systems, `SuperLU` is the
independent check of both and takes what is large and on no lattice. `choose_solver` chooses by the pattern alone.
"""

from mpmtop.solvers.banded import BandedCholesky
from mpmtop.solvers.multigrid_cg import STRESS_TOLERANCE, MultigridCG
from mpmtop.solvers.pattern import Lattice, Pattern, SingularMatrix, Solve, Solver
from mpmtop.solvers.superlu import SuperLU

__all__ = [
    "STRESS_TOLERANCE",
    "BandedCholesky",
    "Lattice",
    "MultigridCG",
    "Pattern",
    "SingularMatrix",
    "Solve",
    "Solver",
    "SuperLU",
    "choose_solver",
]

BAND_BYTES = 2 * 2**30
"""Largest band kept in memory; SuperLU needs less beyond it (250k unknowns of a 2:1 body)."""
MULTIGRID_FROM = 80_000
"""Unknowns from which multigrid was measured faster than the banded solver (one thread, 2:1 body, designs of an
optimisation with members of three cells); an adjoint, for which a direct solver pays next to nothing, moves it up."""


def choose_solver(pattern: Pattern, tolerance: float = MultigridCG.tolerance) -> Solver:
    """The solver measured fastest for the size; `tolerance` is for iterative ones."""
    if pattern.m >= MULTIGRID_FROM and pattern.lattice is not None:
        return MultigridCG(pattern, tolerance)
    banded = BandedCholesky(pattern)
    return banded if 8 * pattern.m * (banded.bandwidth + 1) <= BAND_BYTES else SuperLU(pattern)
