"""Update rules against published optima, hand-solvable problems, and Svanberg's formulas in their original form."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import nnls

import mpmtop.subproblem as subproblem
from mpmtop.gcmma import (
    GCMMA,
    MMA,
    MMA_CURVATURE,
    OptimalityCriteria,
    SingleStepGCMMA,
    State,
    UpdateRule,
    approximate,
    initial_state,
)
from mpmtop.scene import Array, NotConverged
from mpmtop.subproblem import PENALTY, Subproblem, approximation, solve_multiple, solve_single

Function = Callable[[Array], Any]
RULES: list[UpdateRule] = [MMA(), GCMMA(), GCMMA(warm_start=True), SingleStepGCMMA()]


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


def random_subproblem(rng: np.random.Generator, n: int, m: int, violation: float = 0.3) -> Subproblem:
    """Gradients over six decades, variables at bounds, curvatures from 1e-6 to 1, feasible, infeasible and idle g."""
    df = rng.normal(size=(m + 1, n)) * 10 ** rng.uniform(-3, 0, size=n) * 10 ** rng.uniform(-2, 1, size=(m + 1, 1))
    x = np.clip(rng.uniform(-0.2, 1.2, size=n), 0, 1)
    problem = replace(ripples(n), x0=x)
    half = rng.uniform(0.01, 1, size=n)
    x_old, x_older = x - rng.normal(size=n), x + rng.normal(size=n)
    f = np.append(1.0, violation * rng.normal(size=m) * np.sum(np.abs(df[1:]), axis=1))
    state = State(x, x_old, x_older, x - half, x + half, np.zeros(m + 1), iteration=3, scale=1.0)
    return approximate(problem, state, f, df, 10 ** rng.uniform(-6, 0, size=m + 1), move=0.3)


def penalised(sub: Subproblem, r: Array) -> float:
    """What a subproblem minimises: f~_0 plus the price of every violation, c y + y^2 / 2."""
    f = approximation(sub, r)
    y = np.maximum(f[1:], 0)
    return float(f[0] + np.sum(PENALTY * y + 0.5 * y**2))


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


@pytest.mark.parametrize("m", [1, 2, 5])
@pytest.mark.parametrize("n", [4, 60])
def test_subproblem_solution_meets_the_kkt_conditions(n: int, m: int) -> None:
    """Multipliers in [0, c] of active constraints, c + y of violated ones, those of limits >= 0: zero gradient."""
    rng = np.random.default_rng(10 * n + m)
    violated = active = 0
    for _ in range(40):
        sub = random_subproblem(rng, n, m, violation=0.02)
        r = solve_single(sub) if m == 1 else solve_multiple(sub)
        assert np.all((sub.r_min <= r) & (r <= sub.r_max))
        y = approximation(sub, r)[1:]
        # rounding is 1e-12; the interior point leaves a slack of mu / lam = 1e-12 / lam: 1e-6 finds all that matter
        above, on = y > 1e-9, np.abs(y + 5e-7) <= 5e-7 + 1e-9
        at_min, at_max = r - sub.r_min <= 1e-6, sub.r_max - r <= 1e-6
        weights = np.append(1.0, np.where(above, PENALTY + y, 0))
        gradient = sub.p - sub.q / r**2
        columns = np.concatenate([gradient[1:][on].T, -np.eye(n)[:, at_min], np.eye(n)[:, at_max]], axis=1)
        multipliers, residual = np.zeros(0), np.linalg.norm(weights @ gradient)
        if columns.shape[1]:
            multipliers, residual = nnls(columns, -weights @ gradient)
        # a multiplier that was not looked for is below 1e-6 = mu / slack
        assert residual <= 1e-6 * np.linalg.norm(weights @ (sub.p + sub.q / r**2))
        assert np.all(multipliers[: np.count_nonzero(on)] <= PENALTY * (1 + 1e-6))  # the residual's share
        violated, active = violated + int(np.any(above)), active + int(np.any(on))
    assert violated >= 2
    assert active >= 10


@pytest.mark.parametrize("kind", ["random", "inactive", "infeasible"])
def test_newton_and_interior_point_find_the_same_optimum(kind: str) -> None:
    rng = np.random.default_rng(7)
    for n in (1, 5, 50, 1000):
        for _ in range(15):
            sub = random_subproblem(rng, n, 1)
            if kind != "random":
                shift = 2 * np.sum(np.abs(sub.p[1]) + np.abs(sub.q[1])) * 19  # f~_1 cannot change by more: r <= 19
                sub = replace(sub, f=np.array([1.0, shift if kind == "infeasible" else -shift]))
            newton, interior = penalised(sub, solve_single(sub)), penalised(sub, solve_multiple(sub))
            terms = 1 + np.sum(sub.p[0] + sub.q[0]) + PENALTY * abs(sub.f[1])
            # the barrier's gap is mu = 1e-12; both violations of the order 1e-12 cost a thousandfold
            assert abs(newton - interior) <= 1e-9 * terms


def test_degenerate_constraints() -> None:
    """A repeated constraint, or one that touches the optimum without a multiplier, changes nothing."""
    rng = np.random.default_rng(3)
    feasible = 0
    for _ in range(20):
        one = random_subproblem(rng, 40, 1, violation=0.02)
        r = solve_single(one)
        twice = replace(one, f=one.f[[0, 1, 1]], p=one.p[[0, 1, 1]], q=one.q[[0, 1, 1]])
        touching = replace(one, p=one.p[:, ::-1], q=one.q[:, ::-1])
        at_zero = approximation(replace(touching, f=np.zeros(2)), r)[1]
        extra = replace(
            one,
            f=np.append(one.f, -at_zero),
            p=np.concatenate([one.p, touching.p[1:]]),
            q=np.concatenate([one.q, touching.q[1:]]),
        )
        best = penalised(one, r)
        for sub in (twice, extra):
            f = approximation(sub, solve_multiple(sub))
            if approximation(one, r)[1] <= 1e-9:  # else the price of one violation is paid twice
                feasible += 1
                assert np.max(f[1:]) <= 1e-9  # rounding
                assert abs(f[0] - best) <= 1e-9 * (1 + abs(best))  # the barrier's gap is m mu = 2e-12
    assert feasible >= 20


def test_a_violation_is_bought_only_above_the_penalty() -> None:
    """min -s x + s floor, x <= 0 in the tightest subproblem: the multiplier is about s, the price c = 1000 + y."""
    x = np.full(1, 0.5)
    state = State(x, x, x, x - 0.5, x + 0.5, np.zeros(2), iteration=0, scale=1.0)
    for slope, violated in ((900.0, False), (1100.0, True)):
        df = np.array([[-slope], [1.0]])
        sub = approximate(replace(ripples(1), x0=x), state, np.array([1.0, 0.0]), df, np.full(2, 1e-6), move=0.3)
        for solve in (solve_single, solve_multiple):
            assert (approximation(sub, solve(sub))[1] > 1e-3) == violated


def test_many_parallel_constraints() -> None:
    """Twenty multiples of one constraint under a steep objective leave the dual's Hessian without rank."""
    rng = np.random.default_rng(6)
    multiple = np.arange(1.0, 21)
    for n in (3, 50):
        for _ in range(15):
            one = random_subproblem(rng, n, 1, violation=0.02)
            one = replace(one, p=one.p * [[1e4], [1]], q=one.q * [[1e4], [1]])
            f, p, q = (np.concatenate([a[:1], np.multiply.outer(multiple, a[1])]) for a in (one.f, one.p, one.q))
            many = replace(one, f=f, p=p, q=q)
            best = penalised(many, solve_multiple(many))
            if approximation(one, solve_single(one))[1] <= 0:
                # the barrier's gap is m mu = 2e-11, and twenty violations of rounding size are priced a thousandfold
                assert abs(best - penalised(one, solve_single(one))) <= 1e-7 * (1 + abs(best))
            assert best <= penalised(many, solve_single(one)) + 1e-7 * (1 + abs(best))


def test_newton_needs_few_evaluations(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a volume-constrained problem of 3,200 variables: at most 8 evaluations of the dual a subproblem."""
    rng = np.random.default_rng(5)
    n, calls, dual = 3200, [0], subproblem.dual

    def counted(sub: Subproblem, lam: Array) -> tuple[Array, Array, Array]:
        calls[0] += 1
        return dual(sub, lam)

    benefit = 10 ** rng.uniform(-4, 0, size=n)  # what void to solid spans under SIMP
    problem = Analytic(
        lambda x: np.sum(benefit / x**3),
        lambda x: -3 * benefit / x**4,
        lambda x: np.mean(x) / 0.4 - 1,
        lambda x: np.full(n, 1 / (0.4 * n)),
        np.full(n, 0.4),
        np.full(n, 1e-3),
        np.ones(n),
    )
    monkeypatch.setattr(subproblem, "dual", counted)
    steps(problem, MMA(), 20)
    assert calls[0] <= 8 * 20


def test_gcmma_never_rises_where_mma_does() -> None:
    objectives = {rule: np.array([e.objective for e in steps(ripples(), rule, 40)[1]]) for rule in RULES}
    assert np.count_nonzero(np.diff(objectives[MMA()]) > 1e-3) >= 3
    for rule in (GCMMA(), GCMMA(warm_start=True)):
        # the conservative test leaves 1e-9 of the objective, and as much for the constraint's multiplier
        assert np.max(np.diff(objectives[rule])) <= 1e-8 * objectives[rule][0]
        assert objectives[rule][-1] < objectives[rule][0] - 0.5
    with_memory = steps(ripples(), GCMMA(warm_start=True), 40)[2]
    assert with_memory < steps(ripples(), GCMMA(), 40)[2]


@pytest.mark.parametrize("rule", RULES, ids=repr)
def test_every_solve_is_counted_and_gradients_are_taken_once(rule: UpdateRule) -> None:
    problem = ripples()
    _, _, solves = steps(problem, rule, 10)
    assert problem.calls.count("evaluate") == solves
    assert problem.calls.count("gradient") == 10
    assert (solves > 11) == isinstance(rule, GCMMA)


def test_inner_iterations_are_limited() -> None:
    _, _, solves = steps(ripples(), GCMMA(max_inner=2), 10)
    assert 11 < solves <= 21


@pytest.mark.parametrize("rule", RULES, ids=repr)
def test_infeasible_start_recovers(rule: UpdateRule) -> None:
    problem = replace(cantilever(), x0=np.full(5, 1.5))  # deflection 36 times the limit
    _, history, _ = steps(problem, rule, 40)
    assert history[0].constraints[0] > 30
    assert abs(history[-1].objective - 1.339956) <= 1e-6  # the published digits
    assert history[-1].constraints[0] <= 1e-7  # second order in the last step


@pytest.mark.parametrize("rule", [*RULES, OptimalityCriteria()], ids=repr)
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


@pytest.mark.parametrize("rule", [*RULES, OptimalityCriteria()], ids=repr)
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


def test_curvatures_are_svanbergs() -> None:
    """MMA keeps 1e-5; the single step has a tenth of the mean slope; the warm start halves what was accepted last."""
    slope = [0.1 * np.mean(np.abs(ripples().df(ripples().x0))) / abs(ripples().f(ripples().x0)), 0.1 * 2 / 20]
    np.testing.assert_array_equal(steps(ripples(), MMA(), 1)[0].curvature, MMA_CURVATURE)
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
