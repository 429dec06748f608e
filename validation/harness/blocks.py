"""What a page is made of: text, tables, figures, designs and fields that change with a parameter."""

import io
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from validation.harness.claims import Value


@dataclass(frozen=True)
class Text:
    """Markdown prose."""

    text: str
    kind: Literal["text"] = "text"


@dataclass(frozen=True)
class Table:
    """Rows of cells, one per column, None where there is no value; also written as `data/<file>.csv`. Columns in
    `percent` hold ratios that are shown in per cent. At the top of a page those that are `part_of` one are shown as
    that."""

    file: str
    caption: str
    columns: list[str]
    rows: list[list[Value | None]]
    percent: list[str] = field(default_factory=list)
    part_of: str = ""
    kind: Literal["table"] = "table"


@dataclass(frozen=True)
class Drawing:
    """A figure of which the store holds the caption and `figures/<file>.svg` the drawing; `folded` until asked for."""

    file: str
    caption: str
    folded: bool = False
    kind: Literal["figure"] = "figure"


@dataclass(frozen=True)
class Pixels:
    """A design: `figures/<file>.png` has one grey pixel for each point, 0 white and 1 black, none outside the body.

    `own` is the objective by the method that made it, `true` the judge's (None: not judged), both in the `measure`
    named. Designs of one `body` stand side by side, those `front` on the front page, too.
    """

    file: str
    body: str
    method: str
    measure: str
    own: float
    true: float | None
    size: list[int]
    front: bool = False
    kind: Literal["design"] = "design"


@dataclass(frozen=True)
class Frames:
    """Fields of several methods that change with a parameter: `figures/<file>.png` has one tile of `size` pixels for
    each method, from the top, and each of the `places` of the parameter, from the left; grey from 0 white to 1 black.

    `slides` names the parameter, with its unit; `said` holds what is written below a tile, by method and place.
    """

    file: str
    caption: str
    slides: str
    places: list[str]
    methods: list[str]
    size: list[int]
    said: list[list[str]]
    kind: Literal["frames"] = "frames"


Block = Text | Table | Drawing | Pixels | Frames


def picture(pixels: NDArray[np.uint8]) -> bytes:
    """Grey and opacity (rows, columns, 2) as a file."""
    png = io.BytesIO()
    Image.fromarray(pixels).save(png, format="PNG", optimize=True)
    return png.getvalue()


def raster(x: NDArray[np.float64], half_length: NDArray[np.float64], rho: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Grey and opacity (rows, columns, 2), top row first, of rectangles on a lattice of the smallest one's size."""
    half_length = np.broadcast_to(half_length, x.shape)
    side = 2 * half_length.min(axis=0)
    first = np.rint((x - half_length - (x - half_length).min(axis=0)) / side).astype(int)
    count = np.rint(2 * half_length / side).astype(int)
    columns, rows = (first + count).max(axis=0)
    pixels = np.zeros((rows, columns, 2), dtype=np.uint8)
    grey = np.rint(255 * (1 - np.clip(rho, 0, 1))).astype(np.uint8)
    for a, b in np.ndindex(*count.max(axis=0)):  # the pixels of the largest rectangle
        covers = (a < count[:, 0]) & (b < count[:, 1])
        pixels[rows - 1 - first[covers, 1] - b, first[covers, 0] + a] = np.stack(
            [grey[covers], np.full(covers.sum(), 255)], axis=-1
        )
    return pixels
