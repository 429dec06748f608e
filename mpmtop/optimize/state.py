"""The start of an optimisation, and the scaled functions of one design, checked."""

import numpy as np

from mpmtop.optimize.protocols import E, Evaluation, Problem, State
from mpmtop.optimize.subproblem import SMALLEST
from mpmtop.scene import Array, NotConverged


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
    half = 0.5 * variable_range(problem)
    state = State(x, x, x, x - half, x + half, np.zeros(m + 1), iteration=0, scale=scale)
    scaled_values(state, evaluation)
    return state


def scaled_values(state: State, evaluation: Evaluation) -> Array:
    """Scaled objective, then constraints: f (m+1,), for the iteration of `state`."""
    f = np.append(state.scale * evaluation.objective, evaluation.constraints)
    if not np.all(np.isfinite(f)):
        raise NotConverged(
            f"iteration {state.iteration}: objective {evaluation.objective}, constraints "
            f"{evaluation.constraints} are not all finite; check the analysis of this design"
        )
    return f


def scaled_functions(state: State, evaluation: Evaluation, df0: Array, dg: Array) -> tuple[Array, Array]:
    """Values f (m+1,) and derivatives df (m+1, n), the objective's scaled, at the design of `state`."""
    f, df = scaled_values(state, evaluation), np.vstack([state.scale * df0, dg])
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


def variable_range(problem: Problem[E]) -> Array:
    """upper - lower, and 1 where a variable is fixed: no step is possible there, only the divisions remain sound."""
    span = problem.upper - problem.lower
    return np.where(span > 0, span, 1.0)


def check_move(move: float) -> None:
    """ValueError unless the move limit is a fraction of the range, above 0."""
    if not 0 < move <= 1:
        raise ValueError(f"move {move}: give a fraction of the variables' range above 0 and at most 1")
