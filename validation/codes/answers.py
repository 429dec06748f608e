"""Asking a code for an analysis: what comes back is counted before it is compared."""

from typing import Any

import numpy as np

from mpmtop.arrays import Array
from validation.measures.orders import observed_order
from validation.methods.elements import ElementMethod
from validation.methods.protocol import Analyses, Answer, Capability, Case


class NotStated(Exception):
    """The code answered without what the check is about."""


class NotSupported(Exception):
    """A case needs what the code is not capable of."""


class Misanswered(ValueError):
    """The answer is not one: of another count, not finite, in no format that was agreed."""


def asked(code: Analyses, case: Case) -> Answer:
    """The code's answer to a case: u (p, 2), stress (p, 3) or None, finite.

    Raises NotSupported for what the case needs and the code is not capable of, Misanswered for no answer.
    """
    lacks = sorted(case.needs - code.capabilities)
    if lacks:
        raise NotSupported(", ".join(lacks))
    answer = code.analyse(case)
    u = _counted(answer.u, (len(case.moduli), 2), f"displacements of {case.name}")
    stress = None
    if answer.stress is not None:
        stress = _counted(answer.stress, (len(case.moduli), 3), f"stresses of {case.name}")
    return Answer(u, stress, answer.compliance, answer.kinetic)


def _counted(values: Array, shape: tuple[int, int], what: str) -> Array:
    found = np.asarray(values, float)
    if found.shape != shape:
        raise Misanswered(f"{what} are {found.shape}: give {shape}, one row for each point")
    if not np.all(np.isfinite(found)):
        raise Misanswered(f"{np.count_nonzero(~np.isfinite(found).all(axis=1))} of {len(found)} {what} are not finite")
    return found


def stress_of(answer: Answer) -> Array:
    """Stress (p, 3), or NotStated."""
    if answer.stress is None:
        raise NotStated("stress")
    return answer.stress


def work(case: Case, answer: Answer) -> float:
    """Of the forces that points carry, at the points: the compliance, where no load acts at a position."""
    return float(np.sum(case.carried * answer.u))


def off(found: Array, right: Array) -> Array:
    """Errors (p,) by the largest right value."""
    error: Array = np.abs(found - right).max(axis=1) / np.abs(right).max()
    return error


def ratio_norm(error: Array, right: Array, volume: Array) -> float:
    """sqrt(sum V |e|^2 / sum V |right|^2)."""
    return float(np.sqrt(np.sum(volume[:, None] * error**2) / np.sum(volume[:, None] * right**2)))


def order(coarse: float, fine: float) -> float:
    """Observed order of errors at cells of twice the size and of one."""
    return float(observed_order(coarse, fine)) if fine > 0 else np.inf


def fine_work(case: Case) -> float:
    """Compliance of a case by biquadratic elements, one for each of its points."""
    return float(ElementMethod("fine reference", 2).analyse(case).compliance or np.nan)


class Remembered:
    """A code whose answers are kept by the case's name: what several checks need is asked once."""

    def __init__(self, code: Any) -> None:
        self.code, self.name, self.version = code, str(code.name), str(code.version)
        self.capabilities: frozenset[Capability] = code.capabilities
        self.accuracy = float(getattr(code, "accuracy", 0.0))
        self._answers: dict[str, Answer | Exception] = {}

    def analyse(self, case: Case) -> Answer:
        """As the code answered first, or raised."""
        if case.name not in self._answers:
            try:
                self._answers[case.name] = self.code.analyse(case)
            except Exception as error:  # of any kind: it is the code's answer to all who ask again
                self._answers[case.name] = error
        answer = self._answers[case.name]
        if isinstance(answer, Exception):
            raise answer
        return answer

    def __getattr__(self, way: str) -> Any:
        return getattr(self.code, way)
