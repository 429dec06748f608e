"""The style of every figure of a page, and how it comes into the page."""

import base64
import hashlib
import io
import re
from functools import lru_cache, partial
from pathlib import Path
from typing import Any
from unittest.mock import patch
from urllib.parse import quote

import matplotlib as mpl
from cycler import cycler
from matplotlib.figure import Figure
from matplotlib.mathtext import MathTextParser

# Okabe and Ito's colours but for yellow, too faint on white; line styles tell them apart where they print grey.
STYLE: Any = {
    "axes.prop_cycle": cycler(
        color=["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#000000"],
        linestyle=["-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 1))],
    ),
    "axes.formatter.use_mathtext": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": "medium",
    "figure.constrained_layout.use": True,
    # 5 in fill a phone's 390 px with letters of 11 px; wider figures shrink theirs.
    "figure.figsize": (5.0, 3.4),
    "font.size": 11.0,
    "image.cmap": "cividis",
    "legend.frameon": False,
    "legend.fontsize": "small",
    "lines.linewidth": 1.8,
    "savefig.bbox": "tight",  # equal axes leave blank bands
    "savefig.dpi": 200,
    "savefig.facecolor": "white",
    "svg.fonttype": "path",  # letters as drawn here: no font of the reader's can move or clip them
}

# Every number at an axis is a formula. Matplotlib keeps fifty, anew for each of the renderers that lay a figure out and
# draw it: setting them again was a third of a figure's time.
PARSER: Any = MathTextParser  # its stub is without the cache
SET = PARSER._parse_cached.__wrapped__
OUTLINES = PARSER("path")
outlines = lru_cache(maxsize=4096)(partial(SET, OUTLINES))
"""Glyphs of a formula as outlines, set once for all figures."""

PLAIN = " ;,/?:@=+$-_.!~*"
"""Letters that a data URI in an attribute holds as they are."""


def set_once(parser: Any, *formula: Any) -> Any:
    """What `parser` makes of a formula."""
    return outlines(*formula) if parser._output_type == OUTLINES._output_type else SET(parser, *formula)


def drawn(figure: Figure, file: str) -> bytes:
    """A figure as SVG, the same bytes for the same drawing, with names that no other file has."""
    svg = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": file}), patch.object(PARSER, "_parse_cached", set_once):
        figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": "mpmtop"})
    return numbered(svg.getvalue(), file)


def numbered(svg: bytes, file: str) -> bytes:
    """The SVG with its clips named by their order: Matplotlib names them by coordinates, to the last bit, and a layout
    leaves other last bits in every process."""
    order = {clip: k for k, clip in enumerate(dict.fromkeys(re.findall(rb'<clipPath id="(\w+)"', svg)))}
    if not order:
        return svg
    names = {clip: b"p" + hashlib.sha256(f"{file} {k}".encode()).hexdigest()[:10].encode() for clip, k in order.items()}
    return re.sub(b"|".join(order), lambda match: names[match[0]], svg)


def image(path: Path) -> dict[str, str] | None:
    """Source and size [CSS px] of an SVG or PNG as part of a page; None if the file is absent."""
    return embedded(path.read_bytes()) if path.exists() else None


def embedded(drawn: bytes) -> dict[str, str]:
    """Source and size [CSS px] of an SVG or PNG as part of a page.

    A data URI keeps the page self-contained and the ids of one figure apart from those of another.
    """
    if drawn.startswith(b"\x89PNG"):
        encoded = base64.b64encode(drawn).decode()
        return {"src": f"data:image/png;base64,{encoded}", "width": "auto", "height": "auto"}
    size = re.search(rb'width="([\d.]+)pt" height="([\d.]+)pt"', drawn)
    width, height = (str(round(float(length) * 4 / 3)) for length in size.groups()) if size else ("auto", "auto")
    # a seventh less than in base 64; line breaks are spaces to XML, and take three letters here
    encoded = quote(drawn.replace(b"\n", b" "), safe=PLAIN)
    return {"src": f"data:image/svg+xml,{encoded}", "width": width, "height": height}
