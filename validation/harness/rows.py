"""The claims of all studies as one table, `claims.csv`, a row for each.

That in `data/` is the same on every run of one commit. It names the command that makes a row; a claim on time has a
number there if the benchmark measured it, which is kept with the code, and the machine with it. That in `timed/`, which
git passes over, is of this machine: every claim on time has its number, and a row says whether it is of the last run or
was carried over, and from which.
"""

from collections.abc import Iterable, Mapping, Sequence
from collections.abc import Set as AbstractSet

from validation.harness.claims import Claim, Value
from validation.harness.store import Study, as_csv
from validation.harness.timed import Timed

CLAIM = (
    "study",
    "test",
    "kind",
    "source",
    "stated",
    "claim",
    "observed",
    "expected",
    "rtol",
    "verdict",
    "why",
    "reason",
)
KEPT = (*CLAIM, "made by", "machine")
OF_RUN = (*CLAIM, "run", "when", "machine")
Row = list[Value | None]
Places = Mapping[tuple[str, str], Timed]
"""Sections by study and test."""


def claim_files(studies: Sequence[Study], timed: Iterable[Timed], ran: AbstractSet[tuple[str, str]]) -> dict[str, str]:
    """Both tables, text by path relative to the report; `ran` holds study and test of the sections of this run."""
    places = {(part.study, part.test): part for part in timed}
    claims = [
        (study.name, section.test, claim) for study in studies for section in study.sections for claim in section.claims
    ]
    kept = [
        [*row(study, test, claim, places, ("benchmark",)), *made(places.get((study, test)), claim)]
        for study, test, claim in claims
    ]
    files = {"data/claims.csv": as_csv(KEPT, kept)}
    if any(part.place == "timed" for part in places.values()):
        of_run = [
            [*row(study, test, claim, places, ("benchmark", "timed")), *origin(places.get((study, test)), ran)]
            for study, test, claim in claims
        ]
        files["timed/claims.csv"] = as_csv(OF_RUN, of_run)
    return files


def row(study: str, test: str, claim: Claim, places: Places, told: Sequence[str]) -> Row:
    """A claim; one on time with its number if the place where it is measured is among those `told`, else empty."""
    observed: Value | None = claim.observed
    if claim.on_time:
        part = places.get((study, test))
        ratios = {ratio.claim: ratio.ratio for ratio in part.ratios} if part and part.place in told else {}
        observed = ratios.get(claim.claim)
    return [
        *(study, test, claim.kind, claim.source, claim.stated, claim.claim, observed, claim.expected, claim.rtol),
        *(claim.word, claim.why, claim.reason),
    ]


def made(part: Timed | None, claim: Claim) -> Row:
    """The command that makes a row, and the machine that a kept number on time is of."""
    benchmark = part is not None and part.place == "benchmark"
    return [
        "make benchmark" if benchmark else "make validate",
        part.machine if part and benchmark and claim.on_time else "",
    ]


def origin(part: Timed | None, ran: AbstractSet[tuple[str, str]]) -> Row:
    """Whether a row is of this run, and when and where it was made; of a section that no run on this machine has made
    only that it is carried over."""
    if part is None:
        return ["carried over", "", ""]
    run = "this run" if (part.study, part.test) in ran else "carried over"
    return [run, part.when, part.machine]
