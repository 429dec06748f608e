"""The largest of several objectives: both rules come to what another optimiser finds with a bound variable."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import minimize

from mpmtop.arrays import Array
from mpmtop.optimizers import GCMMA, MMA, OptimalityCriteria, optimize, relative_change
from mpmtop.optimizers.protocols import UpdateRule
from mpmtop.optimizers.subproblem import Subproblem, approximation, solve_multiple


@dataclass(frozen=True, eq=False)
class Values:
    """Objectives (k,) and the constraint of a design."""

    x: Array
    objectives: Array
    constraints: Array

    @property
    def objective(self) -> float:
        return float(self.objectives.max())


@dataclass(frozen=True, eq=False)
class Frames:
    """Minimise max_l sum_j c_lj / x_j with sum_j x_j <= n / 2: bars that k loads pull differently."""

    c: Array
    fingerprint: str = "frames"

    @property
    def x0(self) -> Array:
        return np.full(self.c.shape[1], 0.5)

    @property
    def lower(self) -> Array:
        return np.full(self.c.shape[1], 0.01)

    @property
    def upper(self) -> Array:
        return np.ones(self.c.shape[1])

    def evaluate(self, x: Array) -> Values:
        return Values(x, self.c @ (1 / x), np.array([x.mean() / 0.5 - 1]))

    def gradient(self, evaluation: Values) -> tuple[Array, Array]:
        n = len(evaluation.x)
        return -self.c / evaluation.x**2, np.full((1, n), 2 / n)

    def by_bound_variable(self) -> tuple[Array, float]:
        """x and z of the least z with c_l . 1/x <= z, by sequential quadratic programming."""
        n = self.c.shape[1]
        above = {"type": "ineq", "fun": lambda v: v[-1] - self.c @ (1 / v[:-1])}
        volume = {"type": "ineq", "fun": lambda v: 0.5 * n - v[:-1].sum()}
        start = np.append(self.x0, np.max(self.c @ (1 / self.x0)))
        bounds = [*zip(self.lower, self.upper, strict=True), (0, None)]
        found = minimize(lambda v: v[-1], start, bounds=bounds, constraints=[above, volume], options={"ftol": 1e-12})
        assert found.success
        return found.x[:-1], found.x[-1]


def frames(k: int) -> Frames:
    """Cases of the same optimum each by itself, so that none decides alone."""
    c = np.random.default_rng(k).uniform(0.1, 2, (k, 8))
    return Frames(c / np.sqrt(c).sum(axis=1, keepdims=True) ** 2)


@pytest.mark.parametrize("k", [2, 3, 5])
@pytest.mark.parametrize("rule", [MMA(), GCMMA()], ids=["MMA", "GCMMA"])
def test_agrees_with_a_bound_variable(rule: UpdateRule, k: int) -> None:
    """To 1e-4, what both stop at; several cases are active, and no design beats the worst of them by another's help."""
    problem = frames(k)
    *_, last = optimize(problem, rule, stop=relative_change(1e-7))
    x, z = problem.by_bound_variable()
    assert last.converged
    assert last.objective == pytest.approx(z, rel=1e-4)
    active = problem.c @ (1 / x) > z * (1 - 1e-5)
    assert np.count_nonzero(active) >= 2
    np.testing.assert_allclose(last.evaluation.objectives[active], z, rtol=1e-4)


def test_one_objective_of_several_that_is_always_the_largest() -> None:
    """It decides alone: the same optimum as of it alone."""
    c = np.random.default_rng(0).uniform(0.1, 2, 8)
    *_, alone = optimize(Frames(c[None]), GCMMA(), stop=relative_change(1e-7))
    *_, both = optimize(Frames(np.stack([c, 0.3 * c])), GCMMA(), stop=relative_change(1e-7))
    assert both.objective == pytest.approx(alone.objective, rel=1e-6)
    np.testing.assert_allclose(both.x, alone.x, atol=1e-2)  # flat around the optimum: the square root of 1e-6, and some


def test_the_largest_cannot_rise() -> None:
    """Accepted by GCMMA is a design where no approximation is too small, of no objective."""
    worst = [iterate.objective for iterate in optimize(frames(3), GCMMA(), max_iterations=15)]
    assert np.all(np.diff(worst) <= 1e-9 * worst[0])


def test_subproblem_is_at_its_minimum() -> None:
    """Multipliers of the objectives sum to one and stand on the largest alone; no nearby r is better and feasible."""
    rng = np.random.default_rng(1)
    n, k = 6, 3
    p, q = rng.uniform(0.1, 1, (2, k + 1, n))
    values = np.append(rng.uniform(0, 0.3, k), -0.05)  # feasible at r = 1
    sub = Subproblem(values, p, q, np.ones(n), np.full(n, 0.5), np.full(n, 2.0), objectives=k)
    r, lam = solve_multiple(sub)
    f = approximation(sub, r)
    assert lam[:k].sum() == pytest.approx(1, abs=1e-12) and f[k] <= 1e-9
    z = f[:k].max()
    np.testing.assert_allclose(lam[:k] * (f[:k] - z), 0, atol=1e-9)
    for _ in range(200):
        other = np.clip(r + rng.normal(scale=1e-3, size=n), sub.r_min, sub.r_max)
        g = approximation(sub, other)
        assert g[:k].max() >= z - 1e-9 or g[k] > 0


def test_optimality_criteria_are_not_for_it() -> None:
    with pytest.raises(ValueError, match="one objective and one constraint"):
        list(optimize(frames(2), OptimalityCriteria()))
