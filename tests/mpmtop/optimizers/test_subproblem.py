"""The subproblem's dual: KKT conditions, and two solvers that find the same optimum."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import nnls

from mpmtop.arrays import Array
from mpmtop.optimizers import MMA, State, subproblem
from mpmtop.optimizers.mma import approximate
from mpmtop.optimizers.subproblem import (
    PENALTY,
    Subproblem,
    approximation,
    solve_multiple,
    solve_single,
    solve_subproblem,
)
from tests.mpmtop.optimizers.problems import Analytic, ripples, steps


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


@pytest.mark.parametrize("m", [1, 2, 5])
@pytest.mark.parametrize("n", [4, 60])
def test_subproblem_solution_meets_the_kkt_conditions(n: int, m: int) -> None:
    """Multipliers in [0, c] of active constraints, c + y of violated ones, those of limits >= 0: zero gradient."""
    rng = np.random.default_rng(10 * n + m)
    violated = active = 0
    for _ in range(40):
        sub = random_subproblem(rng, n, m, violation=0.02)
        r, _ = solve_single(sub) if m == 1 else solve_multiple(sub)
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
            newton, interior = penalised(sub, solve_single(sub)[0]), penalised(sub, solve_multiple(sub)[0])
            terms = 1 + np.sum(sub.p[0] + sub.q[0]) + PENALTY * abs(sub.f[1])
            # the barrier's gap is mu = 1e-12; both violations of the order 1e-12 cost a thousandfold
            assert abs(newton - interior) <= 1e-9 * terms


def test_degenerate_constraints() -> None:
    """A repeated constraint, or one that touches the optimum without a multiplier, changes nothing."""
    rng = np.random.default_rng(3)
    feasible = 0
    for _ in range(20):
        one = random_subproblem(rng, 40, 1, violation=0.02)
        r, _ = solve_single(one)
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
            f = approximation(sub, solve_multiple(sub)[0])
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
            assert (approximation(sub, solve(sub)[0])[1] > 1e-3) == violated


@pytest.mark.parametrize("copies", [1, 2])
@pytest.mark.parametrize(("slope", "growth"), [(2.1e3, 1.0), (1e9, 1.0), (1e17, 1.0), (1e-3, 1e-7)])
def test_no_violation_is_bought_where_it_can_be_avoided(slope: float, growth: float, copies: int) -> None:
    """min -slope x, growth x <= 0: multipliers far above the price, in the solver of one constraint and of several."""
    x = np.full(1, 0.5)
    state = State(x, x, x, x - 0.5, x + 0.5, np.zeros(1 + copies), iteration=0, scale=1.0)
    df = np.array([[-slope], *[[growth]] * copies])
    f = np.array([1.0, *[0.0] * copies])
    sub = approximate(replace(ripples(1), x0=x), state, f, df, np.full(1 + copies, 1e-9), move=0.3)
    solve = solve_single if copies == 1 else solve_multiple
    assert approximation(sub, solve(sub)[0])[1] > 1e-8  # at a fixed price it is bought
    assert approximation(sub, solve_subproblem(sub))[1] <= 1e-9  # as stated
    out_of_reach = replace(sub, f=np.array([1.0, *[0.35] * copies]))  # within the limits it falls by no more than 0.3
    r = solve_subproblem(out_of_reach)
    best = approximation(out_of_reach, out_of_reach.r_min)[1]
    assert approximation(out_of_reach, r)[1] <= best + 1e-9


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
            best = penalised(many, solve_multiple(many)[0])
            if approximation(one, solve_single(one)[0])[1] <= 0:
                # the barrier's gap is m mu = 2e-11, and twenty violations of rounding size are priced a thousandfold
                assert abs(best - penalised(one, solve_single(one)[0])) <= 1e-7 * (1 + abs(best))
            assert best <= penalised(many, solve_single(one)[0]) + 1e-7 * (1 + abs(best))


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


def test_halving_finds_the_root_that_newton_finds(monkeypatch: pytest.MonkeyPatch) -> None:
    """With no Newton step at all, as where they crawl; the roots are those of monotone functions, to rounding."""
    rng = np.random.default_rng(5)
    for _ in range(20):
        sub = random_subproblem(rng, 60, 1, violation=0.02)
        by_newton = solve_single(sub)
        with monkeypatch.context() as patched:
            patched.setattr(subproblem, "CRAWLS", 0)
            halved = solve_single(sub)
        for ours, theirs in zip(halved, by_newton, strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-12)
