"""The optimisation loop of the paper's Fig. 6 as a generator: the caller decides when to draw, save or leave it.

    for iterate in optimize(problem, GCMMA()):
        print(iterate.iteration, iterate.objective)

A run with a checkpoint can be killed at any moment; started again, it goes on bit for bit as if nothing had happened.
"""

import os
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from numbers import Integral
from pathlib import Path
from typing import Any, Generic, Literal

import numpy as np

from mpmtop.arrays import Array, number
from mpmtop.optimizers.checkpoint import (
    RESUMED_OBJECTIVE_RTOL,
    CheckpointError,
    Progress,
    Run,
    load_checkpoint,
    save_checkpoint,
)
from mpmtop.optimizers.protocols import E, Problem, State, UpdateRule
from mpmtop.optimizers.start import Start, carried, check_levels, starting_design
from mpmtop.optimizers.state import checked_start, initial_state
from mpmtop.optimizers.stopping import PAPER_RULE, History, StoppingRule

FEASIBLE = 1e-3
"""The largest constraint of a converged design, constraints being of order one: a thousandth of the limit. The
bisection of the published optimality criteria leaves up to 6e-4 of the volume; the other rules leave 1e-6 and less."""

Outcome = Literal["running", "converged", "infeasible", "max_iterations"]


class Infeasible(UserWarning):
    """A run has come to rest at a design that violates a constraint; the message says which, and by how much."""


@dataclass(frozen=True, eq=False)
class Iterate(Generic[E]):
    """Design x (n,) of one iteration of a stage with its own objective, constraints (m,) and evaluation.

    `solves` counts all analyses of all stages up to here. `outcome` of a stage's last iterate: "converged", the
    stopping rule is met and no constraint exceeds the tolerance; "infeasible", the rule is met by the objective and by
    the largest violation alike, which stays above it; "max_iterations". Of any other: "running".
    """

    iteration: int
    solves: int
    x: Array
    objective: float
    constraints: Array
    evaluation: E
    outcome: Outcome
    stage: int = 0

    @property
    def converged(self) -> bool:
        """Whether the stopping rule is met by a feasible design."""
        return self.outcome == "converged"


@dataclass(frozen=True, eq=False)
class Stage(Generic[E]):
    """A part of a run: its problem, and how it is optimised and until when."""

    problem: Problem[E]
    update: UpdateRule
    stop: StoppingRule = PAPER_RULE
    max_iterations: int = 500

    def __post_init__(self) -> None:
        if not all(hasattr(self.problem, name) for name in ("x0", "evaluate", "gradient")):
            raise ValueError(f"problem {self.problem!r} of a stage: give a `DesignProblem`, or what has its methods")
        if not hasattr(self.update, "step") or isinstance(self.update, type | range | slice):
            raise ValueError(f"update {self.update!r} of a stage: give a rule, as GCMMA()")
        if not callable(self.stop):
            raise ValueError(f"stop {self.stop!r} of a stage: give a rule, as relative_change(1e-4)")
        if not isinstance(self.max_iterations, Integral) or self.max_iterations < 0:
            raise ValueError(f"max_iterations {self.max_iterations!r}: give at least 0, a whole number")


def optimize(
    problem: Problem[E],
    update: UpdateRule,
    *,
    start: Start | None = None,
    levels: Sequence[Problem[E]] = (),
    stop: StoppingRule = PAPER_RULE,
    max_iterations: int = 500,
    feasible: float = FEASIBLE,
    checkpoint: str | os.PathLike[str] | None = None,
    checkpoint_every: int = 1,
) -> Iterator[Iterate[E]]:
    """Iterates from the start (iteration 0) until `stop` is met by a feasible design or `max_iterations` updates made.

    `start` is a design (n,), a number for all variables, or a function of their positions (n, d); x0 by default.
    `levels` are coarser problems of the same body and the same filter radius, coarsest first: each is optimised before
    the problem, from what the last one came to, by the same rules; a filter radius of 1.5 of their spacings at least is
    what they need (UnresolvedFilter). Their iterates are handed out, too: `stage` tells them apart. See `continuation`
    for the rest.
    """
    if not isinstance(levels, Sequence) or isinstance(levels, str | bytes):
        raise ValueError(f"levels {levels!r}: give a list of problems, coarsest first")
    check_levels(levels)
    stages = [Stage(each, update, stop, max_iterations) for each in (*levels, problem)]
    return continuation(
        stages, start=start, feasible=feasible, checkpoint=checkpoint, checkpoint_every=checkpoint_every
    )


def continuation(
    stages: Sequence[Stage[E]],
    *,
    start: Start | None = None,
    feasible: float = FEASIBLE,
    checkpoint: str | os.PathLike[str] | None = None,
    checkpoint_every: int = 1,
) -> Iterator[Iterate[E]]:
    """Iterates of stages, one after the other, each from the design to which the last one came.

    Stages may differ in all that a problem has: penal, projection, filter, objective, points; a design goes over to
    other points by position. Every stage counts its iterations from 0, where its start is analysed.

    With a `checkpoint` file the state is written after every `checkpoint_every`-th iterate and the last of a stage,
    before the iterate is handed out; if the file exists the run resumes from it, beginning with the iterate it holds.
    That design is analysed again, which is not counted as a solve. Warns `Infeasible`, and of displacements of
    the last design `NothingMoves` and `PlaceInVoid`, see `criteria`. Raises NotConverged on values that are not finite,
    ValueError on unusable bounds or starts, CheckpointError on a file that is damaged or belongs to another run.
    """
    if not isinstance(stages, Sequence) or not stages or not all(isinstance(stage, Stage) for stage in stages):
        raise ValueError("stages of a continuation: give a list of one `Stage(problem, update)` or more")
    if not isinstance(checkpoint_every, Integral) or checkpoint_every < 1 or not number(feasible) >= 0:
        raise ValueError(f"checkpoint_every {checkpoint_every!r}, feasible {feasible!r}: give at least 1 and 0")
    if not (checkpoint is None or isinstance(checkpoint, str | os.PathLike)):
        raise ValueError(f"checkpoint {checkpoint!r}: give the path of a file")
    path = None if checkpoint is None else Path(checkpoint)
    first = checked_start(stages[0].problem, starting_design(stages[0].problem, start))
    return _run(stages, first, feasible, path, checkpoint_every)


def _run(stages: Sequence[Stage[E]], x: Array, feasible: float, path: Path | None, every: int) -> Iterator[Iterate[E]]:
    run = Run(tuple(s.problem.fingerprint for s in stages), tuple(repr(s.update) for s in stages), x)
    at: Progress | None = None
    if path is not None and path.exists():
        at = load_checkpoint(path, run)
    for k in range(0 if at is None else at.stage, len(stages)):
        stage = stages[k]
        problem = stage.problem
        if at is not None and at.stage == k:
            evaluation = _again(path, problem, at)
        else:
            if at is not None:
                x = carried(stages[k - 1].problem, at.state.x, problem)
            evaluation = problem.evaluate(x)
            at = _started(k, problem, evaluation, x, 0 if at is None else at.solves)
        while True:
            outcome = _outcome(stage, at, feasible)
            if path is not None and (outcome != "running" or at.state.iteration % every == 0):
                save_checkpoint(path, run, at)
            if outcome == "infeasible":
                _say(at, evaluation, feasible)
            if outcome != "running" and k == len(stages) - 1:
                _remarks(problem, evaluation)
            yield Iterate(
                at.state.iteration,
                at.solves,
                at.state.x.copy(),  # the caller may do as it likes with it
                float(evaluation.objective),
                np.array(evaluation.constraints),
                evaluation,
                outcome,
                k,
            )
            if outcome != "running":
                break
            state, evaluation, spent = stage.update.step(problem, at.state, evaluation, *problem.gradient(evaluation))
            at = _gone_on(at, state, evaluation, spent)


def _started(k: int, problem: Problem[E], evaluation: E, x: Array, solves: int) -> Progress:
    """A stage at its start, evaluated."""
    state = initial_state(problem, evaluation, x)
    return Progress(k, state, [float(evaluation.objective)], [_largest(evaluation)], solves + 1)


def _gone_on(at: Progress, state: State, evaluation: Any, spent: int) -> Progress:
    """A stage after one more update."""
    objectives, largest = [*at.objectives, float(evaluation.objective)], [*at.largest, _largest(evaluation)]
    return Progress(at.stage, state, objectives, largest, at.solves + spent)


def _largest(evaluation: Any) -> float:
    return float(np.max(evaluation.constraints))


def _again(path: Path | None, problem: Problem[E], at: Progress) -> E:
    """The analysis of a checkpoint's design, whose objective must be what it was."""
    evaluation, written = problem.evaluate(at.state.x), at.objectives[-1]
    if not np.isclose(evaluation.objective, written, rtol=RESUMED_OBJECTIVE_RTOL, atol=0):
        raise CheckpointError(
            f"{path}: its design has objective {evaluation.objective} here and had {written} when written; the problem "
            "has changed: delete the file to start afresh"
        )
    return evaluation


def _outcome(stage: Stage[Any], at: Progress, feasible: float) -> Outcome:
    state = at.state
    if stage.stop(History(np.array(at.objectives), state.x, state.x_old)):
        if at.largest[-1] <= feasible:
            return "converged"
        if stage.stop(History(np.maximum(at.largest, 0), state.x, state.x_old)):
            return "infeasible"
    return "max_iterations" if state.iteration >= stage.max_iterations else "running"


def _remarks(problem: Problem[E], evaluation: E) -> None:
    """Warn of what the problem says of a final design, if it has `remarks`."""
    for said in getattr(problem, "remarks", lambda evaluation: ())(evaluation):
        warnings.warn(said, stacklevel=3)


def _say(at: Progress, evaluation: Any, feasible: float) -> None:
    worst = int(np.argmax(evaluation.constraints))
    warnings.warn(
        f"iteration {at.state.iteration} of stage {at.stage} is at rest with constraint {worst} at "
        f"{at.largest[-1]:.3g}, above the tolerance {feasible:g}; no design near it is less infeasible: relax the "
        "constraint, widen the bounds or start elsewhere",
        Infeasible,
        stacklevel=3,
    )
