"""Scorecards as they are kept: what was found, with date, version and machine, for pages made where a code is not."""

import json
import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from validation.codes.card import Card, Verdict


@dataclass(frozen=True)
class KeptRow:
    """A row without the check itself."""

    way: str
    check: str
    expected: str
    why: str
    look: str
    verdict: Verdict
    observed: float | None
    where: str
    kind: str


@dataclass(frozen=True)
class Kept:
    """A scorecard, its verdict in a sentence, and of which run it is."""

    code: str
    version: str
    when: str
    machine: str
    verdict: str
    rows: tuple[KeptRow, ...]

    def of(self, *verdicts: Verdict) -> list[KeptRow]:
        """Rows of one verdict, or of several, those of the first one first."""
        return [row for verdict in verdicts for row in self.rows if row.verdict == verdict]

    @property
    def line(self) -> str:
        """For the terminal: numbers, and the names of what failed."""
        failed = "; ".join(row.check for row in self.of("fails"))
        counts = f"{len(self.of('passes'))} pass, {len(self.of('fails'))} fail{f' ({failed})' if failed else ''}"
        return f"{self.code}: {counts}, {len(self.of('not supported'))} not supported"


def kept(card: Card, when: str, machine: str) -> Kept:
    """A card of a run on a day, on a machine. Numbers have six digits."""
    rows = tuple(
        KeptRow(
            *(row.check.way, row.check.name, row.check.expected, row.check.why, row.check.look, row.verdict),
            *(None if row.observed is None else float(f"{row.observed:.6g}"), row.where, row.kind),
        )
        for row in card.rows
    )
    return Kept(card.code, card.version, when, machine, card.verdict, rows)


def write(folder: Path, card: Kept) -> Path:
    """Keep a card; one of the same code before it is replaced."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{re.sub(r'[^0-9a-z]+', '_', card.code.lower()).strip('_') or 'code'}.json"
    path.write_text(json.dumps(_plain(asdict(card)), indent=1, ensure_ascii=False, allow_nan=False) + "\n", "utf-8")
    return path


def _plain(value: Any) -> Any:
    """Infinities and NaN as words, which JSON has not."""
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return str(value) if isinstance(value, float) and not abs(value) < float("inf") else value


def read(folder: Path) -> list[Kept]:
    """All kept cards, by name of file; ValueError names a file that is none."""
    cards = []
    for path in sorted(folder.glob("*.json")):
        try:
            stored = json.loads(path.read_text("utf-8"))
            rows = tuple(
                KeptRow(**(row | {"observed": None if row["observed"] is None else float(row["observed"])}))
                for row in stored["rows"]
            )
            cards.append(Kept(**stored | {"rows": rows}))
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(f"{path} is no scorecard: delete it, or restore the committed one") from error
    return cards


def matrix(cards: Iterable[Kept]) -> dict[str, dict[str, str]]:
    """Check by code: the verdict, with the number where it tells more than that."""
    table: dict[str, dict[str, str]] = {}
    for card in cards:
        for row in card.rows:
            table.setdefault(f"{row.way}: {row.check}", {})[card.code] = cell(row)
    return table


def cell(row: KeptRow, digits: bool = False) -> str:
    """A row in a word and a number; unless `digits` are asked for, what passes to rounding has none, as that differs
    from machine to machine."""
    if row.observed is None:
        return row.verdict
    if row.verdict == "passes" and not digits and row.expected.startswith("<=") and abs(row.observed) < 1e-8:
        return "passes"
    number = f"{row.observed:.3g}"
    return number if row.verdict == "reported" else f"{row.verdict} ({number})"


def told(row: KeptRow) -> str:
    """A failure in a line: the number, where it is and where to look, as far as these are known."""
    look = f"Look at {row.look}" if row.look else ""
    return ". ".join(part for part in ("; ".join(filter(None, (cell(row), row.where))), look) if part) + "."
