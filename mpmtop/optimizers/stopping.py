"""When an optimisation is over: rules on the history of its objective and its design."""

from collections.abc import Callable
from dataclasses import dataclass
from numbers import Integral

import numpy as np

from mpmtop.arrays import Array, number


@dataclass(frozen=True, eq=False)
class History:
    """What a stopping rule sees: objective (k+1,) of iterations 0 to k, design x and the last one, x_old (n,).

    The loop shows it the history of the largest violation in the objective's place, too, where constraints are not met.
    """

    objective: Array
    x: Array
    x_old: Array


StoppingRule = Callable[[History], bool]


def relative_change(tol: float = 1e-4, window: int = 4) -> StoppingRule:
    """Stop when |J_k - J_(k-i)| <= tol |J_k| for i = 1..window (the paper's rule)."""
    if not number(tol) >= 0 or not isinstance(window, Integral) or window < 1:
        raise ValueError(f"tol {tol!r}, window {window!r}: give a tolerance of at least 0 and a window of at least 1")

    def met(history: History) -> bool:
        J = history.objective
        return len(J) > window and bool(np.all(np.abs(J[-1] - J[-1 - window : -1]) <= tol * abs(J[-1])))

    return met


def design_change(tol: float = 0.01) -> StoppingRule:
    """Stop when max |x_k - x_(k-1)| <= tol."""
    if not number(tol) >= 0:
        raise ValueError(f"tol {tol!r}: give a tolerance of at least 0")

    def met(history: History) -> bool:
        return len(history.objective) > 1 and bool(np.max(np.abs(history.x - history.x_old)) <= tol)

    return met


PAPER_RULE = relative_change()
