"""CPU time of work measured side by side in one process."""

import multiprocessing
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from typing import Any, TypeVar

import numpy as np

from mpmtop.optimizers import GCMMA, Problem, initial_state

Work = Callable[[], object]
Result = TypeVar("Result")


def cpu_seconds(work: Mapping[str, Work], repeats: int = 8) -> dict[str, float]:
    """Median CPU seconds of one call of each piece of work.

    They take turns, so that what else the machine does meets all of them alike. The first turn is left out: it builds
    what is built once.
    """
    spent: dict[str, list[float]] = {name: [] for name in work}
    for _ in range(repeats + 1):
        for name, call in work.items():
            start = time.process_time()
            call()
            spent[name].append(time.process_time() - start)
    return {name: float(np.median(times[1:])) for name, times in spent.items()}


def in_own_process(call: Callable[..., Result], *arguments: Any) -> Result:
    """The result of a function of a module, called in a new process: nothing that this one holds or has loaded, or how
    deep its stack is, has a part in time and memory."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        return process.submit(call, *arguments).result()


def iteration(problem: Problem[Any]) -> Callable[[], float]:
    """One more iteration of an optimisation at every call: gradient, one subproblem of GCMMA, one solve; its objective
    comes back."""
    rule = GCMMA(max_inner=1)  # one solve an iteration, whatever the objective
    evaluation = problem.evaluate(problem.x0)
    state = initial_state(problem, evaluation)

    def call() -> float:
        nonlocal state, evaluation
        state, evaluation, _ = rule.step(problem, state, evaluation, *problem.gradient(evaluation))
        return float(evaluation.objective)

    return call


def evaluation_with_gradient(problem: Problem[Any]) -> Work:
    """The start's evaluation and its gradient."""
    return lambda: problem.gradient(problem.evaluate(problem.x0))


REPEATED_BELOW = 0.005
"""CPU seconds in all below which a call is repeated, three times at most: caches warm up."""


def measured(call: Callable[[], Result]) -> tuple[Result, float]:
    """The result of a call and its CPU seconds, the median of a few calls if it is short."""
    spent: list[float] = []
    while len(spent) < 3 and sum(spent) < REPEATED_BELOW:
        start = time.process_time()
        result = call()
        spent.append(time.process_time() - start)
    return result, float(np.median(spent))
