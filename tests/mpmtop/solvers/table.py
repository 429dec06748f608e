"""The solvers, one table: every test that must hold for all of them runs through it."""

from collections.abc import Callable
from functools import partial

import pytest

from mpmtop.solvers import BandedCholesky, MultigridCG, Pattern, Solver, SparseCholesky, SuperLU

DIRECT: dict[str, Callable[[Pattern], Solver]] = {
    "banded": BandedCholesky,
    "sparse": SparseCholesky,
    "SuperLU": SuperLU,
}
SOLVERS = DIRECT | {"multigrid": partial(MultigridCG, tolerance=1e-11, coarsest=200)}
ALL = pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
EXACT = pytest.mark.parametrize("solver", DIRECT.values(), ids=DIRECT)
