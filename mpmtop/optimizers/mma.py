"""Method of moving asymptotes (MMA), and what its globally convergent forms (GCMMA) share with it.

    minimise f_0(x)  subject to  f_i(x) = g_i(x) <= 0, i = 1..m,  and  lower_j <= x_j <= upper_j, j = 1..n

Around the design x_k every f_i is replaced by a convex separable function with asymptotes x_k -+ sigma. Written in the
ratio of the distances to the two asymptotes, r = (x - x_k + sigma) / (x_k + sigma - x), it is free of cancellation:

    f~_i(r) = f_i(x_k) + sum_j p_ij (r_j - 1) + q_ij (1 / r_j - 1),        x = x_k + sigma (r - 1) / (r + 1),
    p_ij = sigma_j / 2 [max(df_ij, 0) + |df_ij| / 1000 + rho_i / range_j],    q_ij: the same with -df_ij.

The curvature rho_i is a small constant in MMA; GCMMA raises it until f~_i >= f_i at the new design. With artificial
variables y_i = max(0, lam_i - c) every subproblem has a solution: a constraint may be violated at the price
c y + y^2 / 2, where no step within the limits would meet it (`solve_subproblem`). The objective is scaled in here
(`scaled_functions`); constraints should be of order one.

Of several objectives f_0l the largest is minimised: z subject to f_0l(x) <= z, with a bound variable z that is no part
of the design. Every one has its approximation, and z is eliminated from the subproblem.

Sources: K. Svanberg, Int. J. Numer. Meth. Engng 24 (1987) 359; SIAM J. Optim. 12 (2002) 555; "MMA and GCMMA - two
methods for nonlinear optimization" (2007).
"""

from dataclasses import dataclass

import numpy as np

from mpmtop.arrays import Array
from mpmtop.optimizers.protocols import E, Problem, State, objectives
from mpmtop.optimizers.state import allowed_move, check_move, scaled_functions, scaled_values, variable_range
from mpmtop.optimizers.subproblem import AT_ONCE, Subproblem, solve_subproblem

MMA_CURVATURE = 1e-5  # rho of plain MMA
STILL = 1e-9  # a step below this part of the range is rounding: its sign must not move an asymptote


@dataclass(frozen=True)
class MMA:
    """Plain MMA (1987, constants of 2007): one subproblem and one solve an iteration; |x - x_k| <= move range."""

    move: float = 0.3

    def __post_init__(self) -> None:
        check_move(self.move)

    def step(self, problem: Problem[E], state: State, evaluation: E, df0: Array, dg: Array) -> tuple[State, E, int]:
        """Next state, its evaluation and the solves spent (1); NotConverged if a value is not finite."""
        state, f, df = scaled_functions(problem, state, evaluation, df0, dg)
        k = len(objectives(evaluation))
        return step_once(problem, state, f, df, np.full(len(f), MMA_CURVATURE), self.move, k)


def approximate(
    problem: Problem[E], state: State, f: Array, df: Array, rho: Array, move: float, objectives: int = 1
) -> Subproblem:
    """Subproblem at state.x from f (k+m,), df (k+m, n) and curvature rho (k+m,); asymptotes after Svanberg (2007).

    sigma is half the range for two iterations, then 1.2 times the last where a variable went on in one direction and
    0.7 times where it turned, within 0.01 and 10 ranges. A tenth of sigma is kept to the asymptote.
    """
    n = len(state.x)
    sub = Subproblem(f, np.empty((len(f), n)), np.empty((len(f), n)), np.empty(n), np.empty(n), np.empty(n), objectives)
    span, move = variable_range(problem), allowed_move(problem, move)
    for first in range(0, n, AT_ONCE):
        part = slice(first, first + AT_ONCE)
        x, of_part = state.x[part], span[part]
        sub.sigma[part] = sigma = _asymptotes(state, part, of_part)
        floor = 0.001 * np.abs(df[:, part]) + rho[:, None] / of_part
        sub.p[:, part] = 0.5 * sigma * (np.maximum(df[:, part], 0) + floor)
        sub.q[:, part] = 0.5 * sigma * (np.maximum(-df[:, part], 0) + floor)
        limit = np.minimum(0.9, move * of_part / sigma)
        down = np.minimum(limit, (x - problem.lower[part]) / sigma)
        up = np.minimum(limit, (problem.upper[part] - x) / sigma)
        sub.r_min[part] = (1 - down) / (1 + down)
        sub.r_max[part] = (1 + up) / (1 - up)
    return sub


def _asymptotes(state: State, part: slice, span: Array) -> Array:
    """Distance sigma of the asymptotes from the variables of a part, whose range is `span`."""
    if state.iteration < 2:
        return 0.5 * span
    last, before = state.x[part] - state.x_old[part], state.x_old[part] - state.x_older[part]
    moved = np.minimum(np.abs(last), np.abs(before)) > STILL * span
    trend = np.sign(last) * np.sign(before) * moved
    factor = np.where(trend > 0, 1.2, np.where(trend < 0, 0.7, 1.0))
    return np.clip(factor * 0.5 * (state.upp[part] - state.low[part]), 0.01 * span, 10 * span)


def advance(problem: Problem[E], state: State, sub: Subproblem, r: Array, rho: Array) -> State:
    """The state at the solution r of the subproblem."""
    x = np.clip(state.x + sub.sigma * (r - 1) / (r + 1), problem.lower, problem.upper)
    low, upp = state.x - sub.sigma, state.x + sub.sigma
    return State(x, state.x, state.x_old, low, upp, rho, state.iteration + 1, state.scale)


def step_once(
    problem: Problem[E], state: State, f: Array, df: Array, rho: Array, move: float, objectives: int
) -> tuple[State, E, int]:
    """One subproblem, one solve, no question asked."""
    sub = approximate(problem, state, f, df, rho, move, objectives)
    new_state = advance(problem, state, sub, solve_subproblem(sub), rho)
    new = problem.evaluate(new_state.x)
    scaled_values(new_state, new)
    return new_state, new, 1
