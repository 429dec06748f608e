"""The start of an optimisation, and the scaled functions of one design, checked."""

from dataclasses import replace

import numpy as np

from mpmtop.arrays import Array, number
from mpmtop.errors import NotConverged
from mpmtop.optimizers.protocols import E, Evaluation, Problem, State, objectives
from mpmtop.optimizers.subproblem import SMALLEST

LEAST_SLOPE = 1e-3
"""Of the scaled objective, by its linear part from corner to corner of the bounds: below, the curvature that plain MMA
adds, 1e-5 a variable, stands for the objective. A steep one needs no bound: no violation is bought for it."""


def initial_state(problem: Problem[E], evaluation: E, start: Array | None = None) -> State:
    """State at `start` (n,), or x0, from its evaluation; ValueError if start, bounds or constraints are unusable."""
    x = checked_start(problem, problem.x0 if start is None else start)
    m = np.size(evaluation.constraints)
    if m == 0:
        raise ValueError("no constraint: give at least one, for example -1 <= 0")
    scale = 1 / abs(evaluation.objective) if abs(evaluation.objective) > SMALLEST else 1.0
    half = 0.5 * variable_range(problem)
    curvature = np.zeros(len(objectives(evaluation)) + m)
    state = State(x, x, x, x - half, x + half, curvature, iteration=0, scale=scale)
    scaled_values(state, evaluation)
    return state


def checked_start(problem: Problem[E], start: Array) -> Array:
    """A copy of the start (n,), which must be finite and within finite bounds, by ValueError."""
    x, lower, upper = (np.array(a, float) for a in (start, problem.lower, problem.upper))
    if not (x.ndim == 1 and x.shape == lower.shape == upper.shape):
        raise ValueError(
            f"start {x.shape}, lower {lower.shape}, upper {upper.shape}: give three arrays of one length (n,), "
            "a value for each design variable"
        )
    if not np.all(np.isfinite([lower, upper])):
        raise ValueError("the start must lie within finite bounds: give bounds that are numbers")
    outside = ~((lower <= x) & (x <= upper))  # NaN is
    if np.any(outside):
        j = np.flatnonzero(outside)[0]
        raise ValueError(
            f"the start must lie within finite bounds: {np.count_nonzero(outside)} of {len(x)} variables do not, the "
            f"first is {x[j]} at index {j}, between {lower[j]} and {upper[j]}: clip it, or widen them"
        )
    return x


def scaled_values(state: State, evaluation: Evaluation) -> Array:
    """Scaled objectives, then constraints: f (k+m,), for the iteration of `state`."""
    with np.errstate(invalid="ignore"):  # what is not finite is refused below, by name
        f = np.append(state.scale * objectives(evaluation), evaluation.constraints)
    if not np.all(np.isfinite(f)):
        raise NotConverged(
            f"iteration {state.iteration}: objective {evaluation.objective}, constraints "
            f"{evaluation.constraints} are not all finite; check the analysis of this design"
        )
    return f


def scaled_functions(
    problem: Problem[E], state: State, evaluation: E, df0: Array, dg: Array
) -> tuple[State, Array, Array]:
    """State with a sound scale, values f (k+m,) and derivatives df (k+m, n), the objectives' scaled, at its design.

    The scale of the start, 1 / |f_0|, says little where f_0 has an origin far away, or has fallen by orders of
    magnitude since. Where sum_j |scale df0_j| range_j falls below `LEAST_SLOPE` it becomes 1 again.
    """
    df = np.vstack([df0, dg], dtype=float)
    k = len(objectives(evaluation))
    expected = np.size(evaluation.constraints) + k, len(state.x)
    if df.shape != expected:
        raise ValueError(f"derivatives of shape {df.shape}: give df0 (n,) and dg (m, n), {expected} in all")
    if not np.all(np.isfinite(df)):
        raise NotConverged(
            f"iteration {state.iteration}: {np.count_nonzero(~np.isfinite(df))} derivatives are not finite; "
            "check the gradient of this design"
        )
    slope = float(np.max(np.abs(df[:k]) @ (problem.upper - problem.lower)))
    if SMALLEST < slope < LEAST_SLOPE / state.scale:
        curvature = state.curvature.copy()
        curvature[:k] /= state.scale * slope
        state = replace(state, scale=1 / slope, curvature=curvature)
    df[:k] *= state.scale
    return state, scaled_values(state, evaluation), df


def variable_range(problem: Problem[E]) -> Array:
    """upper - lower, and 1 where a variable is fixed: no step is possible there, only the divisions remain sound."""
    span = problem.upper - problem.lower
    return np.where(span > 0, span, 1.0)


def allowed_move(problem: Problem[E], move: float) -> float:
    """The move limit of a rule, or the problem's where that is smaller."""
    return min(move, getattr(problem, "largest_move", 1.0))


def check_move(move: float) -> None:
    """ValueError unless the move limit is a fraction of the range, above 0."""
    if not 0 < number(move) <= 1:
        raise ValueError(f"move {move!r}: give a fraction of the variables' range above 0 and at most 1")
