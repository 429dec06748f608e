"""Globally convergent MMA, with its inner loop and without: see `mma` for the approximation and the sources."""

from dataclasses import dataclass
from numbers import Integral

import numpy as np

from mpmtop.arrays import Array
from mpmtop.errors import NotConverged, PointOutsideGrid
from mpmtop.optimizers.mma import advance, approximate, step_once
from mpmtop.optimizers.protocols import E, Problem, State, objectives
from mpmtop.optimizers.state import check_move, scaled_functions, scaled_values, variable_range
from mpmtop.optimizers.subproblem import SMALLEST, approximation, solve_subproblem

LEAST_CURVATURE = 1e-6
# A function counts as conservatively approximated if it exceeds f~ by less than this, relative to the objective and to
# max(1, |g|): far above the rounding of a direct solve (1e-12), far below any stopping tolerance (1e-4).
CONSERVATIVE_TOL = 1e-9


@dataclass(frozen=True)
class SingleStepGCMMA:
    """GCMMA without its inner loop: rho_i = max(1e-6, 0.1/n sum_j |df_ij| range_j), one solve an iteration."""

    move: float = 0.3

    def __post_init__(self) -> None:
        check_move(self.move)

    def step(self, problem: Problem[E], state: State, evaluation: E, df0: Array, dg: Array) -> tuple[State, E, int]:
        """Next state, its evaluation and the solves spent (1); NotConverged if a value is not finite."""
        state, f, df = scaled_functions(problem, state, evaluation, df0, dg)
        return step_once(problem, state, f, df, _start_curvature(problem, df), self.move, len(objectives(evaluation)))


@dataclass(frozen=True)
class GCMMA:
    """Globally convergent MMA: a design is accepted once f~_i >= f_i there for every i.

    So the objective, of several the largest, cannot rise from a feasible design. Until then rho_i <- min(1.1 (rho_i +
    delta_i), 10 rho_i) where f~_i fell short, delta_i = (f_i - f~_i) / (d f~_i / d rho_i). After `max_inner` solves the
    last, most cautious design is taken. `warm_start` begins at half the last accepted curvature, not at
    `SingleStepGCMMA`'s.

    A design that cannot be analysed, since large deformation finds no equilibrium for it or it leaves the grid, is one
    that no approximation is conservative for: ten times the curvature, and the next try is nearer to the last design.
    """

    move: float = 0.3
    warm_start: bool = False
    max_inner: int = 15

    def __post_init__(self) -> None:
        check_move(self.move)
        if not isinstance(self.warm_start, bool):
            raise ValueError(f"warm_start {self.warm_start!r}: say True or False")
        if not isinstance(self.max_inner, Integral) or self.max_inner < 1:
            raise ValueError(f"max_inner {self.max_inner!r}: allow at least one solve, a whole number")

    def step(self, problem: Problem[E], state: State, evaluation: E, df0: Array, dg: Array) -> tuple[State, E, int]:
        """Next state, its evaluation and the solves spent (1 to max_inner); NotConverged if a value is not finite, and
        what the analysis raises if the last of these cannot be analysed either."""
        state, f, df = scaled_functions(problem, state, evaluation, df0, dg)
        rho = _start_curvature(problem, df)
        if self.warm_start and state.iteration > 0:
            rho = np.maximum(LEAST_CURVATURE, 0.5 * state.curvature)
        solves, k = 0, len(objectives(evaluation))
        while True:
            sub = approximate(problem, state, f, df, rho, self.move, k)
            r = solve_subproblem(sub)
            new_state = advance(problem, state, sub, r, rho)
            solves += 1
            try:
                new = problem.evaluate(new_state.x)
            except (NotConverged, PointOutsideGrid):
                if solves == self.max_inner:
                    raise
                rho = 10 * rho
                continue
            f_new = scaled_values(new_state, new)
            size = np.abs(f_new)
            size[k:] = np.maximum(size[k:], 1)
            shortfall = f_new - approximation(sub, r)
            short = shortfall > CONSERVATIVE_TOL * size
            if solves == self.max_inner or not np.any(short):
                return new_state, new, solves
            growth = 0.5 * np.sum(sub.sigma / variable_range(problem) * (r - 1) ** 2 / r)  # d f~ / d rho
            delta = np.maximum(shortfall, 0) / max(growth, SMALLEST)
            rho = np.where(short, np.minimum(1.1 * (rho + delta), 10 * rho), rho)


def _start_curvature(problem: Problem[E], df: Array) -> Array:
    """Svanberg's first rho (m+1,)."""
    return np.maximum(LEAST_CURVATURE, 0.1 / df.shape[1] * (np.abs(df) @ (problem.upper - problem.lower)))
