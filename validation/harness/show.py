"""Numbers, verdicts and prose as pages show them."""

import re

from markdown_it import MarkdownIt
from markupsafe import Markup

from mpmtop.page.numbers import digits3 as digits3
from mpmtop.page.numbers import number, per_cent
from validation.harness.blocks import Table
from validation.harness.claims import Claim, Value

# Raw HTML and pictures in prose are off: a page must hold all it shows.
_MARKDOWN = MarkdownIt("commonmark", {"html": False}).disable("image")


def html(markdown: str) -> Markup:
    """Paragraphs."""
    return Markup(_MARKDOWN.render(markdown))


def inline(markdown: str) -> Markup:
    """Text within a line."""
    return Markup(_MARKDOWN.renderInline(markdown))


def words(markdown: str) -> str:
    """Inline Markdown without its marks, for titles and alternative texts."""
    return "".join(token.content for token in _MARKDOWN.parseInline(markdown)[0].children or ())


def brief(title: str) -> str:
    """A title without what stands in brackets at its end, for lists."""
    return re.sub(r"\s*\([^()]*\)$", "", title)


def show(value: Value | None, percent: bool = False) -> str:
    """A cell's text: no value as a dash, numbers in the digits they were stored with, or in per cent to three."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return per_cent(value) if percent else number(value, 12)
    return {"inf": "∞", "nan": "not a number"}.get(value, value)


def _digits(claim: Claim) -> int:
    """Three, or as many as the number stated has, up to five."""
    if isinstance(claim.expected, str | bool):
        return 3
    scaled = 100 * claim.expected if claim.unit == "%" else claim.expected
    return min(5, max(3, len(f"{abs(scaled):.8g}".replace(".", "").lstrip("0"))))


def observed(claim: Claim) -> str:
    """What we get."""
    if isinstance(claim.observed, str | bool):
        return show(claim.observed)
    return per_cent(claim.observed, _digits(claim)) if claim.unit == "%" else number(claim.observed, _digits(claim))


def counted(claim: Claim) -> str:
    """What counts as agreement: the expected value with its tolerance, or the bounds."""
    if claim.expected == "":
        return "–"
    if claim.bounds:
        signs = {">=": "≥", "<=": "≤"}
        return " and ".join(
            f"{signs[sign]} {per_cent(bound) if claim.unit == '%' else number(bound)}" for sign, bound in claim.bounds
        )
    if isinstance(claim.expected, str | bool):
        return show(claim.expected)
    text = per_cent(claim.expected, _digits(claim)) if claim.unit == "%" else number(claim.expected, _digits(claim))
    if claim.rtol is None:
        return text
    return f"{text} ± {per_cent(claim.rtol)}" if claim.rtol >= 1e-4 else f"{text}, to {number(claim.rtol)} of it"


def deviation(claim: Claim) -> str:
    """Distance from the number stated, or from the bound that is broken."""
    size = claim.deviation
    if size is None or claim.verdict == "not stated":
        return "–"
    if claim.bounds:
        return "within" if size == 0 else f"{per_cent(size, 2, sign=True)} beyond"
    return "none" if size == 0 else per_cent(size, 2, sign=True)


def bounds(text: str) -> str:
    """Bounds in their usual signs, and numbers in ours."""
    text = text.replace(">=", "≥").replace("<=", "≤")
    return re.sub(r"\d[\d.]*(e[+-]?\d+)?", lambda match: number(float(match[0]), 12), text)


def numeric(table: Table) -> list[bool]:
    """Which columns hold numbers, set to the right."""
    columns = zip(*table.rows, strict=True) if table.rows else [()] * len(table.columns)
    return [any(isinstance(v, int | float) and not isinstance(v, bool) for v in column) for column in columns]


def cell(text: str) -> str:
    """Text fit for a cell of a Markdown table."""
    return re.sub(r"[ \n\t]+", " ", str(text)).strip().replace("|", "\\|")  # but for the space that does not break
