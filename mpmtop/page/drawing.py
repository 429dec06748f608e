"""The style of every figure of a page, and how it comes into the page."""

import base64
import hashlib
import io
import re
from pathlib import Path
from typing import Any
from urllib.parse import quote

import matplotlib as mpl
from cycler import cycler
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from mpmtop.page.once import asked_once

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

PLAIN = " ;,/?:@=+$-_.!~*"
"""Letters that a data URI in an attribute holds as they are."""


class Sheet(FigureCanvasSVG):
    """Canvas of a figure that is laid out at 72 dots an inch, as an SVG is drawn; its images have `savefig.dpi`."""

    def print_svg(
        self, filename: Any, *, bbox_inches_restore: Any = None, metadata: Any = None, **_colours: object
    ) -> None:
        """Draw the figure; Matplotlib passes its colours to canvases that are not its own, too."""
        self.figure.dpi = mpl.rcParams["savefig.dpi"]
        super().print_svg(filename, bbox_inches_restore=bbox_inches_restore, metadata=metadata)


def drawn(figure: Figure, file: str) -> bytes:
    """A figure as SVG, the same bytes for the same drawing, with names that no other file has.

    The bytes are those of `Figure.savefig`, which for a tight box lays a figure out, draws it for nothing, measures it
    and draws it; here it is laid out, measured and drawn.
    """
    svg = io.BytesIO()
    own: Any = {"svg.hashsalt": file, "figure.constrained_layout.use": False, "figure.autolayout": False}
    with mpl.rc_context(own), asked_once():
        Sheet(figure)
        figure.dpi = Sheet.fixed_dpi
        if layout := figure.get_layout_engine():
            layout.execute(figure)
        tight = mpl.rcParams["savefig.bbox"] == "tight"
        box = figure.get_tightbbox().padded(mpl.rcParams["savefig.pad_inches"]) if tight else None
        figure.set_layout_engine(None)  # or `savefig` would lay it out once more
        figure.savefig(svg, format="svg", dpi=figure.dpi, bbox_inches=box, metadata={"Date": None, "Creator": "mpmtop"})
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
