"""Pages of the report: Jinja2 templates, and what they need to show values, claims, prose and figures."""

import json
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from jinja2 import Environment

from mpmtop.page.drawing import image
from mpmtop.page.templates import templates
from validation.harness import show
from validation.harness.blocks import Drawing, Frames, Pixels, Table
from validation.harness.claims import KINDS, Tally, rows_of, stands
from validation.harness.contents import Contents
from validation.harness.diff import Comparison
from validation.harness.overview import DESIGNS, Overview
from validation.harness.rows import claim_files
from validation.harness.store import Study, blocks_of, data_files, drawings, read
from validation.harness.timed import (
    PLACES,
    Place,
    Regression,
    Timed,
    read_timed,
    time_of_studies,
    timed_drawings,
    timed_files,
)

_CLOCK_PAGES: dict[str, Place] = {"timings": "timed", "benchmark": "benchmark"}
PROVENANCE = "data/provenance.json"
"""Where the last run was: kept on its machine only."""
PAGE = 1_800_000
"""Bytes of pictures that leave a page below 2 MB."""
LONG, FOLDED = 16, 4
"""Rows beyond which a table is folded, and tables of claims of our own from which they are."""


@dataclass(frozen=True)
class Measured:
    """All that depends on the clock or the machine, before this run and after it, and the sections that `ran` in it,
    by study and test."""

    before: Sequence[Timed]
    now: Sequence[Timed]
    ran: AbstractSet[tuple[str, str]] = field(default_factory=frozenset)


def publish(
    directory: Path,
    before: Sequence[Study],
    studies: Sequence[Study],
    measured: Measured,
    figures: Mapping[str, bytes],
    provenance: Mapping[str, str],
    contents: Contents,
) -> None:
    """Write the report of `studies`, remove what only the studies `before` had, and touch nothing else in the folder.

    `figures` holds what was drawn in this run, by path; that of sections that did not run is on disk.
    """
    for path, drawn in figures.items():
        replace(directory / path, drawn)
    files: dict[str, str | bytes] = {**data_files(studies), **timed_files(measured.now)}
    files |= claim_files(studies, measured.now, measured.ran)
    files |= Overview(studies, contents).drawn(directory)
    files |= pages(studies, measured, directory, provenance, contents)
    if provenance:
        files[PROVENANCE] = json.dumps(provenance, indent=1) + "\n"
    for path, text in files.items():
        replace(directory / path, text)
    former = {f"{study.name}.{suffix}" for study in before for suffix in ("md", "html")}
    former |= data_files(before).keys() | drawings(before) | {DESIGNS}
    former |= timed_files(measured.before).keys() | timed_drawings(measured.before)
    for path in former - files.keys() - drawings(studies) - timed_drawings(measured.now):
        (directory / path).unlink(missing_ok=True)


def republish(directory: Path, contents: Contents) -> None:
    """Write the report in `directory` anew from its stores and figures; no study runs."""
    known = read(directory)
    studies = [known[name] for name in contents.ordered(known)]
    timed = read_timed(directory)
    path = directory / PROVENANCE
    provenance = json.loads(path.read_text("utf-8")) if path.exists() else {}
    publish(directory, studies, studies, Measured(timed, timed), {}, provenance, contents)


def replace(path: Path, content: str | bytes) -> None:
    """Write a file whole or not at all: readers never see half of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    unfinished.write_bytes(content.encode() if isinstance(content, str) else content)
    os.replace(unfinished, path)


def pages(
    studies: Sequence[Study],
    measured: Measured,
    directory: Path,
    provenance: Mapping[str, str],
    contents: Contents,
) -> dict[str, str]:
    """Markdown and HTML of every page, text by path relative to the report in `directory`, which holds the figures."""
    environment = _environment()
    environment.globals |= _facts(studies, measured, contents) | {
        "image": lambda file, folder: image(directory / folder / file),
        "provenance": provenance,
    }
    files = {}
    for suffix in ("md", "html"):
        for page in ("index", "claims", *_CLOCK_PAGES):
            template = environment.get_template(f"{'measured' if page in _CLOCK_PAGES else page}.{suffix}")
            files[f"{page}.{suffix}"] = template.render(page=page, place=_CLOCK_PAGES.get(page))
        template = environment.get_template(f"study.{suffix}")
        files |= {f"{study.name}.{suffix}": template.render(page=study.name, study=study) for study in studies}
    return files


def _environment() -> Environment:
    """The templates, and the filters that they use."""
    environment = templates(Path(__file__).parent / "templates")
    shown = (
        *(
            show.html,
            show.inline,
            show.words,
            show.brief,
            show.number,
            show.per_cent,
            show.show,
            show.observed,
            show.counted,
        ),
        *(show.deviation, show.digits3, show.bounds, show.numeric, show.cell, stands),
    )
    environment.filters |= {function.__name__: function for function in shown}
    return environment


def rendered_diff(found: Comparison) -> str:
    """The page of what moved; figures are in it as far as a page of PAGE bytes can carry them."""
    embedded, size = set(), 0
    for name, *_ in found.figures:
        paths = [folder / "figures" / name for folder in found.folders]
        size += sum(path.stat().st_size for path in paths if path.exists()) * 4 // 3
        if size < PAGE:
            embedded.add(name)
    return _environment().get_template("diff.html").render(found=found, embedded=embedded, image=image)


def _facts(studies: Sequence[Study], measured: Measured, contents: Contents) -> dict[str, Any]:
    """What every template may speak of."""
    parts = {(part.study, part.test): part for part in measured.now}
    ratios = {(*key, ratio.claim): ratio.ratio for key, part in parts.items() for ratio in part.ratios}
    order = [study.name for study in studies]

    def kept_of(name: str) -> dict[str, float]:
        """Ratios of a study that are kept with the code, as its text is."""
        kept = (part for part in measured.now if part.place == "benchmark" and part.study == name)
        return {ratio.claim: ratio.ratio for part in kept for ratio in part.ratios}

    return {
        "studies": studies,
        "groups": contents.grouped(studies),
        "contents": contents,
        "kinds": KINDS,
        "overview": Overview(studies, contents),
        "tally": lambda study=None: Tally.of(study.readings if study else [r for s in studies for r in s.readings]),
        "regression": lambda name="": Regression.of(measured.now, name),
        "part_of": lambda study, test: parts.get((study, test)),
        "ratio_of": lambda study, test, claim: ratios.get((study, test, claim)),
        "leading": lambda study: study.leading(kept_of(study.name)),
        "sentences_of": lambda study, what: study.told(what) + study.filled(what, kept_of(study.name)),
        "ran": measured.ran,
        "ratios_of": lambda part: zip(part.ratios, rows_of(part.test, (r.claim for r in part.ratios)), strict=True),
        "labels_of": labels,
        "neighbours": lambda name: _neighbours(order, name),
        "has_frames": lambda study: bool(blocks_of([study], Frames)),
        "designs": lambda study: blocks_of([study], Pixels),
        "timed": {place: [part for part in measured.now if part.place == place] for place in PLACES},
        "time_of_studies": time_of_studies(measured.now, studies),
        "titles": {study.name: study.title for study in studies},
        "long": LONG,
        "folded": FOLDED,
    }


def labels(study: Study) -> dict[tuple[str, str], str]:
    """Numbers of the tables and figures of a page, by kind and file."""
    names = {"table": "Table", "figure": "Figure"}
    counts: Counter[str] = Counter()
    found: dict[tuple[str, str], str] = {}
    for block in (*study.opening, *(block for section in study.sections for block in section.blocks)):
        if isinstance(block, Table | Drawing):
            counts[block.kind] += 1
            found[block.kind, block.file] = f"{names[block.kind]} {counts[block.kind]}."
    return found


def _neighbours(order: Sequence[str], name: str) -> tuple[str | None, str | None]:
    """The studies before and after one."""
    place = order.index(name)
    return (order[place - 1] if place else None, order[place + 1] if place + 1 < len(order) else None)
