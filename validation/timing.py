"""CPU time of optimisation work, measured side by side in one process."""

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from mpmtop.gcmma import GCMMA, Problem, initial_state


def cpu_seconds(problems: Mapping[str, Problem[Any]], repeats: int = 8) -> dict[str, float]:
    """Median CPU seconds that each problem takes for one solve, its gradient and one update's subproblem.

    The problems take turns, so that what else the machine does meets all of them alike. The first turn is left out: it
    builds what is built once.
    """
    rule = GCMMA(max_inner=1)  # one solve an update, whatever the objective
    evaluations = {name: problem.evaluate(problem.x0) for name, problem in problems.items()}
    states = {name: initial_state(problem, evaluations[name]) for name, problem in problems.items()}
    spent: dict[str, list[float]] = {name: [] for name in problems}
    for _ in range(repeats + 1):
        for name, problem in problems.items():
            start = time.process_time()
            gradient = problem.gradient(evaluations[name])
            states[name], evaluations[name], _ = rule.step(problem, states[name], evaluations[name], *gradient)
            spent[name].append(time.process_time() - start)
    return {name: float(np.median(times[1:])) for name, times in spent.items()}
