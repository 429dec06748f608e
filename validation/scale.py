"""Scale: the phases of an iteration timed apart, from thousands of material points to millions."""

import multiprocessing
import resource
import sys
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from mpmtop.design import DensityFilter
from mpmtop.equilibrium import Model, discretise
from mpmtop.gcmma import GCMMA, initial_state
from mpmtop.linear_solver import BandedCholesky, MultigridCG, Solver
from mpmtop.multigrid import Solve
from mpmtop.problem import DesignProblem, Evaluation
from mpmtop.scene import Array, Compliance, PNormStress, Scene
from validation.scenes import SPACING, H, cantilever

OBJECTIVES = {"compliance": Compliance(), "p-norm": PNormStress(12, 0.5)}
PHASES = ("moduli to K", "factorisation", "solve", "residual, objective", "gradient", "filter", "update")
"""Of an iteration. A factorisation sets up the hierarchy where multigrid solves; the gradient is that by densities,
without the adjoint's solve, which counts as one; the update is the MMA subproblem."""


class Clock:
    """CPU seconds by phase; time spent in a phase within another counts to the inner one alone."""

    def __init__(self) -> None:
        self.spent: defaultdict[str, float] = defaultdict(float)
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
    """A solver, timed."""

    inner: Solver
    clock: Clock

    @property
    def tolerance(self) -> float:
        return self.inner.tolerance

    def factor(self, data: Array) -> Solve:
        with self.clock("factorisation"):
            solve = self.inner.factor(data)

        def timed(b: Array) -> Array:
            with self.clock("solve"):
                return solve(b)

        return timed


class TimedFilter(DensityFilter):
    """A density filter, timed."""

    def __init__(self, inner: DensityFilter, clock: Clock) -> None:
        super().__init__(inner.matrix, inner.offset)
        object.__setattr__(self, "clock", clock)

    clock: Clock

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
    def of(cls, model: Model, clock: Clock) -> "TimedProblem":
        """The problem of a model, its filter built."""
        maps: Any = tuple(TimedMap(part, clock) for part in model.stiffness.maps)
        timed = replace(model, stiffness=replace(model.stiffness, maps=maps), solver=TimedSolver(model.solver, clock))
        problem = cls(timed)
        problem.__dict__ |= {"clock": clock, "filter": TimedFilter(problem.filter, clock)}
        return problem

    def evaluate(self, design: Array) -> Evaluation:
        with self.clock("residual, objective"):
            return super().evaluate(design)

    def density_gradient(self, evaluation: Evaluation) -> Array:
        with self.clock("gradient"):
            return super().density_gradient(evaluation)


class Measurement(NamedTuple):
    """CPU seconds to build the operators and the filter, and of every phase of every iteration; objectives of the
    designs (k + 1,); peak memory of the process [bytes]; solver's name."""

    points: int
    unknowns: int
    solver: str
    built: dict[str, float]
    iterations: list[dict[str, float]]
    objective: Array
    peak: int

    @property
    def median(self) -> dict[str, float]:
        """CPU seconds by phase, medians over the iterations."""
        return {phase: float(np.median([spent[phase] for spent in self.iterations])) for phase in PHASES}

    @property
    def totals(self) -> Array:
        """CPU seconds of each iteration."""
        return np.array([sum(spent.values()) for spent in self.iterations])


def scene(nx: int, objective: str) -> Scene:
    """The cantilever with nx points along it; the filter's radius is three spacings."""
    return cantilever(radius=3 * SPACING * 80 / nx, objective=OBJECTIVES[objective])


def measurement(nx: int, objective: str, iterations: int, solver: str = "chosen") -> Measurement:
    """GCMMA from the uniform start with one solve an iteration, on nx x nx / 2 points, 2 x 2 in a cell."""
    clock = Clock()
    with clock("operators"):
        chosen = {"solver": SOLVERS[solver]} if solver in SOLVERS else {}
        model = discretise(scene(nx, objective), 2 * SPACING * 80 / nx * H, 2, **chosen)
    with clock("filter built"):
        problem = TimedProblem.of(model, clock)
    built = dict(clock.spent)
    rule = GCMMA(max_inner=1)
    evaluation = problem.evaluate(problem.x0)
    problem.gradient(evaluation)  # the volume's is kept
    state, objectives, spent = initial_state(problem, evaluation), [evaluation.objective], []
    for _ in range(iterations):
        clock.spent.clear()
        gradient = problem.gradient(evaluation)
        with clock("update"):
            state, evaluation, _ = rule.step(problem, state, evaluation, *gradient)
        objectives.append(evaluation.objective)
        spent.append(dict(clock.spent))
    return Measurement(
        len(model.points.x),
        len(model.stiffness.dof),
        type(model.solver).__name__,
        built,
        spent,
        np.array(objectives),
        peak_memory(),
    )


SOLVERS: Mapping[str, Any] = {"banded": BandedCholesky, "multigrid": MultigridCG}
"""Solvers asked for by name, in place of that chosen by size."""


def peak_memory() -> int:
    """Largest memory that this process has held [bytes]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def alone(nx: int, objective: str, iterations: int, solver: str = "chosen") -> Measurement:
    """`measurement` in a process of its own, whose memory is that of this problem alone."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        return process.submit(measurement, nx, objective, iterations, solver).result()


def exponents(seconds: Mapping[str, Array], points: Array) -> dict[str, float]:
    """k of the fit seconds ~ points^k, for every phase."""
    return {phase: float(np.polyfit(np.log(points), np.log(spent), 1)[0]) for phase, spent in seconds.items()}
