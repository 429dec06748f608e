"""What the optimisation loop hands out, and when it stops."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mpmtop.optimize import GCMMA, MMA, History, UpdateRule, design_change, optimize, relative_change
from mpmtop.scene import NotConverged
from tests.mpmtop.optimize.problems import ALL_RULES, Bars


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
        with pytest.raises(ValueError, match="give at least 0 and 1"):
            next(optimize(Bars(), MMA(), **wrong))  # type: ignore[arg-type]


def test_values_that_are_not_finite_end_the_run_by_name() -> None:
    with pytest.raises(NotConverged, match="iteration 0: objective nan"):
        list(optimize(Bars(c=np.full(30, np.nan)), MMA()))
