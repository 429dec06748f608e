"""Condition numbers of the stiffness, plain and scaled by its diagonal."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, eigsh

from mpmtop.arrays import Array
from mpmtop.equilibrium import Equilibrium
from mpmtop.model import Model

CERTAIN = 1e14
"""Beyond this no digit of a condition number is certain."""


def shown(number: float) -> float:
    """A condition number for a report: its power of ten where no digit is certain."""
    return number if number < CERTAIN else float(f"{number:.0e}")


class Condition(NamedTuple):
    """Largest over smallest eigenvalue of K, and of D^-1/2 K D^-1/2 with D the diagonal of K (Jacobi)."""

    plain: float
    scaled: float


def condition(model: Model, state: Equilibrium) -> Condition:
    """Condition numbers by Lanczos's method, with K's own factorisation for the smallest eigenvalue."""
    stiffness = model.stiffness
    m = len(stiffness.dof)
    lower = sp.csr_array((stiffness.data(state.moduli), (stiffness.row, stiffness.col)), shape=(m, m))
    K = lower + sp.tril(lower, k=-1).T
    root = np.sqrt(K.diagonal())
    start = np.ones(m)  # the same numbers on every run

    def largest(product: Callable[[Array], Array]) -> float:
        operator = LinearOperator((m, m), matvec=product, dtype=float)
        return float(eigsh(operator, k=1, v0=start, tol=1e-4, return_eigenvectors=False)[0])

    return Condition(
        largest(lambda v: K @ v) * largest(state.solve),
        largest(lambda v: K @ (v / root) / root) * largest(lambda v: root * state.solve(root * v)),
    )
