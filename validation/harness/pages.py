"""Pages of the report: Jinja2 templates, and what they need to show values, claims, prose and figures."""

import base64
import json
import os
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape
from markdown_it import MarkdownIt
from markupsafe import Markup

from validation.harness.report import (
    Claim,
    Study,
    Table,
    Value,
    data_files,
    drawings,
)
from validation.harness.timed import PLACES, Place, Timed, time_of_studies, timed_drawings, timed_files

_CLOCK_PAGES: dict[str, Place] = {"timings": "timed", "benchmark": "benchmark"}
# Raw HTML and pictures in prose are off: a page must hold all it shows.
_MARKDOWN = MarkdownIt("commonmark", {"html": False}).disable("image")


@dataclass(frozen=True)
class Measured:
    """All that depends on the clock, before this run and after it."""

    before: Sequence[Timed]
    now: Sequence[Timed]


def publish(
    directory: Path,
    before: Sequence[Study],
    studies: Sequence[Study],
    measured: Measured,
    figures: Mapping[str, bytes],
    provenance: Mapping[str, str],
) -> None:
    """Write the report of `studies`, remove what only the studies `before` had, and touch nothing else in the folder.

    `figures` holds the SVGs drawn in this run, by path; those of sections that did not run are on disk.
    """
    for path, svg in figures.items():
        replace(directory / path, svg)
    files = data_files(studies) | timed_files(measured.now) | pages(studies, measured.now, directory, provenance)
    files["data/provenance.json"] = json.dumps(provenance, indent=1) + "\n"
    for path, text in files.items():
        replace(directory / path, text)
    former = {f"{study.name}.{suffix}" for study in before for suffix in ("md", "html")}
    former |= data_files(before).keys() | drawings(before)
    former |= timed_files(measured.before).keys() | timed_drawings(measured.before)
    for path in former - files.keys() - drawings(studies) - timed_drawings(measured.now):
        (directory / path).unlink(missing_ok=True)


def replace(path: Path, content: str | bytes) -> None:
    """Write a file whole or not at all: readers never see half of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    unfinished.write_bytes(content.encode() if isinstance(content, str) else content)
    os.replace(unfinished, path)


def pages(
    studies: Sequence[Study],
    timed: Sequence[Timed],
    directory: Path,
    provenance: Mapping[str, str],
) -> dict[str, str]:
    """Markdown and HTML of every page, text by path relative to the report in `directory`, which holds the figures."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent / "templates"),
        autoescape=select_autoescape(["html"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {
        "show": show,
        "numeric": numeric,
        "stated": stated,
        "bounds": bounds,
        "observed": observed,
        "count": count,
        "holding": holding,
        "cell": cell,
        "html": lambda markdown: Markup(_MARKDOWN.render(markdown)),
        "inline": lambda markdown: Markup(_MARKDOWN.renderInline(markdown)),
        "words": words,
    }
    environment.globals |= {
        "image": lambda file, folder: image(directory / folder / f"{file}.svg"),
        "studies": studies,
        "timed": {place: [part for part in timed if part.place == place] for place in PLACES},
        "time_of_studies": time_of_studies(timed, studies),
        "provenance": provenance,
    }
    files = {}
    for suffix in ("md", "html"):
        for page in ("index", *_CLOCK_PAGES):
            template = environment.get_template(f"{'measured' if page in _CLOCK_PAGES else page}.{suffix}")
            files[f"{page}.{suffix}"] = template.render(page=page, place=_CLOCK_PAGES.get(page))
        template = environment.get_template(f"study.{suffix}")
        files |= {f"{study.name}.{suffix}": template.render(page=study.name, study=study) for study in studies}
    return files


def count(claims: Iterable[Claim]) -> Counter[str]:
    """Number of the paper's claims by verdict."""
    return Counter(claim.verdict for claim in claims if claim.of_paper)


def holding(claims: Iterable[Claim]) -> tuple[int, int]:
    """How many of our checks hold, of how many; a value reported for comparison only, "not stated", is not counted."""
    verdicts = [claim.verdict for claim in claims if not claim.of_paper and claim.verdict != "not stated"]
    return verdicts.count("agrees"), len(verdicts)


def show(value: Value | None) -> str:
    """A cell's text: no value as a dash, numbers in the digits they were stored with."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return short(f"{value:.12g}")
    return str(value)


def stated(claim: Claim) -> str:
    """What the source says: the expected value with its tolerance, or the bounds."""
    if claim.expected == "":
        return "–"
    text = bounds(show(claim.expected))
    if claim.rtol is None:
        return text
    return (
        f"{text} ± {show(100 * claim.rtol)}\u00a0%" if claim.rtol >= 1e-4 else f"{text} (relative {show(claim.rtol)})"
    )


def bounds(text: str) -> str:
    """Bounds in their usual signs."""
    return short(text.replace(">=", "≥").replace("<=", "≤"))


def short(text: str) -> str:
    """Numbers with the exponent as people write it, 1e-06 as 1e-6."""
    return re.sub(r"(\de)([+-]?)0*(\d)", lambda m: m[1] + m[2].strip("+") + m[3], text)


def numeric(table: Table) -> list[bool]:
    """Which columns hold numbers, set to the right."""
    columns = zip(*table.rows, strict=True) if table.rows else [()] * len(table.columns)
    return [any(isinstance(v, int | float) and not isinstance(v, bool) for v in column) for column in columns]


def observed(claim: Claim) -> str:
    """What we get, with its deviation from an expected number."""
    text = show(claim.observed)
    if any(isinstance(value, str | bool) for value in (claim.observed, claim.expected)):
        return text
    if not claim.expected or claim.observed == claim.expected:
        return text
    percent = 100 * (float(claim.observed) - float(claim.expected)) / abs(float(claim.expected))
    return f"{text} ({'+' if percent > 0 else ''}{show(float(f'{percent:.2g}'))}\u00a0%)"


def cell(text: str) -> str:
    """Text fit for a cell of a Markdown table."""
    return " ".join(text.split()).replace("|", "\\|")


def words(markdown: str) -> str:
    """Inline Markdown without its marks, for titles and alternative texts."""
    return "".join(token.content for token in _MARKDOWN.parseInline(markdown)[0].children or ())


def image(path: Path) -> dict[str, str] | None:
    """Source and size [CSS px] of an SVG as part of a page; None if the file is absent.

    A data URI keeps the page self-contained and the ids of one figure apart from those of another.
    """
    if not path.exists():
        return None
    svg = path.read_bytes()
    size = re.search(rb'width="([\d.]+)pt" height="([\d.]+)pt"', svg)
    width, height = (str(round(float(length) * 4 / 3)) for length in size.groups()) if size else ("auto", "auto")
    return {"src": "data:image/svg+xml;base64," + base64.b64encode(svg).decode(), "width": width, "height": height}
