"""Scorecard of a code: what was checked, expected and observed, the verdict, and what usually causes a failure."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from validation.codes.answers import NotStated, NotSupported, Remembered
from validation.methods.protocol import NOT_STATED, NOT_SUPPORTED, Capability, Method

Verdict = Literal["passes", "fails", "reported", "not supported", "not stated"]


class Observed(NamedTuple):
    """A number, where the worst of it is, and the `kind` of fault that it is the mark of, if one is recognised: with a
    question mark where it may be of others, too."""

    value: float
    where: str = ""
    kind: str = ""


@dataclass(frozen=True)
class Check:
    """What is asked of a code, and why it must be so.

    `observe` gives a number, at most `at_most` or at least `at_least`, or for comparison only if neither is given;
    `why` is the reason for the bound, which is no code's result, `look` what usually causes a failure and where to
    look. What holds but for `rounding` need hold to the accuracy only that the code states.
    """

    way: str
    name: str
    needs: frozenset[Capability]
    observe: Callable[[Any], Observed]
    why: str
    look: str
    at_most: float | None = None
    at_least: float | None = None
    rounding: bool = False

    @property
    def expected(self) -> str:
        """The bound in words."""
        if self.at_most is not None:
            return f"<= {self.at_most:.3g}"
        return "for comparison" if self.at_least is None else f">= {self.at_least:.3g}"

    def of(self, code: Method) -> "Check":
        """The check as this code is asked it."""
        accuracy = float(getattr(code, "accuracy", 0.0))
        if not self.rounding or self.at_most is None or accuracy <= self.at_most:
            return self
        return replace(self, at_most=accuracy, why=f"the accuracy that the code states; else {self.at_most:.0e}")

    def holds(self, value: float) -> bool:
        """Whether a number is within the bound; NaN never is."""
        low, high = self.at_least, self.at_most
        return value == value and (low is None or value >= low) and (high is None or value <= high)


@dataclass(frozen=True)
class Row:
    """A check and what came of it; `observed` is None where there is no number."""

    check: Check
    verdict: Verdict
    observed: float | None = None
    where: str = ""
    kind: str = ""


@dataclass(frozen=True)
class Card:
    """All rows of one code."""

    code: str
    version: str
    rows: tuple[Row, ...]

    @property
    def kinds(self) -> list[str]:
        """Kinds of fault that failures were recognised as, once each; guesses only where no kind is sure."""
        kinds = list(dict.fromkeys(row.kind for row in self.rows if row.verdict == "fails" and row.kind))
        return [kind for kind in kinds if not kind.endswith("?")] or kinds

    def of(self, verdict: Verdict) -> list[Row]:
        """Rows of one verdict."""
        return [row for row in self.rows if row.verdict == verdict]

    @property
    def verdict(self) -> str:
        """In a sentence."""
        passed, failed = len(self.of("passes")), self.of("fails")
        asked = f"{passed} of {passed + len(failed)} checks pass"
        if not failed:
            return asked
        named = f": {'; '.join(self.kinds)}" if self.kinds else ""
        return f"{asked}, {len(failed)} fail{named}"


def scorecard(code: Any, checks: Iterable[Check]) -> Card:
    """Ask the code what it is capable of, check by check. Whatever it raises fails one row, and ends nothing."""
    asked = Remembered(code)
    return Card(asked.name, asked.version, tuple(_row(asked, check.of(asked)) for check in checks))


def _row(code: Method, check: Check) -> Row:
    lacks = sorted(check.needs - code.capabilities)
    if lacks:
        return Row(check, NOT_SUPPORTED, where=", ".join(lacks))
    try:
        with np.errstate(all="ignore"):  # what answers of any size make of it is judged as a number
            value, where, kind = check.observe(code)
    except NotSupported as lack:
        return Row(check, NOT_SUPPORTED, where=str(lack))
    except NotStated as nothing:
        return Row(check, NOT_STATED, where=str(nothing))
    except Exception as error:  # a code of any author may raise anything, and may not end the run
        return Row(check, "fails", where=f"{type(error).__name__}: {error}")
    if check.at_most is None and check.at_least is None and value == value:
        return Row(check, "reported", value, where)
    return Row(check, "passes", value) if check.holds(value) else Row(check, "fails", value, where, kind)
