"""Problems in closed form that the tests of the optimiser share."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mpmtop.arrays import Array
from mpmtop.optimizers import GCMMA, MMA, Iterate, OptimalityCriteria, SingleStepGCMMA, State, UpdateRule, initial_state

Function = Callable[[Array], Any]
RULES: list[UpdateRule] = [MMA(), GCMMA(), GCMMA(warm_start=True), SingleStepGCMMA()]
ALL_RULES: list[UpdateRule] = [*RULES, OptimalityCriteria()]


@dataclass(frozen=True, eq=False)
class Values:
    x: Array
    objective: float
    constraints: Array


@dataclass(eq=False)
class Analytic:
    """A problem from closed-form functions and derivatives; counts its calls."""

    f: Function
    df: Function
    g: Function
    dg: Function
    x0: Array
    lower: Array
    upper: Array
    fingerprint: str = "analytic"
    calls: list[str] = field(default_factory=list)

    def evaluate(self, x: Array) -> Values:
        self.calls.append("evaluate")
        return Values(x, float(self.f(x)), np.atleast_1d(self.g(x)))

    def gradient(self, evaluation: Values) -> tuple[Array, Array]:
        self.calls.append("gradient")
        return self.df(evaluation.x), np.atleast_2d(self.dg(evaluation.x))


def cantilever() -> Analytic:
    """Svanberg (1987): weight of a cantilever of five hollow segments under a limit on its tip deflection."""
    c = np.array([61.0, 37, 19, 7, 1])
    return Analytic(
        lambda x: 0.0624 * np.sum(x),
        lambda x: np.full(5, 0.0624),
        lambda x: np.sum(c / x**3) - 1,
        lambda x: -3 * c / x**4,
        np.full(5, 5.0),
        np.full(5, 1.0),
        np.full(5, 10.0),
    )


def spheres() -> Analytic:
    """Svanberg (2007): the point nearest to the origin in two balls."""
    centre = np.array([[5.0, 2, 1], [3, 4, 3]])
    return Analytic(
        lambda x: x @ x,
        lambda x: 2 * x,
        lambda x: np.sum((x - centre) ** 2, axis=1) - 9,
        lambda x: 2 * (x - centre),
        np.array([4.0, 3, 2]),
        np.zeros(3),
        np.full(3, 5.0),
    )


def ripples(n: int = 20) -> Analytic:
    """A bowl with ripples too short for the first-order information of one point, under a bound on the mean."""
    centre = np.linspace(0.2, 0.8, n)
    return Analytic(
        lambda x: 1 + np.sum((x - centre) ** 2 + 0.05 * np.sin(30 * x)),
        lambda x: 2 * (x - centre) + 1.5 * np.cos(30 * x),
        lambda x: np.mean(x) / 0.5 - 1,
        lambda x: np.full(n, 2 / n),
        np.full(n, 0.5),
        np.zeros(n),
        np.ones(n),
    )


def bars(c: Array, v: Array, **bounds: float) -> Analytic:
    """min sum c / x subject to sum v x <= 1, whose optimum is x = sqrt(c / v) / sum sqrt(c v) inside the bounds."""
    n = len(c)
    return Analytic(
        lambda x: np.sum(c / x),
        lambda x: -c / x**2,
        lambda x: v @ x - 1,
        lambda x: v,
        np.full(n, 1 / np.sum(v)),
        np.full(n, bounds.get("lower", 1e-3)),
        np.full(n, bounds.get("upper", 1.0)),
    )


def steps(problem: Analytic, rule: UpdateRule, n: int) -> tuple[State, list[Values], int]:
    """The state after n updates, the evaluations from x0 on, and the solves reported."""
    evaluation = problem.evaluate(problem.x0)
    state, history, solves = initial_state(problem, evaluation), [evaluation], 1
    for _ in range(n):
        state, evaluation, spent = rule.step(problem, state, evaluation, *problem.gradient(evaluation))
        np.testing.assert_array_equal(evaluation.x, state.x)
        history.append(evaluation)
        solves += spent
    return state, history, solves


@dataclass(eq=False)
class Bars:
    """min sum c / x + ripples subject to mean x <= 0.4 and a second, idle constraint if `idle`; counts its calls."""

    c: Array = field(default_factory=lambda: np.linspace(0.1, 2, 30))
    idle: bool = False
    fingerprint: str = "bars"
    evaluations: int = 0
    gradients: int = 0

    @property
    def x0(self) -> Array:
        return np.full(len(self.c), 0.4)

    @property
    def lower(self) -> Array:
        return np.full(len(self.c), 0.05)

    @property
    def upper(self) -> Array:
        return np.ones(len(self.c))

    def evaluate(self, x: Array) -> Values:
        self.evaluations += 1
        g = [np.mean(x) / 0.4 - 1, -1.0 - x[0]]
        return Values(x, float(np.sum(self.c / x + 0.2 * np.sin(9 * x))), np.array(g[: 1 + self.idle]))

    def gradient(self, evaluation: Values) -> tuple[Array, Array]:
        self.gradients += 1
        x, n = evaluation.x, len(self.c)
        dg = np.stack([np.full(n, 1 / (0.4 * n)), -np.eye(n)[0]])
        return -self.c / x**2 + 1.8 * np.cos(9 * x), dg[: 1 + self.idle]


def same(a: Iterate[Values], b: Iterate[Values]) -> bool:
    """Bit for bit, converged and solves included."""
    return (
        (a.iteration, a.solves, a.objective, a.converged) == (b.iteration, b.solves, b.objective, b.converged)
        and np.array_equal(a.x, b.x)
        and np.array_equal(a.constraints, b.constraints)
    )
