"""Optimality criteria on the separable problem, beside GCMMA, and at their edges."""

from dataclasses import replace

import numpy as np
import pytest

from mpmtop.optimizers import GCMMA, OptimalityCriteria
from tests.mpmtop.optimizers.problems import bars, spheres, steps


def test_optimality_criteria_solve_the_separable_problem_in_one_step() -> None:
    """x sqrt(c / x^2 / (lam v)) does not depend on x."""
    rng = np.random.default_rng(2)
    c, v = rng.uniform(0.5, 2, 30), rng.uniform(0.5, 2, 30)
    _, history, _ = steps(bars(c, v), OptimalityCriteria(move=1), 1)
    np.testing.assert_allclose(history[1].x, np.sqrt(c / v) / np.sum(np.sqrt(c * v)), rtol=1e-12)  # brentq's round-off


def test_optimality_criteria_and_gcmma_agree_with_bounds_active() -> None:
    rng = np.random.default_rng(4)
    c, v = 10 ** rng.uniform(-3, 1, 30), rng.uniform(0.5, 2, 30)
    problem = bars(c, v, upper=0.08)
    _, oc, _ = steps(problem, OptimalityCriteria(), 40)
    _, mma, _ = steps(problem, GCMMA(), 100)
    assert np.count_nonzero(oc[-1].x == 0.08) >= 3
    assert all(abs(e.constraints[0]) <= 1e-13 for e in oc)  # linear, so the linearisation is exact up to round-off
    assert abs(oc[-1].objective / mma[-1].objective - 1) <= 1e-6  # both converge linearly


def test_optimality_criteria_at_their_edges() -> None:
    c, v = np.ones(4), np.full(4, 0.25)
    infeasible = replace(bars(c, v), x0=np.full(4, 1.0), g=lambda x: v @ x - 0.1)
    _, history, _ = steps(infeasible, OptimalityCriteria(), 3)
    np.testing.assert_allclose(
        [e.x[0] for e in history], 1 - 0.2 * 0.999 * np.arange(4), rtol=1e-14
    )  # as fast as it can
    idle = replace(bars(c, v), x0=np.full(4, 0.5), g=lambda x: v @ x - 2)
    np.testing.assert_allclose(steps(idle, OptimalityCriteria(), 3)[0].x, 1.0)  # all the material that is allowed
    rising = replace(bars(c, v), x0=np.full(4, 0.5), df=lambda x: np.array([-1.0, -1, 1, 2]), g=lambda x: v @ x - 0.5)
    _, history, _ = steps(rising, OptimalityCriteria(), 1)
    np.testing.assert_allclose(history[1].x, [0.5 + 0.1998] * 2 + [0.5 - 0.1998] * 2, rtol=1e-12)  # round-off
    with pytest.raises(ValueError, match="one constraint"):
        steps(spheres(), OptimalityCriteria(), 1)
    with pytest.raises(ValueError, match="grows with every variable"):
        steps(replace(bars(c, v), dg=lambda x: -v), OptimalityCriteria(), 1)
