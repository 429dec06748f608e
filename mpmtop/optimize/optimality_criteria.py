"""Optimality criteria: E. Andreassen et al., Struct. Multidisc. Optim. 43 (2011) 1."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from mpmtop.optimize.protocols import E, Problem, State
from mpmtop.optimize.state import check_move, scaled_functions, scaled_values
from mpmtop.optimize.subproblem import SMALLEST
from mpmtop.scene import Array


@dataclass(frozen=True)
class OptimalityCriteria:
    """x <- x sqrt(-df0 / (lam dg)) within the bounds and |x - x_k| <= move range, for one constraint with dg > 0.

    lam makes the linearised constraint hold with equality, or comes as near to it as the move limit allows; df0 > 0
    counts as 0. One solve an iteration. A rule for compliance: an objective that grows with many variables, as a p-norm
    of stress does, is beyond it.
    """

    move: float = 0.2

    def __post_init__(self) -> None:
        check_move(self.move)

    def step(self, problem: Problem[E], state: State, evaluation: E, df0: Array, dg: Array) -> tuple[State, E, int]:
        """Next state, its evaluation and the solves spent (1); ValueError if the constraint does not suit the rule."""
        f, df = scaled_functions(state, evaluation, df0, dg)
        movable = problem.upper > problem.lower
        if len(f) != 2 or not np.all(df[1, movable] > 0):
            raise ValueError("optimality criteria need one constraint that grows with every variable: use MMA or GCMMA")
        x, limit = state.x, self.move * (problem.upper - problem.lower)
        x_min, x_max = np.maximum(problem.lower, x - limit), np.minimum(problem.upper, x + limit)
        benefit = np.sqrt(np.maximum(-df[0], 0) / np.where(movable, df[1], 1))
        benefit /= max(np.max(benefit), SMALLEST)

        def design(log_lam: float) -> Array:
            return np.clip(x * benefit * np.exp(-0.5 * log_lam), x_min, x_max)

        def constraint(log_lam: float) -> float:
            return float(f[1] + df[1] @ (design(log_lam) - x))

        # 35 decades to either side of the largest benefit: beyond them every design stands at a limit
        if constraint(-80) <= 0:
            log_lam = -80.0
        elif constraint(80) >= 0:
            log_lam = 80.0
        else:
            log_lam = brentq(constraint, -80, 80, xtol=1e-15, rtol=4 * np.finfo(float).eps)
        new_state = replace(state, x=design(log_lam), x_old=x, x_older=state.x_old, iteration=state.iteration + 1)
        new = problem.evaluate(new_state.x)
        scaled_values(new_state, new)
        return new_state, new, 1
