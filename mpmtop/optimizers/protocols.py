"""What an optimisation is made of: a problem, what one analysis yields, the memory of a rule, and the rule."""

from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from mpmtop.arrays import Array


class Evaluation(Protocol):
    """What one analysis of a design yields.

    Where the largest of several functions is sought to be small, the evaluation has `objectives` (k,), too, and the
    objective is the largest of them.
    """

    @property
    def objective(self) -> float:
        """f_0."""

    @property
    def constraints(self) -> Array:
        """g (m,), feasible where g <= 0."""


def objectives(evaluation: Evaluation) -> Array:
    """All objectives (k,), the largest of which counts."""
    return np.atleast_1d(np.array(getattr(evaluation, "objectives", evaluation.objective), float))


E = TypeVar("E", bound=Evaluation)


class Problem(Protocol[E]):
    """What is optimised; E is the problem's own kind of evaluation.

    A problem may have a method `remarks` of an evaluation, too: the warnings that its final design calls for; and
    `largest_move`, of a variable's range, where its derivatives hold no further: rules go by their own limit or by
    this one, whichever is smaller.
    """

    @property
    def x0(self) -> Array:
        """Start (n,)."""

    @property
    def lower(self) -> Array:
        """Lower bounds (n,)."""

    @property
    def upper(self) -> Array:
        """Upper bounds (n,)."""

    @property
    def fingerprint(self) -> str:
        """A hash, or a repr, of all that decides the numbers: tells problems apart when a run is resumed."""

    def evaluate(self, x: Array) -> E:
        """One analysis of the design x (n,): one solve."""

    def gradient(self, evaluation: E) -> tuple[Array, Array]:
        """Derivatives df0 (n,), or (k, n) of k objectives, and dg (m, n) at the evaluated design."""


@dataclass(frozen=True, eq=False)
class State:
    """All an update rule remembers: the last three designs and asymptotes, each (n,), and the curvature rho (k+m,).

    `iteration` counts updates; `scale` multiplies the objective: 1 / |f_0| of the start, or what `scaled_functions`
    has made of it.
    """

    x: Array
    x_old: Array
    x_older: Array
    low: Array
    upp: Array
    curvature: Array
    iteration: int
    scale: float


class UpdateRule(Protocol):
    """How the next design is found."""

    def step(self, problem: Problem[E], state: State, evaluation: E, df0: Array, dg: Array) -> tuple[State, E, int]:
        """Next state, its evaluation and the solves spent, from an evaluated state and its derivatives."""
