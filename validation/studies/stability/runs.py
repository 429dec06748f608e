"""Parameters, update rules and interruptions far past what is sensible: the cases that are more than one analysis."""

import json
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache, partial
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import meshio
import numpy as np

from mpmtop import export
from mpmtop.arrays import Array
from mpmtop.equilibrium import Derivative
from mpmtop.errors import NotConverged
from mpmtop.optimizers import (
    GCMMA,
    MMA,
    CheckpointError,
    Iterate,
    OptimalityCriteria,
    SingleStepGCMMA,
    UpdateRule,
    optimize,
)
from mpmtop.optimizers.checkpoint import Run, load_checkpoint
from mpmtop.problem import DesignProblem, Evaluation
from validation.studies.stability.cases import FUNCTIONS, beam, model_of
from validation.studies.stability.interruption import AT, MOMENTS, RULES, Survival, interrupted, last_of
from validation.studies.stability.judge import Case, Finding, Wrong, direct, distance, refused, worst

FEASIBLE = 1e-6
"""Of the volume: the subproblem's own tolerance, times ten."""


@dataclass(frozen=True, eq=False)
class Values:
    """Evaluation of `Bars`."""

    x: Array
    objective: float
    constraints: Array


@dataclass(eq=False)
class Bars:
    """min sum c / x, mean x <= V, 0.01 <= x <= 1: a problem whose optimum is known.

    From evaluation `bad_from` on `bad` is the objective's value, or the gradient's first entry.
    """

    c: Array
    x0: Array
    volume: float = 0.4
    bad: float = 0.0
    bad_from: int = sys.maxsize
    in_gradient: bool = False
    fingerprint: str = "bars"
    evaluations: int = field(default=0, init=False)

    @property
    def lower(self) -> Array:
        return np.full(len(self.c), 0.01)

    @property
    def upper(self) -> Array:
        return np.ones(len(self.c))

    @property
    def spoilt(self) -> bool:
        return self.evaluations > self.bad_from

    def evaluate(self, x: Array) -> Values:
        self.evaluations += 1
        objective = self.bad if self.spoilt and not self.in_gradient else float(np.sum(self.c / x))
        return Values(x, objective, np.array([np.mean(x) / self.volume - 1]))

    def gradient(self, evaluation: Values) -> tuple[Array, Array]:
        df, n = -self.c / evaluation.x**2, len(self.c)
        if self.spoilt and self.in_gradient:
            df[0] = self.bad
        return df, np.full((1, n), 1 / (self.volume * n))

    def optimum(self) -> float:
        """sum c / x at x = sqrt(c / lam) within the bounds, lam such that the volume is met."""
        low, high = -60.0, 60.0
        for _ in range(200):
            x = np.clip(np.sqrt(self.c) * np.exp((low + high) / 2), self.lower, self.upper)
            low, high = (low, (low + high) / 2) if np.mean(x) > self.volume else ((low + high) / 2, high)
        return float(np.sum(self.c / x))


UPDATES: tuple[UpdateRule, ...] = (MMA(), GCMMA(), GCMMA(warm_start=True), SingleStepGCMMA(), OptimalityCriteria())


def bars(seed: int, rule: UpdateRule, iterations: int = 50, **settings: Any) -> list[Iterate[Values]]:
    """A run from a random start, feasible or not."""
    rng = np.random.default_rng(seed)
    problem = Bars(rng.uniform(0.1, 2, 20), rng.uniform(0.01, 1, 20), **settings)
    return list(optimize(problem, rule, stop=lambda history: False, max_iterations=iterations))


def optimisers() -> Iterator[Case]:
    """Infeasible starts, move limits, no gradient, values that are no numbers, 2,000 iterations."""
    for rule, seed in product(UPDATES, range(8)):
        yield Case("random start, mostly infeasible", f"{rule}, {seed}", "exact optimum", partial(optimal, seed, rule))
    for move in (1e-6, 1e-3, 0.01, 0.1, 0.5, 1.0):
        limited: tuple[UpdateRule, ...] = MMA(move), GCMMA(move), SingleStepGCMMA(move), OptimalityCriteria(move)
        for rule in limited:
            yield Case("move limit", f"{rule!r}", "limit kept", partial(moved_within, rule, move))
    for rule in UPDATES:
        yield Case("zero gradient", f"{rule}", "feasible", partial(without_gradient, rule))
    for rule, bad, start, where in product(UPDATES, (np.nan, np.inf, -np.inf), (0, 1, 7), (True, False)):
        run = partial(refused, partial(bars, 1, rule, 12, bad=bad, bad_from=start, in_gradient=where))
        name, says = f"{rule}, {bad}, {start}, {where}", "derivatives" if where else "objective"
        yield Case("NaN or infinity from the objective", name, "the error to expect", run, (NotConverged,), says)
    for function, rule, bad, where in product(FUNCTIONS, UPDATES[:2], (np.nan, np.inf, -np.inf), (True, False)):
        run = partial(refused, partial(injected, function, rule, bad, in_gradient=where))
        name, says = f"{function}, {rule}, {bad}, {where}", "derivatives" if where else "objective"
        yield Case("NaN or infinity from a body", name, "the error to expect", run, (NotConverged,), says)
    for rule in (MMA(), GCMMA(), OptimalityCriteria()):
        yield Case("2,000 iterations", f"{rule}", "volume and objective stay", partial(drift, rule))


def injected(function: str, rule: UpdateRule, bad: float, *, in_gradient: bool) -> list[Iterate[Evaluation]]:
    """A run on the beam whose objective, or one entry of its gradient, is `bad`."""
    problem = DesignProblem(direct(model_of(function, (0.1, 0.05))), beam().design)
    whole = problem.functional

    def derivative(*arguments: Any) -> Derivative:
        by_rho = np.zeros_like(problem.model.points.volume)
        by_rho[3] = bad
        return whole.derivative(*arguments)._replace(rho=by_rho)

    spoilt = whole._replace(derivative=derivative) if in_gradient else whole._replace(value=lambda *arguments: bad)
    vars(problem)["functional"] = spoilt  # a cached property
    return list(optimize(problem, rule, max_iterations=3))


def optimal(seed: int, rule: UpdateRule) -> Finding:
    """The optimum is met to 0.1 %, the paper's rule stops at ten times less; the volume to FEASIBLE."""
    last = bars(seed, rule)[-1]
    rng = np.random.default_rng(seed)
    best = Bars(rng.uniform(0.1, 2, 20), rng.uniform(0.01, 1, 20)).optimum()
    return Finding(worst(abs(last.objective / best - 1) / 1e-3, last.constraints[0] / FEASIBLE))


def moved_within(rule: UpdateRule, move: float) -> Finding:
    """No step exceeds the limit, by more than the rounding of a difference."""
    x = np.array([iterate.x for iterate in bars(2, rule, 10)])
    return Finding(float(np.abs(np.diff(x, axis=0)).max()) / (0.99 * move * (1 + 1e-9) + 1e-15))


def without_gradient(rule: UpdateRule) -> Finding:
    """A constant objective: the design becomes feasible and stays finite."""
    problem = Bars(np.zeros(20), np.random.default_rng(3).uniform(0.01, 1, 20))
    *_, last = optimize(problem, rule, stop=lambda history: False, max_iterations=30)
    return Finding(worst(last.constraints[0] / FEASIBLE, *(0.0 * last.x)))  # NaN if a variable is not finite


def drift(rule: UpdateRule) -> Finding:
    """From iteration 100 on the volume stays at its bound, and the objective where it is."""
    iterates = bars(4, rule, 2000)[100:]
    volume, J = np.array([(i.constraints[0], i.objective) for i in iterates]).T
    return Finding(worst(np.abs(volume).max() / FEASIBLE, (J.max() / J[-1] - 1) / 1e-4))


def interruptions() -> Iterator[Case]:
    """Killed runs, resumed; damaged and foreign files; export."""
    kills = killed_runs()
    for (rule, moment), end in kills.items():
        run = partial(resumed, end, must_be_hit=moment in AT)
        yield Case(f"kill -9, {rule}", moment, "the run that was not killed, bit for bit", run)
    for i in range(80):
        run = partial(damaged, truncate=i)
        yield Case("truncated checkpoint", f"{i}", "the error to expect", run, (CheckpointError,), "start afresh")
    for i in range(120):
        run = partial(damaged, flip=i)
        yield Case(
            "checkpoint with a flipped bit", f"{i}", "refused, or read whole", run, (CheckpointError,), "start afresh"
        )
    for i, content in enumerate((b"", b"text", b"PK\x03\x04", b"\x93NUMPY", bytes(4096))):
        run = partial(damaged, content=content)
        yield Case("foreign file", f"{i}", "the error to expect", run, (CheckpointError,), "start afresh")
    for function in FUNCTIONS:
        yield Case("VTU file reopened", function, "what was written", partial(reopened, function))


@cache
def killed_runs() -> dict[tuple[str, str], Survival]:
    """By update rule and moment of the kill.

    They are made in a process of their own: what it forks has no other threads to lose.
    """
    command = [sys.executable, "-m", "validation.studies.stability.interruption"]
    done = subprocess.run(command, cwd=Path(__file__).parents[3], capture_output=True, text=True, check=True)
    found = json.loads(done.stdout)
    return {(rule, moment): Survival(*found[f"{rule}|{moment}"]) for rule, moment in product(RULES, MOMENTS)}


def resumed(end: Survival, *, must_be_hit: bool) -> Finding:
    """A kill by time may come after the end; one at a place in the run has to hit."""
    if must_be_hit and not end.killed:
        raise Wrong("the run was not killed")
    return Finding(0.0 if end.same else np.inf)


@cache
def checkpoint() -> tuple[bytes, Run]:
    """A whole checkpoint, and the run it belongs to."""
    problem, rule = interrupted(), MMA()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.npz"
        last_of(optimize(problem, rule, checkpoint=path, max_iterations=3))
        return path.read_bytes(), Run((problem.fingerprint,), (repr(rule),), problem.x0)


def damaged(*, truncate: int = 0, flip: int | None = None, content: bytes | None = None) -> Finding:
    """A checkpoint that is cut off, has one bit flipped, or is none: refused by name, or read as it was."""
    whole, run = checkpoint()
    broken = bytearray(whole if content is None else content)
    rng = np.random.default_rng(flip or 0)
    if content is None and flip is None:
        broken = broken[: len(whole) * truncate // 80]
    if flip is not None:
        broken[int(rng.integers(len(whole)))] ^= 1 << int(rng.integers(8))
    with TemporaryDirectory() as folder:
        path, other = Path(folder) / "run.npz", Path(folder) / "whole.npz"
        path.write_bytes(broken)
        other.write_bytes(whole)
        read, expected = (vars(load_checkpoint(file, run)) for file in (path, other))
    states = vars(read.pop("state")), vars(expected.pop("state"))
    if read != expected or not all(np.array_equal(states[0][name], states[1][name]) for name in states[1]):
        raise Wrong("a damaged checkpoint was read")
    return Finding(0.0)


def reopened(function: str) -> Finding:
    """Points and grid in VTU files, read back by meshio."""
    problem = DesignProblem(direct(model_of(function, (0.1, 0.05))), beam().design)
    at = problem.evaluate(problem.x0)
    with TemporaryDirectory() as folder:
        export.write_points(Path(folder) / "points.vtu", problem.model, at.state, at.rho)
        export.write_grid(Path(folder) / "grid.vtu", problem.model, at.state)
        points, grid = (meshio.read(Path(folder) / f"{name}.vtu") for name in ("points", "grid"))
    displacement = grid.point_data["displacement"][problem.model.transfer.nodes, :2]
    stress = problem.model.stress(at.state.moduli, at.state.strain)
    in_plane = points.cell_data["stress"][0][:, [0, 1, 3]]  # VTK's order is xx, yy, zz, xy
    off = distance(displacement.ravel(), at.state.u) + distance(in_plane, stress)
    return Finding(off / np.finfo(float).tiny)  # the same numbers
