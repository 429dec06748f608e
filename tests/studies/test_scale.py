"""The scale study's clock: every CPU second is counted once, and the clock changes no number."""

import os
import time
from collections.abc import Callable
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.objectives import STRESS_TOLERANCE
from mpmtop.planning import plan
from mpmtop.solvers import MultigridCG, multigrid
from validation.studies.scale.sizes import (
    OBJECTIVES,
    PHASES,
    Clock,
    TimedProblem,
    alone,
    elapsed,
    evaluations,
    exponents,
    measurement,
    peak_memory,
    problem_of,
)


def spin(seconds: float) -> None:
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


def test_time_within_another_phase_counts_once() -> None:
    clock = Clock()
    with clock("outer"):
        spin(0.02)
        with clock("inner"):
            spin(0.04)
        spin(0.02)
    # an exclusive count: 0.04 each, where the inclusive one would make the outer 0.08
    assert 0.04 <= clock.spent["outer"] < 0.06
    assert 0.04 <= clock.spent["inner"] < 0.06


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_a_timed_problem_is_the_same_problem(objective: str) -> None:
    problem, clock = problem_of(40, objective), Clock()
    timed = [e.objective for e in islice(evaluations(TimedProblem.of(problem, clock), objective), 3)]
    assert timed == [e.objective for e in islice(evaluations(problem, objective), 3)]
    assert set(clock.spent) == set(PHASES) - {"update"}  # which `measurement` times around an iteration


def test_cycles_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the clock as by the cycle itself, those of state and adjoint; a direct solver has none."""
    assert measurement(40, "p-norm", 1).cycles.tolist() == [0]
    levels: list[int] = []
    cycle: Callable[..., Array] = multigrid.Cycle.__call__

    def counted(self: multigrid.Cycle, f: Array, level: int = 0) -> Array:
        levels.append(level)
        return cycle(self, f, level)

    monkeypatch.setattr(multigrid.Cycle, "__call__", counted)
    problem, clock = problem_of(40, "p-norm", partial(MultigridCG, coarsest=200)), Clock()
    list(islice(evaluations(TimedProblem.of(problem, clock), "p-norm"), 2))
    assert clock.cycles == levels.count(0) > 0
    assert max(levels) > 0


def test_exponents() -> None:
    points = np.array([1e5, 1e6, 2e6])
    assert exponents({"band": 3e-9 * points**2.0}, points)["band"] == pytest.approx(2)


def test_the_solver_is_held_to_what_the_objective_sees() -> None:
    problems = [problem_of(40, objective, MultigridCG) for objective in OBJECTIVES]
    assert all(isinstance(problem.model.solver, MultigridCG) for problem in problems)
    compliance, p_norm = (problem.evaluate(problem.x0).state for problem in problems)
    assert (compliance.tol, p_norm.tol) == (MultigridCG.tolerance, STRESS_TOLERANCE)
    assert compliance.residual <= compliance.tol and p_norm.residual <= p_norm.tol


def test_a_tight_tolerance_is_left_to_sparse_cholesky(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of large problems: no cycle for a p-norm, and the table and the plan name what solved."""
    monkeypatch.setattr("mpmtop.solvers.MULTIGRID_FROM", 0)
    compliance, p_norm = (measurement(40, objective, 1) for objective in OBJECTIVES)
    assert (compliance.solver, p_norm.solver) == ("MultigridCG", "SparseCholesky")
    assert compliance.cycles[0] > 0 and p_norm.cycles[0] == 0
    for objective, asked in (("compliance", "solver: MultigridCG"), ("p-norm", "solver: SparseCholesky")):
        assert asked in plan(problem_of(40, objective))


def test_threads_are_those_asked_for_and_the_environment_is_left_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    told = []

    def in_this_process(call: Callable[..., tuple[int, float]], *arguments: object) -> tuple[int, float]:
        told.append(os.environ["OPENBLAS_NUM_THREADS"])
        return call(*arguments)

    monkeypatch.setattr("validation.studies.scale.sizes.in_own_process", in_this_process)
    before = os.environ.get("OPENBLAS_NUM_THREADS")
    points, seconds = elapsed(40, "compliance", "cantilever", 2)
    assert points == 800 and seconds > 0
    assert told == ["2"] and os.environ.get("OPENBLAS_NUM_THREADS") == before


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="Linux tells the peak of one process alone")
def test_memory_is_the_process_s_own() -> None:
    """Not that of the process it was started by, which holds 300 MB more."""
    ballast = np.ones(40_000_000)
    assert peak_memory() > ballast.nbytes
    run = alone(40, "compliance", 1)
    assert 30e6 < run.peak < peak_memory() - 200e6
