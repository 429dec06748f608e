"""Svanberg's approximation in its original form, and his asymptotes."""

from dataclasses import replace

import numpy as np
import pytest

from mpmtop.optimizers import State
from mpmtop.optimizers.mma import approximate
from mpmtop.optimizers.subproblem import approximation
from tests.mpmtop.optimizers.problems import ripples


def test_subproblem_is_svanbergs() -> None:
    """f~ in ratios r equals sum p / (u - x) + q / (x - l) + const with the p and q of the 2007 notes."""
    rng = np.random.default_rng(1)
    problem = ripples(9)
    x, half = rng.uniform(0.2, 0.8, 9), rng.uniform(0.2, 1, 9)
    df, f, rho = rng.normal(size=(2, 9)), np.array([1.0, -0.2]), np.array([0.3, 1e-5])
    state = State(x, x, x, x - half, x + half, rho, iteration=5, scale=1.0)
    sub = approximate(problem, state, f, df, rho, move=0.3)
    low, upp = x - half, x + half
    plus, minus = np.maximum(df, 0), np.maximum(-df, 0)
    p = (upp - x) ** 2 * (1.001 * plus + 0.001 * minus + rho[:, None])
    q = (x - low) ** 2 * (0.001 * plus + 1.001 * minus + rho[:, None])
    x_new = x + 0.5 * half * rng.uniform(-1, 1, 9)
    expected = f + np.sum(p / (upp - x_new) + q / (x_new - low) - p / (upp - x) - q / (x - low), axis=1)
    r = (x_new - low) / (upp - x_new)
    np.testing.assert_allclose(approximation(sub, r), expected, rtol=1e-12)  # cancellation in `expected`
    farthest = np.minimum(np.minimum(0.3, 0.9 * half), x)  # move limit, a tenth to the asymptote, bound
    np.testing.assert_allclose((1 - sub.r_min) / (1 + sub.r_min) * half, farthest, rtol=1e-12)  # round-off


def test_asymptotes_follow_the_signs_of_the_steps() -> None:
    problem, x, one = ripples(3), np.full(3, 0.5), np.ones(3)
    older, old = np.array([0.3, 0.3, 0.5]), np.array([0.4, 0.6, 0.5])  # went on, turned, stood still
    state = State(x, old, older, old - 0.2, old + 0.2, np.zeros(2), iteration=2, scale=1.0)
    sub = approximate(problem, state, np.zeros(2), np.stack([one, one]), np.full(2, 0.1), move=0.3)
    np.testing.assert_allclose(sub.sigma, [0.24, 0.14, 0.2], rtol=1e-14)  # 1.2, 0.7 and 1 times 0.2
    first = approximate(
        problem, replace(state, iteration=1), np.zeros(2), np.stack([one, one]), np.full(2, 0.1), move=0.3
    )
    np.testing.assert_array_equal(first.sigma, 0.5)
    for half, limit in ((0.012, 0.01), (9.0, 10.0)):
        extreme = replace(state, low=-half * one, upp=half * one)
        sub = approximate(problem, extreme, np.zeros(2), np.stack([one, one]), np.full(2, 0.1), move=0.3)
        assert limit in sub.sigma  # in ranges of the variables


@pytest.mark.parametrize(("step", "factor"), [(1e-7, 0.7), (1e-11, 1.0)])
def test_only_steps_above_rounding_move_an_asymptote(step: float, factor: float) -> None:
    """A turn of 1e-7 of the range is the rule's own; one of 1e-11 is the rounding of the dual's solution."""
    x, one = np.full(3, 0.5), np.ones(3)
    state = State(x, x - step, x, x - 0.2, x + 0.2, np.zeros(2), iteration=2, scale=1.0)
    sub = approximate(ripples(3), state, np.zeros(2), np.stack([one, one]), np.full(2, 0.1), move=0.3)
    np.testing.assert_allclose(sub.sigma, factor * 0.2, rtol=1e-14)  # rounding
