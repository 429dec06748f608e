"""Scale: the phases of an iteration timed apart, from thousands of material points to millions."""

import os
import re
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mpmtop.arrays import Array
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.filter import DensityFilter
from mpmtop.optimizers import GCMMA, initial_state
from mpmtop.problem import DesignProblem, Evaluation, Term, design_problem
from mpmtop.scene import Scene
from mpmtop.solvers import BandedCholesky, MultigridCG, Pattern, Solve, Solver, SparseCholesky, choose_solver
from mpmtop.solvers.multigrid_cg import IteratedSolve
from validation.bodies.scenes import SPACING, H, cantilever, l_bracket
from validation.measures.timing import cpu_seconds, in_own_process
from validation.methods.analyser import MOVE

ChosenBy = Callable[[Pattern], Solver]

OBJECTIVES = {"compliance": Compliance(), "p-norm": PNormStress(12, 0.5)}
MOVES = {"compliance": MOVE, "p-norm": 0.05}
BODIES: dict[str, tuple[Callable[..., Scene], int]] = {"cantilever": (cantilever, 80), "L-bracket": (l_bracket, 100)}
"""Scenes, and the points along their longest side with which the paper has them."""
PHASES = ("moduli to K", "factorisation", "solve", "residual, objective", "gradient", "filter", "update")
"""Of an iteration. A factorisation sets up the hierarchy where multigrid solves; the gradient is that by densities,
without the adjoint's solve, which counts as one; the update is the MMA subproblem."""


class Clock:
    """CPU seconds by phase; time spent in a phase within another counts to the inner one alone. And multigrid's cycles,
    one for each iteration of conjugate gradients."""

    def __init__(self) -> None:
        self.spent: defaultdict[str, float] = defaultdict(float)
        self.cycles = 0
        self._running: list[str] = []
        self._since = 0.0

    @contextmanager
    def __call__(self, phase: str) -> Iterator[None]:
        self._lap()
        self._running.append(phase)
        try:
            yield
        finally:
            self._lap()
            self._running.pop()

    def _lap(self) -> None:
        now = time.process_time()
        if self._running:
            self.spent[self._running[-1]] += now - self._since
        self._since = now


@dataclass(frozen=True, eq=False)
class TimedMap:
    """A map from moduli to entries of K, timed."""

    inner: Any
    clock: Clock

    def __matmul__(self, moduli: Array) -> Array:
        with self.clock("moduli to K"):
            return self.inner @ moduli


@dataclass(frozen=True, eq=False)
class TimedSolver:
    """A solver, timed, its cycles counted."""

    inner: Solver
    clock: Clock

    @property
    def tolerance(self) -> float:
        return self.inner.tolerance

    def factor(self, data: Array, tolerance: float | None = None) -> Solve:
        with self.clock("factorisation"):
            solve = self.inner.factor(data, tolerance)
        if isinstance(solve, IteratedSolve):
            solve = replace(solve, cycle=self._counted(solve.cycle))

        def timed(b: Array) -> Array:
            with self.clock("solve"):
                return solve(b)

        return timed

    def _counted(self, cycle: Solve) -> Any:
        def counted(f: Array) -> Array:
            self.clock.cycles += 1
            return cycle(f)

        return counted


@dataclass(frozen=True, eq=False)
class TimedFilter(DensityFilter):
    """A density filter, timed."""

    clock: Clock = field(kw_only=True)

    def __call__(self, design: Array) -> Array:
        with self.clock("filter"):
            return super().__call__(design)

    def adjoint(self, gradient: Array) -> Array:
        with self.clock("filter"):
            return super().adjoint(gradient)


class TimedProblem(DesignProblem):
    """A design problem whose phases are timed."""

    clock: Clock

    @classmethod
    def of(cls, problem: DesignProblem, clock: Clock) -> "TimedProblem":
        """The same problem, its filter built."""
        model = problem.model
        maps: Any = tuple(TimedMap(part, clock) for part in model.stiffness.maps)
        timed = replace(model, stiffness=replace(model.stiffness, maps=maps), solver=TimedSolver(model.solver, clock))
        timed_problem = cls(timed, problem.design, problem.objective)
        timed_problem.__dict__ |= {
            "clock": clock,
            "filter": TimedFilter(problem.filter.matrix, problem.filter.offset, clock=clock),
        }
        return timed_problem

    def evaluate(self, design: Array) -> Evaluation:
        with self.clock("residual, objective"):
            return super().evaluate(design)

    def _by_density(self, terms: Iterable[Term], evaluation: Evaluation) -> Array:
        with self.clock("gradient"):
            return super()._by_density(terms, evaluation)


class Measurement(NamedTuple):
    """Size, CPU seconds to build the operators and the filter, those of every phase of every iteration and its cycles
    of multigrid, objectives of the designs, and the peak memory of the process [bytes] if it was its own."""

    points: int
    unknowns: int
    solver: str
    built: dict[str, float]
    iterations: list[dict[str, float]]
    cycles: Array
    objective: Array
    peak: float = np.nan

    @property
    def median(self) -> dict[str, float]:
        """CPU seconds by phase, medians over the iterations."""
        return {phase: float(np.median([spent[phase] for spent in self.iterations])) for phase in PHASES}

    @property
    def totals(self) -> Array:
        """CPU seconds of each iteration."""
        return np.array([sum(spent.values()) for spent in self.iterations])


def problem_of(nx: int, objective: str, solver: ChosenBy = choose_solver, *, body: str = "cantilever") -> DesignProblem:
    """A body with nx points along its longest side, 2 x 2 in a cell; the filter's radius is three spacings."""
    scene, of_paper = BODIES[body]
    spacing = SPACING * of_paper / nx
    return design_problem(scene(radius=3 * spacing, objective=OBJECTIVES[objective]), 2 * spacing * H, 2, solver=solver)


def evaluations(problem: DesignProblem, objective: str) -> Iterator[Evaluation]:
    """Those of GCMMA with one solve an iteration, from the uniform start on, without end.

    Without its conservative solves a p-norm needs a small move limit, or its designs become noise.
    """
    rule = GCMMA(move=MOVES[objective], max_inner=1)
    evaluation = problem.evaluate(problem.x0)
    state = initial_state(problem, evaluation)
    while True:
        yield evaluation
        state, evaluation, _ = rule.step(problem, state, evaluation, *problem.gradient(evaluation))


def measurement(nx: int, objective: str, iterations: int, body: str = "cantilever") -> Measurement:
    """So many iterations, timed; the first, which also filters the gradient of the volume once for all, is left out."""
    clock = Clock()
    with clock("operators"):
        untimed = problem_of(nx, objective, body=body)
    with clock("filter built"):
        problem = TimedProblem.of(untimed, clock)
    model = untimed.model
    built = dict(clock.spent)
    spent, cycles, objectives = [], [], []
    run = evaluations(problem, objective)
    for _ in range(iterations + 2):
        clock.spent.clear()
        clock.cycles = 0
        with clock("update"):
            objectives.append(next(run).objective)
        spent.append(dict(clock.spent))
        cycles.append(clock.cycles)
    solver = model.solver
    direct = isinstance(solver, MultigridCG) and solver.too_tight(problem.tolerance)
    size = len(model.points.x), len(model.stiffness.dof), (SparseCholesky if direct else type(solver)).__name__
    return Measurement(*size, built, spent[2:], np.array(cycles[2:]), np.array(objectives))


def peak_memory() -> float:
    """Largest memory that this process has held [bytes], NaN where the system does not tell.

    `resource.getrusage` would count the largest of the process that started this one, too.
    """
    status = Path("/proc/self/status")
    peak = re.search(r"VmHWM:\s*(\d+) kB", status.read_text()) if status.exists() else None
    return 1024.0 * int(peak[1]) if peak else np.nan


def alone(nx: int, objective: str, iterations: int, body: str = "cantilever") -> Measurement:
    """`measurement` in a process of its own, whose memory is that of this problem alone."""
    return in_own_process(_with_memory, nx, objective, iterations, body)


def _with_memory(nx: int, objective: str, iterations: int, body: str) -> Measurement:
    return measurement(nx, objective, iterations, body)._replace(peak=peak_memory())


def elapsed(nx: int, objective: str, body: str, threads: int) -> tuple[int, float]:
    """Points, and median seconds by the clock on the wall of an iteration with so many threads of BLAS, in a process of
    its own."""
    before = os.environ.get("OPENBLAS_NUM_THREADS")
    os.environ["OPENBLAS_NUM_THREADS"] = str(threads)
    try:
        return in_own_process(_elapsed, nx, objective, body)
    finally:
        if before is None:
            del os.environ["OPENBLAS_NUM_THREADS"]
        else:
            os.environ["OPENBLAS_NUM_THREADS"] = before


def _elapsed(nx: int, objective: str, body: str) -> tuple[int, float]:
    problem = problem_of(nx, objective, body=body)
    run, spent = evaluations(problem, objective), []
    for _ in range(7):
        began = time.perf_counter()
        next(run)
        spent.append(time.perf_counter() - began)
    return len(problem.point_volume), float(np.median(spent[2:]))


def exponents(seconds: Mapping[str, Array], points: Array) -> dict[str, float]:
    """k of the fit seconds ~ points^k, for every phase."""
    return {phase: float(np.polyfit(np.log(points), np.log(spent), 1)[0]) for phase, spent in seconds.items()}


def run_of(nx: int, objective: str, iterations: int, solver: ChosenBy) -> tuple[Array, Array]:
    """Objectives (iterations + 1,) of an optimisation, and the last densities (p,)."""
    problem = problem_of(nx, objective, solver)
    done = list(islice(evaluations(problem, objective), iterations + 1))
    return np.array([evaluation.objective for evaluation in done]), done[-1].rho


SOLVERS: dict[str, ChosenBy] = {"banded": BandedCholesky, "sparse": SparseCholesky, "multigrid": MultigridCG}


def iteration_seconds(nx: int, names: Iterable[str], repeats: int = 5) -> dict[str, float]:
    """Unknowns, and median CPU seconds of an iteration of compliance after ten, by SOLVERS of these names in turn."""
    problems = {name: problem_of(nx, "compliance", SOLVERS[name]) for name in names}
    runs = {name: evaluations(problem, "compliance") for name, problem in problems.items()}
    for run in runs.values():
        next(islice(run, 9, None))
    seconds = cpu_seconds({name: partial(next, run) for name, run in runs.items()}, repeats)
    return {"unknowns": len(next(iter(problems.values())).model.stiffness.dof)} | seconds
