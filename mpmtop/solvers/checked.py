"""Pivots: singular to rounding, or not."""

import numpy as np

from mpmtop.arrays import Array
from mpmtop.solvers.pattern import SingularMatrix, Solve

SINGULAR = 1e-14
"""A pivot below this part of its diagonal entry is rounding noise: what it stands for carries no stiffness."""
SUSPECT = 1e-6
"""A pivot below this part of its diagonal entry may be one of a mechanism: behind other small pivots, rounding leaves
its own far above SINGULAR. 1e-3 and more is what bodies and designs without one have."""


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
