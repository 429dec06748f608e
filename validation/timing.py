"""CPU time of optimisation iterations, measured side by side in one process."""

import time
from collections.abc import Mapping
from itertools import islice
from typing import Any

import numpy as np

from mpmtop.gcmma import GCMMA, Problem
from mpmtop.optimize import optimize


def cpu_seconds(problems: Mapping[str, Problem[Any]], iterations: int = 8) -> dict[str, float]:
    """Median CPU seconds of an iteration of each problem, the iterations of all taken in turn.

    In turn, so that what else the machine does meets all of them alike. The first iteration is left out: it builds
    what is built once.
    """
    loops = {name: optimize(problem, GCMMA(), max_iterations=iterations) for name, problem in problems.items()}
    spent: dict[str, list[float]] = {name: [] for name in problems}
    for _ in range(iterations + 1):
        for name, loop in loops.items():
            start = time.process_time()
            list(islice(loop, 1))
            spent[name].append(time.process_time() - start)
    return {name: float(np.median(times[2:])) for name, times in spent.items()}
