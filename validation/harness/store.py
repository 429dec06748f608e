"""Stores of the report: one JSON file per study, `data/<study>.json`, and what is read from it.

Every page and table is a function of the stores, so a run of part of the studies replaces the sections that ran and
leaves the rest as they were. Stores, Markdown, CSV, SVG and PNG are the same on every run of one commit.
"""

import csv
import io
import json
import re
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from inspect import cleandoc
from itertools import accumulate
from pathlib import Path
from typing import Any, TypeVar

from mpmtop.page.numbers import number
from validation.harness.blocks import Block, Drawing, Frames, Pixels, Table, Text
from validation.harness.claims import Claim, Reading, Value, rows_of
from validation.harness.heading import Heading
from validation.harness.report import RESERVED, Report

B = TypeVar("B")
NAMED = re.compile(r"\{([^{}]+)\}")
"""A claim named in a sentence."""


@dataclass(frozen=True)
class Section:
    """What one test function recorded; `ended_by` names the exception that ended it, "" if it passed; `path` is that of
    its module from the root of the tests."""

    test: str
    title: str
    text: str
    ended_by: str
    claims: list[Claim]
    blocks: list[Block]
    path: str = ""
    found: list[str] = field(default_factory=list)
    so: list[str] = field(default_factory=list)
    front: dict[str, list[str]] = field(default_factory=dict)
    opening: list[Block] = field(default_factory=list)


HEADED = 80
"""Words of findings at the head of a page: with the question and the conclusion they are read in half a minute."""


@dataclass(frozen=True)
class Study:
    """Sections, title, introduction and question of a page, as `heading` has them; `found` and `so` are sentences on
    what is measured rarely, with names of claims in braces for their values."""

    name: str
    title: str
    introduction: str
    sections: list[Section]
    asked: str = ""
    found: list[str] = field(default_factory=list)
    so: list[str] = field(default_factory=list)

    @property
    def readings(self) -> list[Reading]:
        """The claims of all sections, each with its place."""
        return [
            Reading(claim, self.name, section.test, row)
            for section in self.sections
            for claim, row in zip(
                section.claims, rows_of(section.test, (claim.claim for claim in section.claims)), strict=True
            )
        ]

    @property
    def claims(self) -> list[Claim]:
        """The claims of all sections."""
        return [claim for section in self.sections for claim in section.claims]

    def told(self, what: str) -> list[str]:
        """Sentences `found`, or the conclusions `so`, of all sections."""
        return [sentence for section in self.sections for sentence in getattr(section, what)]

    def leading(self, measured: Mapping[str, float]) -> list[str]:
        """Findings that head the page: what no section holds, then of those on the front page and of all others, in
        their order, as many as HEADED words hold, one at least. The rest stand beside their sections in the list of
        contents; a page of one section has no such list."""
        of_front = {sentence for section in self.sections for told in section.front.values() for sentence in told}
        found = sorted(self.told("found"), key=lambda sentence: sentence not in of_front)
        whole = self.filled("found", measured)
        if len(self.sections) == 1:
            return whole + found
        words = accumulate((len(sentence.split()) for sentence in found), initial=len(" ".join(whole).split()))
        held = bisect_right([*words][1:], HEADED)
        return whole + found[: held if whole else max(held, 1)]

    def filled(self, what: str, measured: Mapping[str, float]) -> list[str]:
        """The sentences of its constants with the values of what was `measured` by claim, or of claims; without those
        of which a value is missing."""
        values: dict[str, Value] = {claim.claim: claim.observed for claim in self.claims} | dict(measured)
        numbers = {name: number(value) for name, value in values.items() if isinstance(value, int | float)}
        return [
            NAMED.sub(lambda name: numbers[name[1]], sentence)
            for sentence in getattr(self, what)
            if all(name in numbers for name in NAMED.findall(sentence))
        ]

    @property
    def opening(self) -> list[Block]:
        """What stands at the top of the page; rows that are part of one table in that."""
        blocks: list[Block] = []
        wholes: dict[str, int] = {}
        for block in (block for section in self.sections for block in section.opening):
            if not (isinstance(block, Table) and block.part_of):
                blocks.append(block)
            elif block.part_of not in wholes:
                wholes[block.part_of] = len(blocks)
                blocks.append(replace(block, file=block.part_of))
            else:
                before = blocks[wholes[block.part_of]]
                assert isinstance(before, Table)
                blocks[wholes[block.part_of]] = replace(before, rows=before.rows + block.rows)
        return blocks


@dataclass(frozen=True)
class Ran:
    """A test function that ran or was skipped, fit to pass from one process to another: its place in the collection,
    its module's folder and path, its docstring and its recorder."""

    position: int
    folder: Path
    path: str
    docstring: str | None
    report: Report


def section(runs: Sequence[Ran]) -> Section:
    """What the runs of one test function (several if parametrised) recorded, in their order."""
    reports = [run.report for run in runs]
    title, text = _headed(runs[0].docstring, reports[0].test)
    front: dict[str, list[str]] = {}
    for report in reports:
        for topic, sentences in report.front.items():
            front[topic] = front.get(topic, []) + sentences
    return Section(
        reports[0].test,
        title,
        text,
        next((report.ended_by for report in reports if report.ended_by), ""),
        [claim for report in reports for claim in report.claims],
        [block for report in reports for block in report.blocks],
        runs[0].path,
        [sentence for report in reports for sentence in report.findings],
        [sentence for report in reports for sentence in report.conclusions],
        front,
        [block for report in reports for block in report.opening.blocks],
    )


def merge(old: Study | None, runs: Sequence[Ran], heading: Heading) -> Study:
    """The study of a folder: its sections that ran, the old ones of its other functions, none of removed functions.

    Raises ValueError if two sections have a file of one name: processes beside each other cannot see that.
    """
    name = runs[0].report.study
    by_test: dict[str, list[Ran]] = {}
    for run in runs:
        by_test.setdefault(run.report.test, []).append(run)
    known = {section.test: section for section in (old.sections if old else [])}
    known |= {test: section(of_test) for test, of_test in by_test.items()}
    sections = [known[test] for test in heading.tests if test in known]
    blocks = [block for part in sections for block in (*part.opening, *part.blocks) if not isinstance(block, Text)]
    if twice := [
        file for (_, file), count in Counter((block.kind, block.file) for block in blocks).items() if count > 1
    ]:
        raise ValueError(f"{twice[0]} is recorded by two sections: give each table and figure of a study its own name")
    return headed(Study(name, "", "", sections), heading)


def headed(study: Study, heading: Heading) -> Study:
    """The study with the title, introduction and question that its folder has now."""
    title, introduction = _headed(heading.docstring, study.name)
    found, so = list(heading.found), list(heading.so)
    return replace(study, title=title, introduction=introduction, asked=heading.asked, found=found, so=so)


def marked(study: Study, crashed: Iterable[tuple[str, str]]) -> Study:
    """The study with the sections of tests that ended their process marked so, whatever they held before."""
    tests = {test for name, test in crashed if name == study.name}
    sections = [
        replace(section, ended_by="a crash of the process") if section.test in tests else section
        for section in study.sections
    ]
    return replace(study, sections=sections)


def _headed(docstring: str | None, name: str) -> tuple[str, str]:
    """First line and rest of a docstring; without one, the name in words."""
    title, _, text = cleandoc(docstring or name.removeprefix("test_").replace("_", " ").capitalize()).partition("\n")
    return title.removesuffix("."), text.strip()


def read(directory: Path) -> dict[str, Study]:
    """The studies stored in `directory`/data, by name."""
    stores = sorted((directory / "data").glob("*.json"))
    return {path.stem: _read_study(path) for path in stores if path.stem not in RESERVED}


def read_blocks(stored: Iterable[Mapping[str, Any]]) -> list[Block]:
    """Blocks as a store holds them."""
    kinds: dict[str, type[Block]] = {
        "text": Text,
        "table": Table,
        "figure": Drawing,
        "design": Pixels,
        "frames": Frames,
    }
    return [kinds[block["kind"]](**block) for block in stored]


def _read_study(path: Path) -> Study:
    try:
        stored = json.loads(path.read_text("utf-8"))
        for section in stored["sections"]:
            section["claims"] = [Claim(**claim) for claim in section["claims"]]
            for blocks in ("blocks", "opening"):
                section[blocks] = read_blocks(section.get(blocks, []))
        return Study(**stored | {"sections": [Section(**section) for section in stored["sections"]]})
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path} is not a store of this report: delete it, or restore the committed one") from error


def data_files(studies: Sequence[Study]) -> dict[str, str]:
    """Stores and CSV files, text by path relative to the report."""
    files = {f"data/{study.name}.json": as_json(asdict(study)) for study in studies}
    files |= {f"data/{table.file}.csv": as_csv(table.columns, table.rows) for table in blocks_of(studies, Table)}
    return files


def drawings(studies: Sequence[Study]) -> set[str]:
    """Paths, relative to the report, of the figures of the studies."""
    figures = {f"figures/{drawing.file}.svg" for drawing in blocks_of(studies, Drawing)}
    files = [design.file for design in blocks_of(studies, Pixels)]
    files += [frames.file for frames in blocks_of(studies, Frames)]
    return figures | {f"figures/{file}.png" for file in files}


def blocks_of(studies: Iterable[Study], kind: type[B]) -> list[B]:
    """All blocks of one kind."""
    return [
        block
        for study in studies
        for block in (*study.opening, *(block for section in study.sections for block in section.blocks))
        if isinstance(block, kind)
    ]


def as_json(stored: Any) -> str:
    """Text of a store."""
    return json.dumps(stored, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def as_csv(columns: Iterable[str], rows: Iterable[Iterable[Value | None]]) -> str:
    """Text of a table."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([columns, *rows])
    return text.getvalue()
