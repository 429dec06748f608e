"""What a linear solver is given, what it returns and what it refuses."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from mpmtop.arrays import Array, Index

Solve = Callable[[Array], Array]
"""Solves K x = b for b (m,) or (m, k)."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """Where the unknowns are: `node` (m, 2) the lines (i, j) of their nodes, `component` (m,), and cell size h."""

    h: tuple[float, float]
    node: Index
    component: Index


@dataclass(frozen=True, eq=False)
class Pattern:
    """Lower triangle of a symmetric matrix of m unknowns: `row` >= `col` (nnz,), each pair once, the diagonal among
    them; and where the unknowns are, if they are on a lattice."""

    m: int
    row: Index
    col: Index
    lattice: Lattice | None = None


class SingularMatrix(ArithmeticError):
    """The matrix is singular to working precision at the given unknown."""

    def __init__(self, unknown: int) -> None:
        super().__init__(f"the stiffness is singular at unknown {unknown}")
        self.unknown = unknown


class Solver(Protocol):
    """A solver bound to a pattern: `factor` takes the lower triangle's entries, and the tolerance of an
    iterative one."""

    @property
    def tolerance(self) -> float:
        """|b - K x| / |b| that a solution x is held to unless asked for another one."""

    def factor(self, data: Array, tolerance: float | None = None) -> Solve:
        """Factorise; SingularMatrix if a pivot is not positive."""
        ...
