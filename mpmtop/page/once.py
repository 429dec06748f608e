"""What Matplotlib asks for again and again while it draws a figure, found once.

Every number at an axis is a formula, set anew for each of the renderers that lay a figure out and draw it. Texts are
laid out and ticks placed anew whenever a title, a label, a spine or an axis is measured, several times before a figure
is drawn. Nothing is drawn otherwise: what is kept is kept by all that it depends on.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any
from unittest.mock import patch

import matplotlib as mpl
from matplotlib.axis import Axis
from matplotlib.mathtext import MathTextParser
from matplotlib.text import Text

# their stubs are without the methods
PARSER: Any = MathTextParser
TEXT: Any = Text
AXIS: Any = Axis
SET: Any = getattr(getattr(PARSER, "_parse_cached", None), "__wrapped__", None)
LAID: Any = getattr(TEXT, "_get_layout", None)
PLACED: Any = getattr(AXIS, "_update_ticks", None)
"""Matplotlib's own, which it may give up: then it is left to draw as it does."""
OUTLINES = PARSER("path")
FONTS = tuple(name for name in mpl.rcParams if name.startswith(("font.", "mathtext.", "text.")))
"""Settings that decide what a text looks like, beside its own font."""


@contextmanager
def asked_once() -> Iterator[None]:
    """Around the drawing of one figure as SVG."""
    if SET is None or LAID is None or PLACED is None:
        yield
        return
    fonts = tuple(str(mpl.rcParams[name]) for name in FONTS)
    with (
        patch.object(PARSER, "_parse_cached", formula_once(fonts)),
        patch.object(TEXT, "_get_layout", text_once(fonts)),
        patch.object(AXIS, "_update_ticks", ticks_once()),
    ):
        yield


@lru_cache(maxsize=4096)
def outlines(_fonts: tuple[str, ...], *formula: Any) -> Any:
    """Glyphs of a formula as outlines, set once for all figures."""
    return SET(OUTLINES, *formula)


@lru_cache(maxsize=4)
def layouts(_fonts: tuple[str, ...]) -> dict[Any, Any]:
    """Layouts of texts, by all they depend on, for all figures."""
    return {}


def formula_once(fonts: tuple[str, ...]) -> Callable[..., Any]:
    """A function that gives what a parser makes of a formula."""
    return lambda parser, *formula: (
        outlines(fonts, *formula) if parser._output_type == OUTLINES._output_type else SET(parser, *formula)
    )


def text_once(fonts: tuple[str, ...]) -> Callable[[Any, Any], Any]:
    """A function that gives the layout of a text about its position."""
    kept = layouts(fonts)

    def layout(text: Any, renderer: Any) -> Any:
        if text.get_wrap():  # by its position
            return LAID(text, renderer)
        aligned = text.get_horizontalalignment(), text.get_verticalalignment(), text._multialignment, text._linespacing
        font = text.get_fontproperties().copy(), text.get_usetex(), text.get_parse_math()
        turned = text.get_rotation(), text.get_rotation_mode()
        key = (text.get_text(), text.get_figure(root=True).dpi, *aligned, *font, *turned)
        if key not in kept:
            kept[key] = LAID(text, renderer)
        return kept[key]

    return layout


def ticks_once() -> Callable[[Any], list[Any]]:
    """A function that gives the ticks of an axis that are drawn; it places them anew where the axis has moved or has
    got other limits."""
    # by locator and formatter: axes may share them, and they have a state
    placed: dict[Any, tuple[Any, list[Any]]] = {}

    def ticks(axis: Any) -> list[Any]:
        view, data = axis.get_view_interval(), axis.get_data_interval()
        state = (axis, axis.axes.bbox.bounds, axis.get_figure(root=True).dpi, *view, *data)
        if axis.major not in placed or placed[axis.major][0] != state:
            placed[axis.major] = state, PLACED(axis)
        return list(placed[axis.major][1])

    return ticks
