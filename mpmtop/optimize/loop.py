"""The optimisation loop of the paper's Fig. 6 as a generator: the caller decides when to draw, save or leave it.

    for iterate in optimize(problem, GCMMA()):
        print(iterate.iteration, iterate.objective)

A run with a checkpoint can be killed at any moment; started again, it goes on bit for bit as if nothing had happened.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Generic

import numpy as np

from mpmtop.optimize.checkpoint import RESUMED_OBJECTIVE_RTOL, CheckpointError, load_checkpoint, save_checkpoint
from mpmtop.optimize.protocols import E, Problem, UpdateRule
from mpmtop.optimize.state import initial_state
from mpmtop.scene import Array


@dataclass(frozen=True, eq=False)
class Iterate(Generic[E]):
    """Design x (n,) of one iteration with its own objective, constraints (m,) and evaluation.

    `solves` counts all analyses up to here; `converged` tells whether the stopping rule is met.
    """

    iteration: int
    solves: int
    x: Array
    objective: float
    constraints: Array
    evaluation: E
    converged: bool


@dataclass(frozen=True, eq=False)
class History:
    """What a stopping rule sees: objective (k+1,) of iterations 0 to k, design x and the last one, x_old (n,)."""

    objective: Array
    x: Array
    x_old: Array


StoppingRule = Callable[[History], bool]


def relative_change(tol: float = 1e-4, window: int = 4) -> StoppingRule:
    """Stop when |J_k - J_(k-i)| <= tol |J_k| for i = 1..window (the paper's rule)."""
    if not tol >= 0 or window < 1:
        raise ValueError(f"tol {tol}, window {window}: give a tolerance of at least 0 and a window of at least 1")

    def met(history: History) -> bool:
        J = history.objective
        return len(J) > window and bool(np.all(np.abs(J[-1] - J[-1 - window : -1]) <= tol * abs(J[-1])))

    return met


def design_change(tol: float = 0.01) -> StoppingRule:
    """Stop when max |x_k - x_(k-1)| <= tol."""
    if not tol >= 0:
        raise ValueError(f"tol {tol}: give a tolerance of at least 0")

    def met(history: History) -> bool:
        return len(history.objective) > 1 and bool(np.max(np.abs(history.x - history.x_old)) <= tol)

    return met


PAPER_RULE = relative_change()


def optimize(
    problem: Problem[E],
    update: UpdateRule,
    *,
    stop: StoppingRule = PAPER_RULE,
    max_iterations: int = 500,
    checkpoint: Path | None = None,
    checkpoint_every: int = 1,
) -> Iterator[Iterate[E]]:
    """Iterates from x0 (iteration 0) until `stop` is met or `max_iterations` updates are made.

    With a `checkpoint` file the state is written after every `checkpoint_every`-th iterate and the last, before the
    iterate is handed out; if the file exists the run resumes from it, beginning with the iterate it holds. That design
    is analysed again, which is not counted as a solve. Raises NotConverged on values that are not finite, ValueError on
    unusable bounds, CheckpointError on a file that is damaged or belongs to another problem or rule.
    """
    if max_iterations < 0 or checkpoint_every < 1:
        raise ValueError(f"max_iterations {max_iterations}, checkpoint_every {checkpoint_every}: give at least 0 and 1")
    run = f"{problem.fingerprint}\n{update!r}"
    if checkpoint is not None and checkpoint.exists():
        state, objectives, solves = load_checkpoint(checkpoint, run)
        evaluation = problem.evaluate(state.x)
        if not np.isclose(evaluation.objective, objectives[-1], rtol=RESUMED_OBJECTIVE_RTOL, atol=0):
            raise CheckpointError(
                f"{checkpoint}: its design has objective {evaluation.objective} here and had {objectives[-1]} when "
                "written; the problem has changed: delete the file to start afresh"
            )
    else:
        evaluation = problem.evaluate(problem.x0)
        state, objectives, solves = initial_state(problem, evaluation), [float(evaluation.objective)], 1
    while True:
        converged = stop(History(np.array(objectives), state.x, state.x_old))
        last = converged or state.iteration >= max_iterations
        if checkpoint is not None and (last or state.iteration % checkpoint_every == 0):
            save_checkpoint(checkpoint, run, state, objectives, solves)
        yield Iterate(
            state.iteration,
            solves,
            state.x.copy(),  # the caller may do as it likes with it
            float(evaluation.objective),
            np.array(evaluation.constraints),
            evaluation,
            converged,
        )
        if last:
            return
        state, evaluation, spent = update.step(problem, state, evaluation, *problem.gradient(evaluation))
        objectives.append(float(evaluation.objective))
        solves += spent
