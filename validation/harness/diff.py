"""What moved between two reports: two commits, two machines, two versions of a package.

Claims, cells of tables and locked numbers are matched by name, numbers compared relatively; figures by their bytes.
"""

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any, TypeGuard

from validation.harness.blocks import Table
from validation.harness.claims import Value
from validation.harness.store import Study, blocks_of, read
from validation.harness.timed import read_timed

CERTAIN = 1e-12
"""Relative change below which two stored numbers, of twelve digits at most, are one."""


@dataclass(frozen=True)
class Moved:
    """One thing that differs: what it is, its value in both reports (None: not there), and the relative change."""

    study: str
    what: str
    before: Value | None
    after: Value | None

    @property
    def change(self) -> float | None:
        """Relative change of a number, infinite from zero; None of anything else."""
        if not (_number(self.before) and _number(self.after)):
            return None
        a, b = float(self.before), float(self.after)
        return (b - a) / abs(a) if a else math.copysign(math.inf, b - a)


def _number(value: Value | None) -> TypeGuard[int | float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


@dataclass(frozen=True)
class Comparison:
    """All that differs between the reports in two folders."""

    folders: tuple[Path, Path]
    provenance: tuple[Mapping[str, Any], Mapping[str, Any]]
    verdicts: list[Moved]
    claims: list[Moved]
    cells: list[Moved]
    locks: list[Moved]
    figures: list[tuple[str, bool, bool]]
    compared: int

    @property
    def same(self) -> bool:
        """Whether nothing moved."""
        return not (self.verdicts or self.claims or self.cells or self.locks or self.figures)


def compare(before: Path, after: Path) -> Comparison:
    """Compare the reports in two folders; ValueError if one holds none."""
    studies = []
    for folder in (before, after):
        if not list((folder / "data").glob("*.json")):
            raise ValueError(f"no report in {folder}: give two folders that --reports wrote")
        studies.append(read(folder))
    claims = [{**_claims(found.values(), "observed")} for found in studies]
    verdicts = [{**_claims(found.values(), "word")} for found in studies]
    cells = [_cells(found.values()) for found in studies]
    locks = [
        {(part.study, f"{part.test}: {lock.name}"): lock.now for part in read_timed(folder) for lock in part.locks}
        for folder in (before, after)
    ]
    provenance = tuple(
        json.loads(path.read_text("utf-8")) if (path := folder / "data" / "provenance.json").exists() else {}
        for folder in (before, after)
    )
    return Comparison(
        (before, after),
        (provenance[0], provenance[1]),
        _moved(*verdicts),
        _moved(*claims),
        _moved(*cells),
        # where one report has none, nothing is said of the other's
        _moved(*locks) if all(locks) else [],
        _figures(before, after),
        sum(len(values[0].keys() & values[1].keys()) for values in (claims, cells, locks)),
    )


def _claims(studies: Iterable[Study], field: str) -> dict[tuple[str, str], Value]:
    """A field of every claim by study and name, those of one name numbered."""
    found: dict[tuple[str, str], Value] = {}
    for study in studies:
        for reading in study.readings:
            name, number = f"{reading.test}: {reading.claim.claim}", 2
            while (study.name, name) in found:
                name, number = f"{reading.test}: {reading.claim.claim} ({number})", number + 1
            found[study.name, name] = getattr(reading.claim, field)
    return found


def _cells(studies: Iterable[Study]) -> dict[tuple[str, str], Value | None]:
    """Every cell by study, table, row (its words before the first number, and its place) and column."""
    found: dict[tuple[str, str], Value | None] = {}
    for study in studies:
        for table in blocks_of([study], Table):
            for place, row in enumerate(table.rows, 1):
                words = [cell for cell in row if isinstance(cell, str)][:2]
                label = f"{table.file}, row {place} {' '.join(words)}".strip()
                for column, cell in zip_longest(table.columns, row):
                    found[study.name, f"{label}: {column}"] = cell
    return found


def _moved(before: Mapping[tuple[str, str], Any], after: Mapping[tuple[str, str], Any]) -> list[Moved]:
    """What differs, the largest changes first, then what is in one report only."""
    moved = [
        Moved(*key, before.get(key), after.get(key))
        for key in dict.fromkeys((*before, *after))
        if not _same(before.get(key), after.get(key))
    ]
    return sorted(moved, key=lambda one: -1.0 if one.change is None else abs(one.change), reverse=True)


def _same(a: Value | None, b: Value | None) -> bool:
    if isinstance(a, float | int) and isinstance(b, float | int):
        return abs(a - b) <= CERTAIN * max(abs(a), abs(b))
    return a == b


def _figures(before: Path, after: Path) -> list[tuple[str, bool, bool]]:
    """Figures that differ, by file, and in which of the folders they are."""
    names = {path.name for folder in (before, after) for path in (folder / "figures").glob("*.*")}
    content = {
        name: [
            path.read_bytes() if (path := folder / "figures" / name).exists() else None for folder in (before, after)
        ]
        for name in sorted(names)
    }
    return [(name, a is not None, b is not None) for name, (a, b) in content.items() if a != b]
