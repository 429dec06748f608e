"""What the optimisation loop hands out, and when it stops."""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.errors import NotConverged
from mpmtop.optimizers import (
    GCMMA,
    MMA,
    History,
    Infeasible,
    Stage,
    UpdateRule,
    continuation,
    design_change,
    optimize,
    relative_change,
)
from tests.mpmtop.optimizers.problems import ALL_RULES, Analytic, Bars, steps


@pytest.mark.parametrize("rule", ALL_RULES, ids=repr)
def test_objective_belongs_to_the_design_and_solves_are_counted(rule: UpdateRule) -> None:
    problem = Bars()
    for k, iterate in enumerate(optimize(problem, rule, max_iterations=8, stop=lambda history: False)):
        assert iterate.iteration == k == problem.gradients
        assert iterate.solves == problem.evaluations
        expected = Bars().evaluate(iterate.x)
        assert iterate.objective == iterate.evaluation.objective == expected.objective
        np.testing.assert_array_equal(iterate.constraints, expected.constraints)
        np.testing.assert_array_equal(iterate.evaluation.x, iterate.x)
        if k == 0:
            np.testing.assert_array_equal(iterate.x, problem.x0)
    assert k == 8
    assert not iterate.converged


def test_all_constraints_are_recorded() -> None:
    for iterate in optimize(Bars(idle=True), GCMMA(), max_iterations=5):
        np.testing.assert_array_equal(iterate.constraints[1], -1 - iterate.x[0])


@pytest.mark.parametrize("rule", ALL_RULES, ids=repr)
def test_the_loop_ends_when_the_rule_is_first_met(rule: UpdateRule) -> None:
    iterates = list(optimize(Bars(), rule))
    J = np.array([iterate.objective for iterate in iterates])
    assert [iterate.converged for iterate in iterates] == [False] * (len(J) - 1) + [True]
    met = [k for k in range(4, len(J)) if np.max(np.abs(J[k] - J[k - 4 : k])) <= 1e-4 * abs(J[k])]
    assert met == [len(J) - 1]


def test_no_update_at_all_and_an_unused_generator() -> None:
    problem = Bars()
    run = optimize(problem, MMA(), max_iterations=0)
    assert problem.evaluations == 0
    (only,) = run
    assert (only.iteration, only.solves, only.converged) == (0, 1, False)
    assert (problem.evaluations, problem.gradients) == (1, 0)


def history(*objective: float, change: float = 1.0) -> History:
    return History(np.array(objective), np.array([0.5, 0.5 + change]), np.array([0.5, 0.5]))


def test_relative_change() -> None:
    rule = relative_change()
    assert not rule(history(1, 1, 1, 1))  # three earlier iterations only
    assert rule(history(9, 1, 1, 1, 1, 1))
    assert rule(history(1.00009, 1, 1, 1, 1))
    assert not rule(history(1.00011, 1, 1, 1, 1))  # the oldest of the four counts
    assert not rule(history(1, 1, 1, 1.00011, 1))  # and the latest
    assert rule(history(-1.00009, -1, -1, -1, -1))
    assert not rule(history(1, 2, 1, 2, 1))
    assert relative_change(tol=0.6, window=1)(history(5, 1, 2))
    assert not relative_change(tol=0.6, window=2)(history(5, 1, 2))


def test_design_change() -> None:
    rule = design_change(0.01)
    assert rule(history(2, 1, change=0.009))
    assert rule(history(2, 1, change=-0.009))
    assert not rule(history(2, 1, change=0.011))
    assert not rule(history(2, change=0.0))  # x0 has no predecessor
    last = list(optimize(Bars(), MMA(), stop=rule))[-2:]
    assert last[1].converged
    assert np.max(np.abs(last[1].x - last[0].x)) <= 0.01


@pytest.mark.parametrize(
    "call", [lambda: relative_change(-1), lambda: relative_change(window=0), lambda: design_change(-1)]
)
def test_stopping_rules_refuse_nonsense(call: Callable[[], Any]) -> None:
    with pytest.raises(ValueError, match="give a tolerance"):
        call()


def test_arguments_are_checked() -> None:
    for wrong in ({"max_iterations": -1}, {"checkpoint_every": 0}):
        with pytest.raises(ValueError, match="give at least"):
            next(optimize(Bars(), MMA(), **wrong))  # type: ignore[arg-type]


def test_values_that_are_not_finite_end_the_run_by_name() -> None:
    with pytest.raises(NotConverged, match="iteration 0: objective nan"):
        list(optimize(Bars(c=np.full(30, np.nan)), MMA()))


def sum_limited(shift: float, bound: float = 0.5) -> Analytic:
    """min shift - (x1 + x2), x1 + x2 <= bound on [0, 1]^2, in the form of a constraint of order one."""
    return Analytic(
        lambda x: shift - np.sum(x),
        lambda x: -np.ones(2),
        lambda x: (np.sum(x) - bound) / abs(bound),
        lambda x: np.ones((1, 2)) / abs(bound),
        np.full(2, 0.2),
        np.zeros(2),
        np.ones(2),
    )


@pytest.mark.parametrize("rule", ALL_RULES, ids=repr)
@pytest.mark.parametrize("at_start", [1.0, 1e-4, -1e-6, 1e-17, 1e3, 1e9])
def test_the_origin_of_the_objective_does_not_matter(at_start: float, rule: UpdateRule) -> None:
    """The optimum is (1/4, 1/4) whatever the objective is at the start, next to nothing or far too much."""
    *_, last = optimize(sum_limited(0.4 + at_start), rule, max_iterations=50)
    assert last.outcome == "converged"
    np.testing.assert_allclose(last.x, 0.25, atol=1e-8)  # MMA's curvature; far below the stopping rule
    assert last.constraints[0] <= 1e-9  # what the subproblem may leave


@pytest.mark.parametrize("rule", ALL_RULES, ids=repr)
def test_what_cannot_be_met_is_infeasible(rule: UpdateRule) -> None:
    """A sum of at most -0.1 of variables >= 0: least violation 1, named, with a warning, and not converged."""
    problem = sum_limited(1.0, -0.1)
    with pytest.warns(Infeasible, match=r"constraint 0 at 1, above"):
        *_, last = optimize(problem, rule, max_iterations=100)
    assert (last.outcome, last.converged) == ("infeasible", False)
    np.testing.assert_allclose(last.x, 0, atol=1e-3)  # the stopping rule's, of a violation of 1


@pytest.mark.parametrize(
    ("least", "feasible", "outcome"),
    [(1.5e-3, None, "infeasible"), (1.5e-3, 2e-3, "converged"), (6e-4, None, "converged"), (6e-4, 5e-4, "infeasible")],
)
def test_converged_means_feasible_to_the_tolerance(least: float, feasible: float | None, outcome: str) -> None:
    """Bounds leave a violation of 6e-4, as the published bisection does, or 1.5e-3; `feasible` says what counts."""
    problem = sum_limited(1.0)
    problem.lower, problem.x0 = np.full(2, 0.25 * (1 + least)), np.full(2, 0.3)
    given = {} if feasible is None else {"feasible": feasible}
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        *_, last = optimize(problem, MMA(), max_iterations=60, **given)  # type: ignore[arg-type]
    assert last.outcome == outcome
    assert len(said) == (outcome == "infeasible")
    assert last.constraints[0] == pytest.approx(least, abs=1e-8)  # the penalty's remainder
    assert list(optimize(problem, MMA(), max_iterations=2))[-1].outcome == "max_iterations"


def test_an_objective_that_falls_by_orders_of_magnitude_is_scaled_anew() -> None:
    """Below a slope of 1e-3 of the start's objective; above, the start's scale stands."""
    problem = sum_limited(1.0)
    for offset, anew in ((1.9e3, False), (2.1e3, True)):  # the slope is 2, the objective at the start 2 / slope
        problem.f = lambda x, offset=offset: offset - np.sum(x)
        state, _, _ = steps(problem, MMA(), 1)
        assert state.scale == pytest.approx(0.5 if anew else 1 / (offset - 0.4), rel=1e-12)  # rounding


@pytest.mark.parametrize(
    ("start", "words"),
    [(np.full(3, 0.2), "a value for each"), (np.full(30, 2.0), "clip it"), (np.full(30, np.nan), "clip it")],
)
def test_unusable_starts_are_refused(start: Array, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        optimize(Bars(), MMA(), start=start)
    with pytest.raises(TypeError, match="does not say where its variables are"):
        optimize(Bars(), MMA(), start=lambda x: x[:, 0])


@pytest.mark.parametrize("rule", ALL_RULES, ids=repr)
def test_a_run_starts_where_it_is_told(rule: UpdateRule) -> None:
    given = np.random.default_rng(0).uniform(0.1, 0.6, 30)
    *_, last = optimize(Bars(), rule, start=given, max_iterations=1)
    np.testing.assert_array_equal(next(optimize(Bars(), rule, start=given)).x, given)
    assert np.max(np.abs(last.x - given)) <= 0.3 + 1e-12  # the move limit
    np.testing.assert_array_equal(next(optimize(Bars(), rule, start=0.3)).x, np.full(30, 0.3))


def test_stages_go_on_from_each_other() -> None:
    stages = [Stage(Bars(), GCMMA(), max_iterations=4), Stage(Bars(c=np.linspace(3, 1, 30)), MMA(0.1))]
    iterates = list(continuation(stages))
    first = [i for i in iterates if i.stage == 0]
    second = [i for i in iterates if i.stage == 1]
    assert [i.iteration for i in first] == list(range(5))
    assert first[-1].outcome == "max_iterations"
    np.testing.assert_array_equal(second[0].x, first[-1].x)
    assert (second[0].iteration, second[0].solves) == (0, first[-1].solves + 1)
    alone = list(optimize(Bars(c=np.linspace(3, 1, 30)), MMA(0.1), start=first[-1].x))
    np.testing.assert_array_equal(second[-1].x, alone[-1].x)
    with pytest.raises(ValueError, match="give a list of one `Stage"):
        continuation([])
