"""Templates of pages: those of a report or a comparison, beside what both have in common."""

from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape

BASE = Path(__file__).parent
"""What all pages share: the style sheet."""


def templates(folder: Path) -> Environment:
    """The templates in a folder; HTML is escaped, and a name that is not there is an error."""
    return Environment(
        loader=FileSystemLoader([folder, BASE]),
        autoescape=select_autoescape(["html"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
