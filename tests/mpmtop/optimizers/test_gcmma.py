"""The conservative loop, and its curvatures."""

from dataclasses import replace

import numpy as np
import pytest

from mpmtop.errors import NotConverged, PointOutsideGrid
from mpmtop.optimizers import GCMMA, MMA, SingleStepGCMMA, initial_state
from mpmtop.optimizers.mma import approximate
from mpmtop.optimizers.subproblem import approximation
from tests.mpmtop.optimizers.problems import RULES, cantilever, ripples, steps


def test_gcmma_never_rises_where_mma_does() -> None:
    objectives = {rule: np.array([e.objective for e in steps(ripples(), rule, 40)[1]]) for rule in RULES}
    assert np.count_nonzero(np.diff(objectives[MMA()]) > 1e-3) >= 3
    for rule in (GCMMA(), GCMMA(warm_start=True)):
        # the conservative test leaves 1e-9 of the objective, and as much for the constraint's multiplier
        assert np.max(np.diff(objectives[rule])) <= 1e-8 * objectives[rule][0]
        assert objectives[rule][-1] < objectives[rule][0] - 0.5
    with_memory = steps(ripples(), GCMMA(warm_start=True), 40)[2]
    assert with_memory < steps(ripples(), GCMMA(), 40)[2]


def test_inner_iterations_are_limited() -> None:
    _, _, solves = steps(ripples(), GCMMA(max_inner=2), 10)
    assert 11 < solves <= 21


@pytest.mark.parametrize("error", [NotConverged, PointOutsideGrid])
def test_a_design_without_an_answer_is_stepped_back_from(error: type[Exception]) -> None:
    """As in large deformation, where a trial may have no equilibrium: the run goes on, nearer to the last design; and
    says so if no try is left."""
    base = ripples()

    def f(x: np.ndarray) -> float:
        if np.max(x) > np.max(base.x0) + 0.05:
            raise error("too far")
        return base.f(x)

    cliff = replace(base, f=f)
    for rule in (GCMMA(), GCMMA(warm_start=True)):
        last, history, solves = steps(cliff, rule, 10)
        assert np.all(np.diff([e.objective for e in history]) <= 1e-8 * history[0].objective)
        assert history[-1].objective < history[0].objective
        assert last.x.max() > np.max(base.x0) + 0.025 and solves > 11
    with pytest.raises(error, match="too far"):
        steps(cliff, GCMMA(max_inner=1), 10)


def test_curvatures_are_svanbergs() -> None:
    """MMA keeps 1e-5; the single step has a tenth of the mean slope; the warm start halves what was accepted last."""
    slope = [0.1 * np.mean(np.abs(ripples().df(ripples().x0))) / abs(ripples().f(ripples().x0)), 0.1 * 2 / 20]
    np.testing.assert_array_equal(steps(ripples(), MMA(), 1)[0].curvature, 1e-5)  # raa0 of the 2007 notes
    np.testing.assert_allclose(steps(ripples(), SingleStepGCMMA(), 1)[0].curvature, slope, rtol=1e-13)  # round-off
    problem, rule = cantilever(), GCMMA(warm_start=True, max_inner=1)  # one solve: the curvature it began with
    first, history, _ = steps(problem, rule, 2)
    second, _, _ = rule.step(problem, first, history[-1], *problem.gradient(history[-1]))
    np.testing.assert_array_equal(second.curvature, np.maximum(1e-6, first.curvature / 2))


@pytest.mark.parametrize(("excess", "factor"), [(1e9, 10.0), (1e-3, None)])
def test_curvature_grows_by_what_was_missing(excess: float, factor: float | None) -> None:
    """min(1.1 (rho + delta), 10 rho), delta = (f - f~) / d with Svanberg's d (2002) in terms of x, l and u."""
    base = ripples(5)
    first, history, _ = steps(base, GCMMA(max_inner=1), 1)
    start = initial_state(base, history[0])
    df = np.vstack([start.scale * base.df(base.x0), base.dg(base.x0)])
    f = np.append(start.scale * history[0].objective, history[0].constraints)
    sub = approximate(base, start, f, df, first.curvature, 0.3)
    x, low, upp = first.x, first.low, first.upp
    predicted = approximation(sub, (x - low) / (upp - x))[0] / start.scale
    shown = replace(base, f=lambda z: predicted + excess if np.array_equal(z, x) else base.f(z))
    second, _, solves = steps(shown, GCMMA(max_inner=2), 1)
    assert solves == 3
    d = np.sum((upp - low) * (x - base.x0) ** 2 / ((upp - x) * (x - low)))
    rho = first.curvature[0]
    expected = factor * rho if factor else 1.1 * (rho + excess * start.scale / d)
    assert expected <= 10 * rho
    np.testing.assert_allclose(second.curvature[0], expected, rtol=1e-9)  # `predicted` is exact to 1e-13 of the excess
    assert second.curvature[1] == first.curvature[1]  # the mean is linear: conservative at once


def test_flat_functions_keep_the_least_curvature() -> None:
    """Without a slope Svanberg's first curvature is 1e-6, for the single step and the warm start alike."""
    flat = replace(ripples(), df=lambda x: np.zeros(20), dg=lambda x: np.zeros((1, 20)))
    for rule in (SingleStepGCMMA(), GCMMA(warm_start=True, max_inner=1)):
        np.testing.assert_array_equal(steps(flat, rule, 3)[0].curvature, 1e-6)
