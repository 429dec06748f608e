"""`claims.csv`: what is the same on every run, and what is of this machine and this run."""

import csv
from dataclasses import replace

from validation.harness.claims import MEASURED, Claim
from validation.harness.report import Ratio
from validation.harness.rows import KEPT, OF_RUN, claim_files
from validation.harness.store import Section, Study
from validation.harness.timed import Place, Timed

PLAIN = Claim("jump", 0.137, 0.138, 0.02, "Sect. 5", "agrees", "result", "a jump of 13.8 %")


def speed_up(place: Place) -> Claim:
    """A claim on time as a section of either kind records it."""
    return Claim("speed-up", MEASURED[place], ">= 2", None, "our aim", "agrees")


def section(test: str, *claims: Claim) -> Section:
    return Section(test, test, "", "", list(claims), [])


def part(test: str, place: Place, ratio: float) -> Timed:
    measured = Ratio("speed-up", ratio, ">= 2", "our aim", "agrees")
    return Timed("crossing", test, place, f"machine of {place}", f"day of {place}", 1.0, 1.0, [measured], [])


STUDY = Study(
    "crossing",
    "Crossing",
    "",
    [
        section("test_jump", PLAIN, speed_up("timed")),
        section("test_long", speed_up("benchmark")),
        section("test_elsewhere", PLAIN),
    ],
)
PARTS = [part("test_jump", "timed", 3.5), part("test_long", "benchmark", 7.0)]


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(text.splitlines()))


def told(text: str, *columns: str) -> list[tuple[str, ...]]:
    return [tuple(row[column] for column in columns) for row in rows(text)]


def test_the_kept_table_is_the_same_whatever_ran() -> None:
    """Numbers of the benchmark with their machine; none of a plain run, whether or not there was one."""
    files = [
        claim_files([STUDY], parts, ran)
        for parts, ran in ((PARTS, {("crossing", "test_jump")}), (PARTS[1:], frozenset()))
    ]
    kept = files[0]["data/claims.csv"]
    assert kept == files[1]["data/claims.csv"]
    assert tuple(rows(kept)[0]) == KEPT
    assert told(kept, "test", "claim", "observed", "verdict", "made by", "machine") == [
        ("test_jump", "jump", "0.137", "agrees", "make validate", ""),
        ("test_jump", "speed-up", "", "holds", "make validate", ""),
        ("test_long", "speed-up", "7.0", "holds", "make benchmark", "machine of benchmark"),
        ("test_elsewhere", "jump", "0.137", "agrees", "make validate", ""),
    ]
    assert "timed/claims.csv" not in files[1]  # nothing of this machine is known


def test_the_table_of_the_run_says_what_is_of_it() -> None:
    """Every claim on time has its number; rows of this run are told from those carried over."""
    of_run = claim_files([STUDY], PARTS, {("crossing", "test_jump")})["timed/claims.csv"]
    assert tuple(rows(of_run)[0]) == OF_RUN
    assert told(of_run, "test", "observed", "run", "when", "machine") == [
        ("test_jump", "0.137", "this run", "day of timed", "machine of timed"),
        ("test_jump", "3.5", "this run", "day of timed", "machine of timed"),
        ("test_long", "7.0", "carried over", "day of benchmark", "machine of benchmark"),
        ("test_elsewhere", "0.137", "carried over", "", ""),
    ]


def test_no_page_stands_for_a_number() -> None:
    """What was measured is a number or empty in both tables, also where its section is known to no run."""
    without = replace(STUDY, sections=STUDY.sections[:2])
    for parts in (PARTS, PARTS[:1]):
        for text in claim_files([without], parts, frozenset()).values():
            assert not {row["observed"] for row in rows(text)} & set(MEASURED.values())
