"""What comes of the cases of every section, counted."""

from collections.abc import Callable
from functools import cache
from itertools import chain

import numpy as np

from validation.harness.report import Report
from validation.studies.stability.cases import ANALYSES, oracle
from validation.studies.stability.judge import Case, Outcome, outcome, tally
from validation.studies.stability.parameters import parameters
from validation.studies.stability.runs import interruptions, optimisers
from validation.studies.stability.scales import materials, runs_in_units, units

SECTIONS: dict[str, Callable[[], list[Case]]] = {
    "Positions": lambda: [analysis.case for analysis in ANALYSES["Positions"]()],
    "Small cuts": lambda: [*(analysis.case for analysis in ANALYSES["Small cuts"]()), *oracle()],
    "Contrast and density fields": lambda: [a.case for a in ANALYSES["Contrast and density fields"]()],
    "Points": lambda: [analysis.case for analysis in ANALYSES["Points"]()],
    "Scales": lambda: [*(analysis.case for analysis in materials()), *units(), *runs_in_units()],
    "Parameters": lambda: list(parameters()),
    "Optimiser": lambda: list(optimisers()),
    "Interruption": lambda: list(interruptions()),
}


@cache
def outcomes(section: str) -> tuple[Outcome, ...]:
    """What came of the section's cases; run once, for its own section and the last one."""
    return tuple(outcome(case) for case in SECTIONS[section]())


def compared(found: tuple[Outcome, ...]) -> int:
    """Of how many analyses there were two answers to compare, none an error."""
    return sum(case.kind in ("right", "limit") for case in found)


def outcomes_twice(every: int) -> tuple[Outcome, ...]:
    """What comes of one in `every` analyses, drawn from each so many, by multigrid, beside the direct solver."""
    analyses = [*chain.from_iterable(make() for make in ANALYSES.values()), *materials()]
    first = np.arange(0, len(analyses) - every + 1, every)
    drawn = first + np.random.default_rng(0).integers(every, size=len(first))
    return tuple(outcome(analyses[i].twice) for i in drawn)


def tabulate(report: Report, name: str, found: tuple[Outcome, ...], caption: str) -> bool:
    """Record the counts by family, and whether nothing else came out; what else did is named in the claim."""
    report.table(name, tally(found), caption)
    other = [f"{case.family} ({case.name}): {case.what}" for case in found if case.kind == "other"]
    named = f"; the first: {other[0]}".replace("|", "/")[:200] if other else ""
    what = name.replace("_", " ")
    return report.check(f"outcomes other than these three, {what}{named}", len(other), 0, source="our aim")
