"""Every update rule on published optima and hand-solvable problems."""

from dataclasses import replace

import numpy as np
import pytest

from mpmtop.errors import NotConverged
from mpmtop.optimizers import GCMMA, MMA, OptimalityCriteria, SingleStepGCMMA, UpdateRule
from tests.mpmtop.optimizers.problems import ALL_RULES, RULES, Analytic, cantilever, ripples, spheres, steps


@pytest.mark.parametrize("rule", RULES, ids=repr)
def test_cantilever_reaches_the_published_weight(rule: UpdateRule) -> None:
    _, history, _ = steps(cantilever(), rule, 30)
    assert abs(history[-1].objective - 1.339956) <= 5e-7  # the published digits
    assert history[-1].constraints[0] <= 1e-9  # Newton's dual is exact to 1e-13, the remaining step is second order
    np.testing.assert_allclose(history[-1].x, [6.0160, 5.3092, 4.4943, 3.5015, 2.1527], atol=2e-4)  # flat optimum


@pytest.mark.parametrize("rule", RULES, ids=repr)
def test_spheres_reach_the_published_distance(rule: UpdateRule) -> None:
    _, history, _ = steps(spheres(), rule, 30)
    assert abs(history[-1].objective - 8.770246) <= 5e-7  # the published digits
    np.testing.assert_allclose(history[-1].constraints, 0, atol=1e-8)  # both are active; second order in the last step


@pytest.mark.parametrize("rule", RULES, ids=repr)
def test_every_solve_is_counted_and_gradients_are_taken_once(rule: UpdateRule) -> None:
    problem = ripples()
    _, _, solves = steps(problem, rule, 10)
    assert problem.calls.count("evaluate") == solves
    assert problem.calls.count("gradient") == 10
    assert (solves > 11) == isinstance(rule, GCMMA)


@pytest.mark.parametrize("rule", RULES, ids=repr)
def test_infeasible_start_recovers(rule: UpdateRule) -> None:
    problem = replace(cantilever(), x0=np.full(5, 1.5))  # deflection 36 times the limit
    _, history, _ = steps(problem, rule, 40)
    assert history[0].constraints[0] > 30
    assert abs(history[-1].objective - 1.339956) <= 1e-6  # the published digits
    assert history[-1].constraints[0] <= 1e-7  # second order in the last step


@pytest.mark.parametrize("rule", ALL_RULES, ids=repr)
def test_move_limit_holds_and_fixed_variables_stay(rule: UpdateRule) -> None:
    problem = ripples()
    problem.lower[3] = problem.upper[3] = problem.x0[3]
    problem.dg = lambda x: np.where(np.arange(20) == 3, 0.0, 2 / 20)  # a fixed variable has no say
    _, history, _ = steps(problem, rule, 10)
    x = np.array([e.x for e in history])
    assert np.all(x[:, 3] == 0.5)
    change = np.max(np.abs(np.diff(x, axis=0)))
    assert 0.1 < change <= rule.move + 1e-15  # type: ignore[attr-defined]


@pytest.mark.parametrize("rule", RULES, ids=repr)
def test_the_unit_of_the_objective_does_not_matter(rule: UpdateRule) -> None:
    """A power of two changes no mantissa: the designs agree bit for bit."""
    one, big = ripples(), ripples()
    big.f, big.df = lambda x: 2**40 * one.f(x), lambda x: 2**40 * one.df(x)
    np.testing.assert_array_equal(steps(one, rule, 8)[0].x, steps(big, rule, 8)[0].x)


@pytest.mark.parametrize("rule", ALL_RULES, ids=repr)
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_values_that_are_not_finite_name_the_iteration(rule: UpdateRule, bad: float) -> None:
    def broken_after(n: int, problem: Analytic) -> Analytic:
        f = problem.f
        return replace(problem, f=lambda x: bad if problem.calls.count("evaluate") > n else f(x), calls=problem.calls)

    with pytest.raises(NotConverged, match="iteration 0: objective"):
        steps(broken_after(0, ripples()), rule, 3)
    with pytest.raises(NotConverged, match="iteration 1: objective"):
        steps(broken_after(1, ripples()), rule, 3)
    with pytest.raises(NotConverged, match="iteration 0: 20 derivatives"):
        steps(replace(ripples(), df=lambda x: np.full(20, bad)), rule, 3)


def test_unusable_problems_are_refused() -> None:
    for change, words in (
        ({"x0": np.full(20, 2.0)}, "within finite bounds"),
        ({"upper": np.full(20, np.inf)}, "within finite bounds"),
        ({"lower": np.zeros(3)}, "one length"),
        ({"g": lambda x: np.zeros(0)}, "no constraint"),
    ):
        with pytest.raises(ValueError, match=words):
            steps(replace(ripples(), **change), MMA(), 1)
    with pytest.raises(ValueError, match="derivatives of shape"):
        steps(replace(ripples(), dg=lambda x: np.zeros((2, 20))), MMA(), 1)
    for rule in (MMA, GCMMA, SingleStepGCMMA, OptimalityCriteria):
        with pytest.raises(ValueError, match="move"):
            rule(move=0.0)
    with pytest.raises(ValueError, match="max_inner"):
        GCMMA(max_inner=0)


@pytest.mark.parametrize("rule", RULES, ids=repr)
def test_the_worst_of_two_cases_by_a_bound_variable(rule: UpdateRule) -> None:
    """min z, f_k(x) - z <= 0 with bars under two mirrored loads, sum x <= 1, beside the symmetric optimum.

    Both cases are active; by symmetry x = (a, b, a), 2a + b = 1, with f = (c1 + c3) / a + c2 / b least.
    """
    c = np.array([[1.0, 0.3, 0.2], [0.2, 0.3, 1.0]])
    problem = Analytic(
        lambda v: v[3],
        lambda v: np.eye(4)[3],
        lambda v: np.append((c / v[:3]).sum(axis=1) / v[3] - 1, v[:3].sum() - 1),
        lambda v: np.vstack(
            [np.column_stack([-c / v[:3] ** 2 / v[3], -(c / v[:3]).sum(axis=1) / v[3] ** 2]), [1, 1, 1, 0]]
        ),
        np.array([0.2, 0.5, 0.3, 10.0]),
        np.array([0.01, 0.01, 0.01, 0.1]),
        np.array([1.0, 1.0, 1.0, 100.0]),
    )
    _, history, _ = steps(problem, rule, 60)
    a = np.sqrt(1.2 / 2) / (np.sqrt(2 * 1.2) + np.sqrt(0.3))
    expected = 1.2 / a + 0.3 / (1 - 2 * a)
    assert abs(history[-1].objective / expected - 1) <= 1e-4  # as asked; the rules are at 1e-6
    np.testing.assert_allclose(history[-1].x[:3], [a, 1 - 2 * a, a], atol=1e-3)  # the optimum is flat
    np.testing.assert_allclose(history[-1].constraints, 0, atol=1e-4)  # all are active
