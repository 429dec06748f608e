"""Method of moving asymptotes (MMA), its globally convergent forms (GCMMA), and optimality criteria.

    minimise f_0(x)  subject to  f_i(x) = g_i(x) <= 0, i = 1..m,  and  lower_j <= x_j <= upper_j, j = 1..n

Around the design x_k every f_i is replaced by a convex separable function with asymptotes x_k -+ sigma. Written in the
ratio of the distances to the two asymptotes, r = (x - x_k + sigma) / (x_k + sigma - x), it is free of cancellation:

    f~_i(r) = f_i(x_k) + sum_j p_ij (r_j - 1) + q_ij (1 / r_j - 1),        x = x_k + sigma (r - 1) / (r + 1),
    p_ij = sigma_j / 2 [max(df_ij, 0) + |df_ij| / 1000 + rho_i / range_j],    q_ij: the same with -df_ij.

The curvature rho_i is a small constant in MMA; GCMMA raises it until f~_i >= f_i at the new design. With artificial
variables y_i = max(0, lam_i - c) every subproblem has a solution: a constraint may be violated at the price
c y + y^2 / 2. For that price to dominate, the objective is divided by |f_0(x_0)| in here, and constraints should be of
order one.

Sources: K. Svanberg, Int. J. Numer. Meth. Engng 24 (1987) 359; SIAM J. Optim. 12 (2002) 555; "MMA and GCMMA - two
methods for nonlinear optimization" (2007). Optimality criteria: E. Andreassen et al., Struct. Multidisc. Optim. 43
(2011) 1.
"""

from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

import numpy as np
from scipy.optimize import brentq

from mpmtop.scene import Array, NotConverged
from mpmtop.subproblem import AT_ONCE, SMALLEST, Subproblem, approximation, solve_subproblem

MMA_CURVATURE = 1e-5  # rho of plain MMA
LEAST_CURVATURE = 1e-6
STILL = 1e-9  # a step below this part of the range is rounding: its sign must not move an asymptote
# A function counts as conservatively approximated if it exceeds f~ by less than this, relative to the objective and to
# max(1, |g|): far above the rounding of a direct solve (1e-12), far below any stopping tolerance (1e-4).
CONSERVATIVE_TOL = 1e-9


class Evaluation(Protocol):
    """What one analysis of a design yields."""

    @property
    def objective(self) -> float:
        """f_0."""

    @property
    def constraints(self) -> Array:
        """g (m,), feasible where g <= 0."""


E = TypeVar("E", bound=Evaluation)


class Problem(Protocol[E]):
    """What is optimised; E is the problem's own kind of evaluation."""

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
        """Derivatives df0 (n,) and dg (m, n) at the evaluated design."""


@dataclass(frozen=True, eq=False)
class State:
    """All an update rule remembers: the last three designs and asymptotes, each (n,), and the curvature rho (m+1,).

    `iteration` counts updates; `scale` = 1 / |f_0(x_0)| multiplies the objective.
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


def initial_state(problem: Problem[E], evaluation: E) -> State:
    """State at x0, given its evaluation; ValueError if x0, bounds or constraints are unusable."""
    x, lower, upper = (np.array(a, float) for a in (problem.x0, problem.lower, problem.upper))
    if not (x.ndim == 1 and x.shape == lower.shape == upper.shape):
        raise ValueError(
            f"x0 {x.shape}, lower {lower.shape}, upper {upper.shape}: give three arrays of one length (n,)"
        )
    if not (np.all((lower <= x) & (x <= upper)) and np.all(np.isfinite([lower, upper]))):
        raise ValueError("x0 must lie within finite bounds: clip it, or widen them")
    m = np.size(evaluation.constraints)
    if m == 0:
        raise ValueError("no constraint: give at least one, for example -1 <= 0")
    scale = 1 / abs(evaluation.objective) if abs(evaluation.objective) > SMALLEST else 1.0
    half = 0.5 * _range(problem)
    state = State(x, x, x, x - half, x + half, np.zeros(m + 1), iteration=0, scale=scale)
    _values(state, evaluation)
    return state


@dataclass(frozen=True)
class MMA:
    """Plain MMA (1987, constants of 2007): one subproblem and one solve an iteration; |x - x_k| <= move range."""

    move: float = 0.3

    def __post_init__(self) -> None:
        _check_move(self.move)

    def step(self, problem: Problem[E], state: State, evaluation: E, df0: Array, dg: Array) -> tuple[State, E, int]:
        """Next state, its evaluation and the solves spent (1); NotConverged if a value is not finite."""
        f, df = _functions(state, evaluation, df0, dg)
        return _step_once(problem, state, f, df, np.full(len(f), MMA_CURVATURE), self.move)


@dataclass(frozen=True)
class SingleStepGCMMA:
    """GCMMA without its inner loop: rho_i = max(1e-6, 0.1/n sum_j |df_ij| range_j), one solve an iteration."""

    move: float = 0.3

    def __post_init__(self) -> None:
        _check_move(self.move)

    def step(self, problem: Problem[E], state: State, evaluation: E, df0: Array, dg: Array) -> tuple[State, E, int]:
        """Next state, its evaluation and the solves spent (1); NotConverged if a value is not finite."""
        f, df = _functions(state, evaluation, df0, dg)
        return _step_once(problem, state, f, df, _start_curvature(problem, df), self.move)


@dataclass(frozen=True)
class GCMMA:
    """Globally convergent MMA: a design is accepted once f~_i >= f_i there for every i.

    So the objective cannot rise from a feasible design. Until then rho_i <- min(1.1 (rho_i + delta_i), 10 rho_i) where
    f~_i fell short, delta_i = (f_i - f~_i) / (d f~_i / d rho_i). After `max_inner` solves the last, most cautious
    design is taken. `warm_start` begins at half the last accepted curvature, not at `SingleStepGCMMA`'s.
    """

    move: float = 0.3
    warm_start: bool = False
    max_inner: int = 15

    def __post_init__(self) -> None:
        _check_move(self.move)
        if self.max_inner < 1:
            raise ValueError(f"max_inner {self.max_inner}: allow at least one solve")

    def step(self, problem: Problem[E], state: State, evaluation: E, df0: Array, dg: Array) -> tuple[State, E, int]:
        """Next state, its evaluation and the solves spent (1 to max_inner); NotConverged if a value is not finite."""
        f, df = _functions(state, evaluation, df0, dg)
        rho = _start_curvature(problem, df)
        if self.warm_start and state.iteration > 0:
            rho = np.maximum(LEAST_CURVATURE, 0.5 * state.curvature)
        solves = 0
        while True:
            sub = approximate(problem, state, f, df, rho, self.move)
            r = solve_subproblem(sub)
            new_state = _advance(problem, state, sub, r, rho)
            new = problem.evaluate(new_state.x)
            solves += 1
            f_new = _values(new_state, new)
            size = np.abs(f_new)
            size[1:] = np.maximum(size[1:], 1)
            shortfall = f_new - approximation(sub, r)
            short = shortfall > CONSERVATIVE_TOL * size
            if solves == self.max_inner or not np.any(short):
                return new_state, new, solves
            growth = 0.5 * np.sum(sub.sigma / _range(problem) * (r - 1) ** 2 / r)  # d f~ / d rho
            delta = np.maximum(shortfall, 0) / max(growth, SMALLEST)
            rho = np.where(short, np.minimum(1.1 * (rho + delta), 10 * rho), rho)


@dataclass(frozen=True)
class OptimalityCriteria:
    """x <- x sqrt(-df0 / (lam dg)) within the bounds and |x - x_k| <= move range, for one constraint with dg > 0.

    lam makes the linearised constraint hold with equality, or comes as near to it as the move limit allows; df0 > 0
    counts as 0. One solve an iteration. A rule for compliance: an objective that grows with many variables, as a p-norm
    of stress does, is beyond it.
    """

    move: float = 0.2

    def __post_init__(self) -> None:
        _check_move(self.move)

    def step(self, problem: Problem[E], state: State, evaluation: E, df0: Array, dg: Array) -> tuple[State, E, int]:
        """Next state, its evaluation and the solves spent (1); ValueError if the constraint does not suit the rule."""
        f, df = _functions(state, evaluation, df0, dg)
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
        _values(new_state, new)
        return new_state, new, 1


def approximate(problem: Problem[E], state: State, f: Array, df: Array, rho: Array, move: float) -> Subproblem:
    """Subproblem at state.x from f (m+1,), df (m+1, n) and curvature rho (m+1,); asymptotes after Svanberg (2007).

    sigma is half the range for two iterations, then 1.2 times the last where a variable went on in one direction and
    0.7 times where it turned, within 0.01 and 10 ranges. A tenth of sigma is kept to the asymptote.
    """
    n = len(state.x)
    sub = Subproblem(f, np.empty((len(f), n)), np.empty((len(f), n)), np.empty(n), np.empty(n), np.empty(n))
    span = _range(problem)
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


def _range(problem: Problem[E]) -> Array:
    """upper - lower, and 1 where a variable is fixed: no step is possible there, only the divisions remain sound."""
    span = problem.upper - problem.lower
    return np.where(span > 0, span, 1.0)


def _values(state: State, evaluation: Evaluation) -> Array:
    """Scaled objective, then constraints: f (m+1,), for the iteration of `state`."""
    f = np.append(state.scale * evaluation.objective, evaluation.constraints)
    if not np.all(np.isfinite(f)):
        raise NotConverged(
            f"iteration {state.iteration}: objective {evaluation.objective}, constraints "
            f"{evaluation.constraints} are not all finite; check the analysis of this design"
        )
    return f


def _functions(state: State, evaluation: Evaluation, df0: Array, dg: Array) -> tuple[Array, Array]:
    """Values f (m+1,) and derivatives df (m+1, n), the objective's scaled, at the design of `state`."""
    f, df = _values(state, evaluation), np.vstack([state.scale * df0, dg])
    if df.shape != (len(f), len(state.x)):
        raise ValueError(
            f"derivatives of shape {df.shape}: give df0 (n,) and dg (m, n), {(len(f), len(state.x))} in all"
        )
    if not np.all(np.isfinite(df)):
        raise NotConverged(
            f"iteration {state.iteration}: {np.count_nonzero(~np.isfinite(df))} derivatives are not finite; "
            "check the gradient of this design"
        )
    return f, df


def _start_curvature(problem: Problem[E], df: Array) -> Array:
    """Svanberg's first rho (m+1,)."""
    return np.maximum(LEAST_CURVATURE, 0.1 / df.shape[1] * (np.abs(df) @ (problem.upper - problem.lower)))


def _advance(problem: Problem[E], state: State, sub: Subproblem, r: Array, rho: Array) -> State:
    """The state at the solution r of the subproblem."""
    x = np.clip(state.x + sub.sigma * (r - 1) / (r + 1), problem.lower, problem.upper)
    low, upp = state.x - sub.sigma, state.x + sub.sigma
    return State(x, state.x, state.x_old, low, upp, rho, state.iteration + 1, state.scale)


def _step_once(problem: Problem[E], state: State, f: Array, df: Array, rho: Array, move: float) -> tuple[State, E, int]:
    """One subproblem, one solve, no question asked."""
    sub = approximate(problem, state, f, df, rho, move)
    new_state = _advance(problem, state, sub, solve_subproblem(sub), rho)
    new = problem.evaluate(new_state.x)
    _values(new_state, new)
    return new_state, new, 1


def _check_move(move: float) -> None:
    if not 0 < move <= 1:
        raise ValueError(f"move {move}: give a fraction of the variables' range above 0 and at most 1")
