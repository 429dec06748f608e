"""What the report records that depends on the clock or the machine: seconds, ratios, the drift of locked numbers, and
which run a section is of; kept apart from all that does not.

Each test's part is in one of two places. What a plain run measures is in `timed/`, a folder that git passes over, and
on the timings page; what `--benchmark` runs takes so long that it is kept with the code, with the machine, the date and
the commit it was run on: in `benchmark/`, and on the benchmark page what it measured.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal, Self

from validation.harness.blocks import Block, Drawing, Table
from validation.harness.claims import Value
from validation.harness.report import Locked, Ratio, Report
from validation.harness.store import Study, as_csv, as_json, read_blocks

Place = Literal["timed", "benchmark"]
PLACES: tuple[Place, ...] = ("timed", "benchmark")
RATIO_COLUMNS = ("study", "test", "claim", "ratio", "expected", "source", "verdict")
LOCK_COLUMNS = ("study", "test", "number", "locked", "this run", "drift", "tolerance", "within")


@dataclass(frozen=True)
class Timed:
    """One test function's last run: where, `when` (date and commit) and by which command; what it measured; its locked
    numbers; and the seconds it took, on the wall and of CPU, with the fixtures that it was the first to ask for."""

    study: str
    test: str
    place: Place
    machine: str
    when: str
    wall: float
    cpu: float
    ratios: list[Ratio]
    blocks: list[Block]
    command: str = ""
    locks: list[Locked] = field(default_factory=list)

    @property
    def shown(self) -> bool:
        """Whether it measured anything but its own time."""
        return bool(self.ratios or self.blocks)


def read_timed(directory: Path) -> list[Timed]:
    """What has been measured so far; of a plain run's times nothing, which the next run measures again, if another
    version stored them. ValueError if the benchmark's store is unreadable: nothing measured may be lost."""
    parts: list[Timed] = []
    for place in PLACES:
        path = directory / place / "sections.json"
        try:
            stored = json.loads(path.read_text("utf-8")) if path.exists() else []
            parts += [Timed(**part | _parts_of(part)) for part in stored]
        except (ValueError, KeyError, TypeError) as error:
            if place == "benchmark":
                raise ValueError(f"{path} is not a store of this report: restore the committed one") from error
    return parts


def _parts_of(part: Mapping[str, Any]) -> dict[str, object]:
    return {
        "ratios": [Ratio(**ratio) for ratio in part["ratios"]],
        "blocks": read_blocks(part["blocks"]),
        "locks": [Locked(**locked) for locked in part.get("locks", [])],
    }


def merge_timed(
    old: Iterable[Timed], reports: Iterable[Report], studies: Iterable[Study], machine: str, when: str, command: str
) -> list[Timed]:
    """What the tests that ran measured, and the old of the other tests, in the order of the studies."""
    by_test: dict[tuple[str, str], list[Report]] = {}
    for report in reports:
        by_test.setdefault((report.study, report.test), []).append(report)
    known = {(part.study, part.test): part for part in old}
    known |= {
        (study, test): Timed(
            study,
            test,
            "benchmark" if cases[0].benchmark else "timed",
            machine,
            when,
            round(sum(case.wall for case in cases), 3),
            round(sum(case.cpu for case in cases), 3),
            [ratio for case in cases for ratio in case.ratios],
            [block for case in cases for block in case.timed.blocks],
            command,
            [locked for case in cases for locked in case.locks],
        )
        for (study, test), cases in by_test.items()
    }
    tests = [(study.name, section.test) for study in studies for section in study.sections]
    return [known[test] for test in tests if test in known]


def timed_files(timed: Sequence[Timed]) -> dict[str, str]:
    """Stores and CSV files, text by path relative to the report, and what makes git pass over those of a plain run."""
    files: dict[str, str] = {}
    for place in PLACES:
        parts = [part for part in timed if part.place == place]
        if not parts:
            continue
        tables = [block for part in parts for block in part.blocks if isinstance(block, Table)]
        files |= {f"{place}/{table.file}.csv": as_csv(table.columns, table.rows) for table in tables}
        rows: list[list[Value | None]] = [
            [part.study, part.test, ratio.claim, ratio.ratio, ratio.expected, ratio.source, ratio.word]
            for part in parts
            for ratio in part.ratios
        ]
        files[f"{place}/ratios.csv"] = as_csv(RATIO_COLUMNS, rows)
        files[f"{place}/sections.json"] = as_json([asdict(part) for part in parts])
    if "timed/sections.json" in files:
        files["timed/.gitignore"] = "*\n"
        locks: list[list[Value | None]] = [
            [part.study, part.test, lock.name, lock.stored, lock.now, lock.drift, lock.rtol, lock.within]
            for part in timed
            for lock in part.locks
        ]
        files["timed/locks.csv"] = as_csv(LOCK_COLUMNS, locks)
    return files


def timed_drawings(timed: Iterable[Timed]) -> set[str]:
    """Paths, relative to the report, of the figures."""
    return {f"{part.place}/{block.file}.svg" for part in timed for block in part.blocks if isinstance(block, Drawing)}


@dataclass(frozen=True)
class Regression:
    """What became of the locked numbers: those `within` their tolerance and those `outside`, with study and test."""

    within: list[tuple[Timed, Locked]]
    outside: list[tuple[Timed, Locked]]

    @classmethod
    def of(cls, timed: Iterable[Timed], study: str = "") -> Self:
        """Of all sections' last runs on this machine, or those of one study."""
        locks = [(part, lock) for part in timed if study in ("", part.study) for lock in part.locks]
        return cls([pair for pair in locks if pair[1].within], [pair for pair in locks if not pair[1].within])

    @property
    def count(self) -> int:
        """Locked numbers in all."""
        return len(self.within) + len(self.outside)

    @property
    def largest(self) -> float:
        """Largest size of a drift."""
        return max((abs(lock.drift) for _, lock in (*self.within, *self.outside)), default=0.0)


def time_of_studies(timed: Iterable[Timed], studies: Iterable[Study]) -> list[Mapping[str, float | str]]:
    """Where the time of a plain run goes: wall and CPU seconds of every study, most first."""
    titles = {study.name: study.title for study in studies}
    rows: dict[str, list[Timed]] = {}
    for part in timed:
        if part.place == "timed":
            rows.setdefault(part.study, []).append(part)
    spent = [
        {"study": name, "title": titles[name], "wall": sum(p.wall for p in parts), "cpu": sum(p.cpu for p in parts)}
        for name, parts in rows.items()
    ]
    return sorted(spent, key=lambda row: -float(row["cpu"]))
