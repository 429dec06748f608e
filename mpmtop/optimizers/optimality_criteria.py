"""Optimality criteria: E. Andreassen et al., Struct. Multidisc. Optim. 43 (2011) 1."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from mpmtop.arrays import Array, number
from mpmtop.optimizers.protocols import E, Problem, State
from mpmtop.optimizers.state import allowed_move, check_move, scaled_functions, scaled_values
from mpmtop.optimizers.subproblem import SMALLEST


@dataclass(frozen=True)
class OptimalityCriteria:
    """x <- x sqrt(-df0 / (lam dg)) within the bounds and |x - x_k| <= move range, for one constraint with dg > 0.

    lam makes the linearised constraint hold with equality, or comes as near to it as the move limit allows; df0 > 0
    counts as 0. One solve an iteration. A rule for compliance: an objective that grows with many variables, as a p-norm
    of stress does, is beyond it.

    `bisection` finds lam as the published codes do, which stop it early: from [0, 1e9], in units of the objective and
    of dg with mean 1, until the interval is less than this part of its ends' sum, 1e-3 there. The last middle counts,
    so that the constraint is met to about this part, not exactly.
    """

    move: float = 0.2
    bisection: float | None = None

    def __post_init__(self) -> None:
        check_move(self.move)
        if self.bisection is not None and not 1e-14 <= number(self.bisection) < 1:  # rounding of the interval's ends
            raise ValueError(f"bisection {self.bisection}: give a width from 1e-14 to below 1, 1e-3 as published")

    def step(self, problem: Problem[E], state: State, evaluation: E, df0: Array, dg: Array) -> tuple[State, E, int]:
        """Next state, its evaluation and the solves spent (1); ValueError if the constraint does not suit the rule."""
        state, f, df = scaled_functions(problem, state, evaluation, df0, dg)
        movable = problem.upper > problem.lower
        if len(f) != 2 or not np.all(df[1, movable] > 0):
            raise ValueError(
                "optimality criteria need one objective and one constraint that grows with every variable: use MMA or "
                "GCMMA"
            )
        x, limit = state.x, allowed_move(problem, self.move) * (problem.upper - problem.lower)
        x_min, x_max = np.maximum(problem.lower, x - limit), np.minimum(problem.upper, x + limit)
        benefit = np.sqrt(np.maximum(-df[0], 0) / np.where(movable, df[1], 1))
        largest = max(np.max(benefit), SMALLEST)
        benefit /= largest

        def design(factor: float) -> Array:
            return np.clip(x * benefit * factor, x_min, x_max)

        def constraint(factor: float) -> float:
            return float(f[1] + df[1] @ (design(factor) - x))

        if self.bisection is None:
            factor = _exact(constraint)
        else:
            unit = largest * np.sqrt(np.mean(df[1, movable]) / state.scale)
            factor = _bisected(constraint, unit, self.bisection)
        new_state = replace(state, x=design(factor), x_old=x, x_older=state.x_old, iteration=state.iteration + 1)
        new = problem.evaluate(new_state.x)
        scaled_values(new_state, new)
        return new_state, new, 1


def _exact(constraint: Callable[[float], float]) -> float:
    """1 / sqrt(lam) at which the constraint holds with equality, lam in units of the largest benefit."""

    def of(log_lam: float) -> float:
        return constraint(np.exp(-0.5 * log_lam))

    # 35 decades to either side of the largest benefit: beyond them every design stands at a limit
    if of(-80) <= 0:
        log_lam = -80.0
    elif of(80) >= 0:
        log_lam = 80.0
    else:
        log_lam = brentq(of, -80, 80, xtol=1e-15, rtol=4 * np.finfo(float).eps)
    return np.exp(-0.5 * log_lam)


def _bisected(constraint: Callable[[float], float], unit: float, width: float) -> float:
    """unit / sqrt(lam) of the last lam that the published bisection tries."""
    low, high, factor = 0.0, 1e9, 0.0
    while high - low > width * (low + high):
        middle = 0.5 * (low + high)
        factor = unit / np.sqrt(middle)
        low, high = (middle, high) if constraint(factor) > 0 else (low, middle)
    return factor
