"""What a study records: text, tables, figures, designs and claims, section by section.

A study is a folder of test modules; each of their test functions is a section with a `Report` of its own. What is
recorded goes to the stores of `store`; what depends on the clock or the machine goes to those of `timed`.
"""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from inspect import cleandoc
from typing import Any, Literal

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mpmtop.page.drawing import drawn
from validation.harness.blocks import Block, Drawing, Frames, Pixels, Table, Text, picture, raster
from validation.harness.claims import MEASURED, OWN_WORDS, Claim, Statement, Value, Verdict

RESERVED = ("index", "claims", "timings", "benchmark", "provenance")
"""Names of the report's own files."""
PLACE = re.compile(r"(Sects?|Figs?|Eqs?)\.|(Appendix|Table)\b")
"""How a place in the paper begins."""
JUDGED = re.compile(r"\bfine reference\b|\btrue\b")
"""What the judge's columns are called."""


@dataclass(frozen=True)
class Ratio:
    """A claim on measured time, with what was measured."""

    claim: str
    ratio: float
    expected: str
    source: str
    verdict: Verdict

    @property
    def word(self) -> str:
        """The verdict in words; a claim on time is a check of ours."""
        return OWN_WORDS[self.verdict]


@dataclass(frozen=True)
class Locked:
    """A number held to the one `stored` beside its study, within a relative tolerance."""

    name: str
    stored: float
    now: float
    rtol: float

    @property
    def drift(self) -> float:
        """Change since it was stored, relative to that; infinite from zero."""
        if self.now == self.stored:
            return 0.0
        return (self.now - self.stored) / abs(self.stored) if self.stored else math.copysign(math.inf, self.now)

    @property
    def within(self) -> bool:
        """Whether it holds."""
        return abs(self.now - self.stored) <= self.rtol * abs(self.stored)


class Recorder:
    """Text, tables, figures and designs in the order they come in.

    Captions are inline Markdown. Numbers are rounded to significant digits as they come in, so that committed text is
    stable. `taken` holds the names of files already taken, `files` what is drawn, by file name.
    """

    def __init__(self, study: str, taken: set[str]) -> None:
        self.study, self._taken = study, taken
        self.blocks: list[Block] = []
        self.files: dict[str, bytes] = {}

    def text(self, markdown: str) -> None:
        """Record prose: paragraphs, **bold**, `code`, links and lists."""
        self.blocks.append(Text(cleandoc(markdown)))

    def table(
        self,
        name: str,
        frame: pd.DataFrame,
        caption: str,
        digits: int = 4,
        *,
        percent: Iterable[str] = (),
        part_of: str = "",
    ) -> None:
        """Record a table; an index other than the default one becomes its first columns. The columns in `percent` hold
        ratios and are shown in per cent. Sections may each record rows of one table at the top, `part_of` its name."""
        labels = 1 if isinstance(frame.index, pd.RangeIndex) else frame.index.nlevels
        frame = judged_first(frame if isinstance(frame.index, pd.RangeIndex) else frame.reset_index(), labels)
        rows = [
            [None if pd.isna(cell) else plain(cell, digits) for cell in row] for row in frame.to_numpy(dtype=object)
        ]
        columns, percent = [str(column) for column in frame.columns], list(percent)
        if absent := [column for column in percent if column not in columns]:
            raise ValueError(f"no column {absent[0]!r} in table {name!r}: it has {', '.join(columns)}")
        whole = f"{self.study}_{part_of}" if part_of else ""
        self.blocks.append(Table(self._take(name, "csv"), caption, columns, rows, percent, whole))

    def figure(self, name: str, figure: Figure, caption: str, *, folded: bool = False) -> None:
        """Record a matplotlib figure as SVG, the same bytes for the same drawing, and close it."""
        file = self._take(name, "svg")
        self.files[f"{file}.svg"] = drawn(figure, file)
        plt.close(figure)
        self.blocks.append(Drawing(file, caption, folded))

    def design(
        self,
        name: str,
        x: NDArray[np.float64],
        half_length: NDArray[np.float64],
        rho: NDArray[np.float64],
        *,
        body: str,
        method: str,
        measure: str,
        own: float,
        true: float | None = None,
        front: bool = False,
    ) -> None:
        """Record densities rho (p,) in [0, 1] at positions x (p, 2) that own rectangles of half-length (p, 2), with
        their objective by the method that made them and the `true` one, by a judge of all."""
        file = self._take(name, "png")
        pixels = raster(x, half_length, rho)
        self.files[f"{file}.png"] = picture(pixels)
        size = [pixels.shape[1], pixels.shape[0]]
        own, true = float(f"{own:.5g}"), None if true is None else float(f"{true:.5g}")
        self.blocks.append(Pixels(file, body, method, measure, own, true, size, front))

    def frames(
        self,
        name: str,
        x: NDArray[np.float64],
        half_length: NDArray[np.float64],
        fields: Mapping[str, Sequence[NDArray[np.float64]]],
        places: Sequence[float],
        caption: str,
        *,
        slides: str,
        said: Mapping[str, Sequence[str]],
    ) -> None:
        """Record fields (p,) in [0, 1] by method, one for each of the `places` of a parameter, on rectangles x (p, 2)
        of half-length (p, 2): on the page a slider goes through them. Raises ValueError if one is missing."""
        if any(len(rows) != len(places) for rows in (*fields.values(), *said.values())) or set(fields) != set(said):
            raise ValueError(
                f"frames {name!r}: give every method one field and one text for each of {len(places)} places"
            )
        file = self._take(name, "png")
        tiles = np.vstack([np.hstack([raster(x, half_length, field) for field in row]) for row in fields.values()])
        self.files[f"{file}.png"] = picture(tiles)
        size = [tiles.shape[1] // len(places), tiles.shape[0] // len(fields)]
        texts = [list(said[method]) for method in fields]
        self.blocks.append(Frames(file, caption, slides, [f"{at:g}" for at in places], list(fields), size, texts))

    def _take(self, name: str, suffix: str) -> str:
        file = f"{self.study}_{name}"
        if not re.fullmatch(r"[\w-]+", name, re.ASCII):
            raise ValueError(f"{name!r} becomes a file name: use letters, digits, _ and - only")
        if f"{file}.{suffix}" in self._taken:
            raise ValueError(f"{file}.{suffix} is already recorded: give each table and figure of a study its own name")
        self._taken.add(f"{file}.{suffix}")
        return file


def judged_first(frame: pd.DataFrame, labels: int) -> pd.DataFrame:
    """The judge's columns right after those of the rows' names: they are what a table is read for."""
    names = list(map(str, frame.columns))
    judged = [k for k, name in enumerate(names) if k >= labels and JUDGED.search(name)]
    rest = [k for k in range(labels, len(names)) if k not in judged]
    return frame.iloc[:, [*range(labels), *judged, *rest]]


class Report(Recorder):
    """Recorder of one test: text, tables, figures and claims become its part of the study's page.

    Claims and sources are inline Markdown; verdicts are of the numbers before rounding. `opening` comes at the top of
    the page: sketch and parameters of the scene. `found` and `so` are what came out and what it means, each a sentence
    with its numbers, at the top of the page, too; `front` holds sentences for the front page, by topic. What depends on
    the clock or the machine is kept apart: `timed`, `ratios`, `locks` and the seconds the test takes, on the `wall` and
    of `cpu`; those of a `benchmark` on the page of that name.
    """

    def __init__(self, study: str, test: str, taken: set[str], benchmark: bool = False) -> None:
        if study in RESERVED:
            raise ValueError(f"a study cannot be called {study!r}, a file of the report: rename its module")
        super().__init__(study, taken)
        self.test, self.ended_by, self.benchmark = test, "", benchmark
        self.claims: list[Claim] = []
        self.ratios: list[Ratio] = []
        self.locks: list[Locked] = []
        self.front: dict[str, list[str]] = {}
        self.findings: list[str] = []
        self.conclusions: list[str] = []
        self.wall = self.cpu = 0.0
        self.skipped = False
        self.timed, self.opening = Recorder(study, taken), Recorder(study, taken)

    def found(self, sentence: str, front: str = "") -> None:
        """Record what came out, for the top of the page and, under the topic `front`, for the front page."""
        self.findings.append(cleandoc(sentence))
        if front:
            self.front.setdefault(front, []).append(cleandoc(sentence))

    def so(self, sentence: str, front: str = "") -> None:
        """Record what follows from it, in the same way."""
        self.conclusions.append(cleandoc(sentence))
        if front:
            self.front.setdefault(front, []).append(cleandoc(sentence))

    def check(
        self,
        claim: str,
        observed: Value,
        expected: Value | None = None,
        *,
        rtol: float | None = None,
        at_most: float | None = None,
        at_least: float | None = None,
        source: str | Statement,
        why: str = "",
        reason: str = "",
        unit: Literal["", "%"] = "",
    ) -> bool:
        """Record a claim and return whether it holds: |observed - expected| <= rtol |expected| (equality without rtol),
        or observed within the bounds given. Without either there is nothing to differ from; NaN always differs.

        The source is a `Statement` of the paper, or says in words why the check is made. `why` is the reason for the
        bound or the tolerance, `reason` the most likely one for a difference, shown only if there is one.

        Raises ValueError if the section has a claim of that name, if both kinds are given, rtol without an expected
        number other than zero, or a place in the paper without what it states there.
        """
        if claim in (other.claim for other in self.claims):
            raise ValueError(f"two claims of {self.test} are called {claim!r}: a row must mean one, name them apart")
        bounds = [f"{sign} {bound:.12g}" for sign, bound in ((">=", at_least), ("<=", at_most)) if bound is not None]
        if expected is not None and bounds:
            raise ValueError(f"{claim!r}: give an expected value or bounds, not both")
        if rtol is not None and (isinstance(expected, bool | str) or not expected):
            raise ValueError(f"{claim!r}: rtol is relative to an expected number other than zero; give bounds instead")
        if isinstance(source, str) and PLACE.match(source):
            raise ValueError(f"{claim!r}: {source!r} is a place in the paper: give the Statement made there")
        if isinstance(observed, float) and math.isnan(observed):
            verdict: Verdict = "differs"
        elif expected is None and not bounds:
            verdict = "not stated"
        else:
            verdict = "agrees" if _holds(observed, expected, rtol, at_least, at_most) else "differs"
        counted = " and ".join(bounds) if expected is None else plain(expected, digits=12)
        reason = reason if verdict == "differs" else ""
        if isinstance(source, Statement):
            place, kind, stated, unit = source.where, source.kind, source.words, unit or source.unit
        else:
            place, kind, stated = source, "check", ""
        self.claims.append(
            Claim(claim, plain(observed), counted, rtol, place, verdict, kind, stated, why, reason, unit)
        )
        return verdict != "differs"

    def timing(
        self,
        claim: str,
        ratio: float,
        *,
        at_least: float | None = None,
        at_most: float | None = None,
        source: str,
        why: str = "",
    ) -> bool:
        """Record a claim on measured time: its value goes to the timings or the benchmark page only."""
        holds = self.check(claim, ratio, at_least=at_least, at_most=at_most, source=source, why=why)
        measured = self.claims.pop()
        page = MEASURED["benchmark" if self.benchmark else "timed"]
        self.claims.append(Claim(claim, page, measured.expected, None, source, measured.verdict, why=why))
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
