"""Claims: what a source states beside what a study observed, the verdict, and how many there are of which kind.

What the paper says stands in `Statement`s, each with its place, its words and its kind; several readings of one
sentence are claims under one statement and count once. What else a study checks or reports is its own, kind "check".
"""

import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

Value = float | int | bool | str
Verdict = Literal["agrees", "differs", "not stated"]
State = Literal["agrees", "by reading", "differs", "not stated"]
Kind = Literal["result", "calibrated", "trend", "identity", "input", "erratum", "check"]
KINDS: dict[Kind, str] = {
    "result": "numbers that the paper prints as results",
    "calibrated": "numbers of the paper that a choice of ours was fitted to: no evidence",
    "trend": "comparisons and directions that the paper states",
    "identity": "what the equations make equal: a check of the implementation, not of the paper",
    "input": "numbers of the paper that go in: a check of the scene",
    "erratum": "misprints of the paper, confirmed by computing them",
    "check": "what we require of the results ourselves, or report for comparison",
}
PRINTED: tuple[Kind, ...] = ("result", "calibrated")
"""Kinds of the numbers that the paper prints as results."""
MEASURED = {"timed": "see timings", "benchmark": "see benchmark"}
"""In the place of a value that depends on the clock: the page it is on."""
OWN_WORDS: dict[Verdict, str] = {"agrees": "holds", "differs": "fails", "not stated": "reported"}


class Statement(NamedTuple):
    """A number or a sentence of the paper: its place, its words and what kind of claim it is; `value` is the number in
    it, a ratio if `unit` is "%"."""

    where: str
    words: str
    kind: Kind
    value: float = math.nan
    unit: Literal["", "%"] = ""


@dataclass(frozen=True)
class Claim:
    """One reading of a statement, or one check of ours, with its verdict.

    `expected` is the number or the bounds that count as agreement ("" if none), `why` the reason for them; `stated` the
    paper's words; `reason` the most likely one for a difference. Ratios with the unit "%" are shown in per cent.
    """

    claim: str
    observed: Value
    expected: Value
    rtol: float | None
    source: str
    verdict: Verdict
    kind: Kind = "check"
    stated: str = ""
    why: str = ""
    reason: str = ""
    unit: str = ""

    @property
    def of_paper(self) -> bool:
        """Whether the paper says it; if not, a check of ours. Errata are ours: the paper is wrong there."""
        return self.kind not in ("check", "erratum")

    @property
    def on_time(self) -> bool:
        """Whether it is one on measured time, whose value is kept apart: what was observed is where to find it."""
        return self.observed in MEASURED.values()

    @property
    def word(self) -> str:
        """The verdict in words: of a claim of the paper as it is, of a check of ours holds, fails or reported."""
        return self.verdict if self.of_paper else OWN_WORDS[self.verdict]

    @property
    def deviation(self) -> float | None:
        """Relative distance of what was observed from the expected number, or from the bound it breaks, 0 within
        bounds; None where there is no such number."""
        numbers = (self.observed, self.expected)
        if any(isinstance(value, str | bool) for value in numbers) and not self.bounds:
            return None
        if isinstance(self.observed, str | bool):
            return None
        ours = float(self.observed)
        if not self.bounds:
            stated = float(self.expected)
            return (ours - stated) / abs(stated) if stated else None
        broken = [bound for sign, bound in self.bounds if (ours < bound if sign == ">=" else ours > bound)]
        if not broken:
            return 0.0
        return (ours - broken[0]) / abs(broken[0]) if broken[0] else None

    @property
    def bounds(self) -> list[tuple[str, float]]:
        """Bounds that count as agreement, each a sign and a number."""
        if not isinstance(self.expected, str):
            return []
        parts = [part.split() for part in self.expected.split(" and ")]
        return [(part[0], float(part[1])) for part in parts if len(part) == 2 and part[0] in (">=", "<=")]


class Reading(NamedTuple):
    """A claim, and where it stands: the name of its `row` on its page is for links."""

    claim: Claim
    study: str
    test: str
    row: str = ""


def rows_of(test: str, claims: Iterable[str]) -> list[str]:
    """Names of the rows of claims: the test and the claim's letters and digits, numbered where parameters of a test
    make several of one name."""
    rows: list[str] = []
    for claim in claims:
        first = row = f"{test}--{re.sub(r'[^a-z0-9]+', '-', claim.lower()).strip('-')}"
        count = 1
        while row in rows:
            count += 1
            row = f"{first}-{count}"
        rows.append(row)
    return rows


@dataclass(frozen=True)
class Stand:
    """A statement of the paper, or one check of ours, with its readings."""

    readings: Sequence[Reading]

    @property
    def first(self) -> Claim:
        """The first reading: source, words and kind are those of all."""
        return self.readings[0].claim

    @property
    def state(self) -> State:
        """What holds of all readings that have a verdict; "by reading" if some agree and some differ."""
        verdicts = {reading.claim.verdict for reading in self.readings} - {"not stated"}
        if len(verdicts) == 2:
            return "by reading"
        return verdicts.pop() if verdicts else "not stated"


def stands(readings: Iterable[Reading]) -> list[Stand]:
    """Readings by statement, in the order of their first; every check of ours stands alone."""
    grouped: dict[object, list[Reading]] = {}
    for number, reading in enumerate(readings):
        claim = reading.claim
        key = (claim.kind, claim.source, claim.stated) if claim.of_paper else number
        grouped.setdefault(key, []).append(reading)
    return [Stand(of_one) for of_one in grouped.values()]


@dataclass(frozen=True)
class Tally:
    """Statements of the paper by kind and state; our checks, and the errata, by verdict."""

    paper: dict[Kind, Counter[str]]
    checks: Counter[str]
    errata: Counter[str]

    @classmethod
    def of(cls, readings: Sequence[Reading]) -> "Tally":
        """Count them."""
        paper: dict[Kind, Counter[str]] = {kind: Counter() for kind in KINDS if kind not in ("check", "erratum")}
        for stand in stands(r for r in readings if r.claim.of_paper):
            paper[stand.first.kind][stand.state] += 1
        words = {kind: Counter(r.claim.word for r in readings if r.claim.kind == kind) for kind in ("check", "erratum")}
        return cls(paper, words["check"], words["erratum"])

    @property
    def printed(self) -> int:
        """How many numbers the paper prints as results."""
        return sum(self.paper[kind].total() for kind in PRINTED)

    @property
    def required(self) -> int:
        """How many of our checks require something."""
        return self.checks["holds"] + self.checks["fails"]

    def headline(self) -> str:
        """The printed results in one sentence."""
        if not self.printed:
            return ""
        results, fitted = self.paper["result"], self.paper["calibrated"]
        by_reading = results["by reading"] + fitted["by reading"]
        parts = [f"{results['agrees']} met without fitting", f"{fitted['agrees']} met by fitting"]
        parts += [f"{fitted['differs']} fitted to and not met"] * bool(fitted["differs"])
        parts += [f"{by_reading} met in one reading and not in another"] * bool(by_reading)
        parts += [f"{results['differs']} not met"]
        return f"Of the {self.printed} numbers that the paper prints as results: {', '.join(parts)}."

    def directions(self) -> str:
        """The paper's comparisons and directions in one sentence."""
        trends = self.paper["trend"]
        if not trends.total():
            return ""
        said = {
            "agrees": "hold",
            "by reading": "hold in one reading and not in another",
            "differs": "do not",
            "not stated": "are shown without a verdict",
        }
        parts = [f"{trends[verdict]} {words}" for verdict, words in said.items() if trends[verdict]]
        return f"Of its {trends.total()} comparisons and directions: {', '.join(parts)}."
