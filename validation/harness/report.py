"""The report of a validation run: what a study records, and the files made from it.

A study is a module `test_<study>.py`; each of its test functions is a section. Sections are kept in one JSON store per
study, `data/<study>.json`; every page and table is a function of the stores, so a run of part of the studies replaces
the sections that ran and leaves the rest as they were. Stores, Markdown, CSV and SVG are the same on every run of one
commit; what depends on the clock or the machine is written apart from them, see `validation.harness.timed`.
"""

import csv
import io
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from inspect import cleandoc
from pathlib import Path
from typing import Any, Literal, TypeVar

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

Value = float | int | bool | str
Block = TypeVar("Block")
Verdict = Literal["agrees", "differs", "not stated"]
RESERVED = ("index", "timings", "benchmark", "provenance", "claims")  # names of the report's own files
CLAIM_COLUMNS = ("study", "claim", "observed", "expected", "rtol", "source", "verdict")


@dataclass(frozen=True)
class Claim:
    """What a source states (`expected`, "" if nothing) beside what a study observed, and the verdict."""

    claim: str
    observed: Value
    expected: Value
    rtol: float | None
    source: str
    verdict: Verdict

    @property
    def of_paper(self) -> bool:
        """Whether the source begins with a place in the paper, as in "Sect. 6.1: stiffer"; if not, a check of ours."""
        return re.match(r"(Sects?|Figs?|Eqs?)\.|(Appendix|Table)\b", self.source) is not None


@dataclass(frozen=True)
class Text:
    """Markdown prose."""

    text: str
    kind: Literal["text"] = "text"


@dataclass(frozen=True)
class Table:
    """Rows of cells, one per column, None where there is no value; also written as `data/<file>.csv`."""

    file: str
    caption: str
    columns: list[str]
    rows: list[list[Value | None]]
    kind: Literal["table"] = "table"


@dataclass(frozen=True)
class Drawing:
    """A figure of which the store holds the caption and `figures/<file>.svg` the drawing."""

    file: str
    caption: str
    kind: Literal["figure"] = "figure"


@dataclass(frozen=True)
class Section:
    """What one test function recorded; `ended_by` names the exception that ended it, "" if it passed."""

    test: str
    title: str
    text: str
    ended_by: str
    claims: list[Claim]
    blocks: list[Text | Table | Drawing]


@dataclass(frozen=True)
class Ratio:
    """A claim on measured time, with what was measured."""

    claim: str
    ratio: float
    expected: str
    source: str
    verdict: Verdict


@dataclass(frozen=True)
class Study:
    """Sections in the order of the functions of `test_<name>.py`; title and introduction are its docstring."""

    name: str
    title: str
    introduction: str
    sections: list[Section]

    @property
    def claims(self) -> list[Claim]:
        """The claims of all sections."""
        return [claim for section in self.sections for claim in section.claims]


class Recorder:
    """Text, tables and figures in the order they come in.

    Captions are inline Markdown. Numbers are rounded to significant digits as they come in, so that committed text is
    stable. `files` holds the names already taken.
    """

    def __init__(self, study: str, files: set[str]) -> None:
        self.study, self._files = study, files
        self.blocks: list[Text | Table | Drawing] = []
        self.figures: dict[str, bytes] = {}

    def text(self, markdown: str) -> None:
        """Record prose: paragraphs, **bold**, `code`, links and lists."""
        self.blocks.append(Text(cleandoc(markdown)))

    def table(self, name: str, frame: pd.DataFrame, caption: str, digits: int = 6) -> None:
        """Record a table; an index other than the default one becomes its first columns."""
        frame = frame if isinstance(frame.index, pd.RangeIndex) else frame.reset_index()
        rows = [
            [None if pd.isna(cell) else plain(cell, digits) for cell in row] for row in frame.to_numpy(dtype=object)
        ]
        self.blocks.append(Table(self._take(name, "csv"), caption, [str(column) for column in frame.columns], rows))

    def figure(self, name: str, figure: Figure, caption: str) -> None:
        """Record a matplotlib figure as SVG, the same bytes for the same drawing, and close it."""
        file = self._take(name, "svg")
        svg = io.BytesIO()
        with mpl.rc_context({"svg.hashsalt": file}):
            figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": "mpmtop"})
        plt.close(figure)
        self.figures[file] = svg.getvalue()
        self.blocks.append(Drawing(file, caption))

    def _take(self, name: str, suffix: str) -> str:
        file = f"{self.study}_{name}"
        if not re.fullmatch(r"[\w-]+", name, re.ASCII):
            raise ValueError(f"{name!r} becomes a file name: use letters, digits, _ and - only")
        if f"{file}.{suffix}" in self._files:
            raise ValueError(f"{file}.{suffix} is already recorded: give each table and figure of a study its own name")
        self._files.add(f"{file}.{suffix}")
        return file


class Report(Recorder):
    """Recorder of one test: text, tables, figures and claims become its part of the study's page.

    Claims and sources are inline Markdown; verdicts are of the numbers before rounding. What `timed` records depends on
    the clock, as do `ratios` and the seconds the test takes, on the `wall` and of `cpu`: they go to the timings page,
    those of a `benchmark` to the page of that name.
    """

    def __init__(self, study: str, test: str, files: set[str], benchmark: bool = False) -> None:
        if study in RESERVED:
            raise ValueError(f"a study cannot be called {study!r}, a file of the report: rename its module")
        super().__init__(study, files)
        self.test, self.ended_by, self.benchmark = test, "", benchmark
        self.claims: list[Claim] = []
        self.ratios: list[Ratio] = []
        self.wall = self.cpu = 0.0
        self.timed = Recorder(study, files)

    def check(
        self,
        claim: str,
        observed: Value,
        expected: Value | None = None,
        *,
        rtol: float | None = None,
        at_most: float | None = None,
        at_least: float | None = None,
        source: str,
    ) -> bool:
        """Record a claim and return whether it holds: |observed - expected| <= rtol |expected| (equality without rtol),
        or observed within the bounds given. Without either there is nothing to differ from; NaN always differs.

        Raises ValueError if both kinds are given, or rtol without an expected number other than zero.
        """
        bounds = [f"{sign} {bound:.12g}" for sign, bound in ((">=", at_least), ("<=", at_most)) if bound is not None]
        if expected is not None and bounds:
            raise ValueError(f"{claim!r}: give an expected value or bounds, not both")
        if rtol is not None and (isinstance(expected, bool | str) or not expected):
            raise ValueError(f"{claim!r}: rtol is relative to an expected number other than zero; give bounds instead")
        if isinstance(observed, float) and math.isnan(observed):
            verdict: Verdict = "differs"
        elif expected is None and not bounds:
            verdict = "not stated"
        else:
            verdict = "agrees" if _holds(observed, expected, rtol, at_least, at_most) else "differs"
        stated = " and ".join(bounds) if expected is None else plain(expected, digits=12)
        self.claims.append(Claim(claim, plain(observed), stated, rtol, source, verdict))
        return verdict != "differs"

    def timing(
        self,
        claim: str,
        ratio: float,
        *,
        at_least: float | None = None,
        at_most: float | None = None,
        source: str,
    ) -> bool:
        """Record a claim on measured time: its value goes to the timings or the benchmark page only."""
        holds = self.check(claim, ratio, at_least=at_least, at_most=at_most, source=source)
        measured = self.claims.pop()
        page = "see benchmark" if self.benchmark else "see timings"
        self.claims.append(Claim(claim, page, measured.expected, None, source, measured.verdict))
        digits = float(plain(ratio, digits=4))
        self.ratios.append(Ratio(claim, digits, str(measured.expected), source, measured.verdict))
        return holds


def _holds(
    observed: Value, expected: Value | None, rtol: float | None, at_least: float | None, at_most: float | None
) -> bool:
    if expected is None:
        return (at_least is None or float(observed) >= at_least) and (at_most is None or float(observed) <= at_most)
    if rtol is None:
        return bool(observed == expected)
    return abs(float(observed) - float(expected)) <= rtol * abs(float(expected))


def plain(value: Any, digits: int = 6) -> Value:
    """A scalar as JSON can hold it: floats rounded to significant digits, NaN and infinity as text."""
    value = value.item() if isinstance(value, np.generic | np.ndarray) else value
    if isinstance(value, float):
        return float(f"{value:.{digits}g}") + 0.0 if math.isfinite(value) else str(value)  # + 0.0: -0 becomes 0
    return value if isinstance(value, bool | int | str) else str(value)


@dataclass(frozen=True)
class Ran:
    """A test function that ran, fit to pass from one process to another: its place in the collection, its module's
    folder, docstring and names in their order, its own docstring and its recorder."""

    position: int
    folder: Path
    module: str | None
    names: tuple[str, ...]
    docstring: str | None
    report: Report


def section(runs: Sequence[Ran]) -> Section:
    """What the runs of one test function (several if parametrised) recorded, in their order."""
    reports = [run.report for run in runs]
    title, text = _headed(runs[0].docstring, reports[0].test)
    ended_by = next((report.ended_by for report in reports if report.ended_by), "")
    claims = [claim for report in reports for claim in report.claims]
    blocks = [block for report in reports for block in report.blocks]
    return Section(reports[0].test, title, text, ended_by, claims, blocks)


def merge(old: Study | None, runs: Sequence[Ran]) -> Study:
    """The study of a module: its sections that ran, the old ones of its other functions, none of removed functions."""
    name = runs[0].report.study
    by_test: dict[str, list[Ran]] = {}
    for run in runs:
        by_test.setdefault(run.report.test, []).append(run)
    known = {section.test: section for section in (old.sections if old else [])}
    known |= {test: section(of_test) for test, of_test in by_test.items()}
    return Study(name, *_headed(runs[0].module, name), [known[test] for test in runs[0].names if test in known])


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


def read_blocks(stored: Iterable[Mapping[str, Any]]) -> list[Text | Table | Drawing]:
    """Blocks as a store holds them."""
    kinds: dict[str, type[Text | Table | Drawing]] = {"text": Text, "table": Table, "figure": Drawing}
    return [kinds[block["kind"]](**block) for block in stored]


def _read_study(path: Path) -> Study:
    try:
        stored = json.loads(path.read_text("utf-8"))
        for section in stored["sections"]:
            section["claims"] = [Claim(**claim) for claim in section["claims"]]
            section["blocks"] = read_blocks(section["blocks"])
        return Study(**stored | {"sections": [Section(**section) for section in stored["sections"]]})
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path} is not a store of this report: delete it, or restore the committed one") from error


def data_files(studies: Sequence[Study]) -> dict[str, str]:
    """Stores and CSV files, text by path relative to the report."""
    claims = [
        [study.name, *(asdict(claim)[c] for c in CLAIM_COLUMNS[1:])] for study in studies for claim in study.claims
    ]
    files = {f"data/{study.name}.json": as_json(asdict(study)) for study in studies}
    files |= {f"data/{table.file}.csv": as_csv(table.columns, table.rows) for table in _blocks(studies, Table)}
    files["data/claims.csv"] = as_csv(CLAIM_COLUMNS, claims)
    return files


def drawings(studies: Iterable[Study]) -> set[str]:
    """Paths, relative to the report, of the figures of the studies."""
    return {f"figures/{drawing.file}.svg" for drawing in _blocks(studies, Drawing)}


def _blocks(studies: Iterable[Study], kind: type[Block]) -> list[Block]:
    return [b for study in studies for section in study.sections for b in section.blocks if isinstance(b, kind)]


def as_json(stored: Any) -> str:
    """Text of a store."""
    return json.dumps(stored, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def as_csv(columns: Iterable[str], rows: Iterable[Iterable[Value | None]]) -> str:
    """Text of a table."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([columns, *rows])
    return text.getvalue()
