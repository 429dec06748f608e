"""The front page: the answer in words, the paper's printed results beside ours, and designs side by side."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import matplotlib.style
import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from mpmtop.page.drawing import STYLE, drawn
from mpmtop.page.numbers import digits3
from validation.harness.blocks import Pixels
from validation.harness.claims import PRINTED, Claim, Stand, stands
from validation.harness.contents import Contents
from validation.harness.store import Study, blocks_of

REACH = 0.4
"""Deviation [1] at which the plot of the printed results ends; what lies further is drawn at its end, with a sign."""
DESIGNS = "figures/front_designs.svg"


@dataclass(frozen=True)
class Mark:
    """One reading in the plot: its place from 0 to 100, whether it lies beyond that, and the claim."""

    place: float
    beyond: bool
    study: str
    test: str
    claim: Claim


@dataclass(frozen=True)
class Printed:
    """A number that the paper prints: its statement, the band that counts as agreement (from, to; 0 to 100), marks."""

    stand: Stand
    band: tuple[float, float]
    marks: list[Mark]

    @property
    def state(self) -> str:
        """Met, met by fitting, met in one reading, not met."""
        if self.stand.first.kind == "calibrated" and self.stand.state == "agrees":
            return "fitted"
        return {"agrees": "met", "differs": "not met", "by reading": "by reading"}.get(self.stand.state, "open")


def _place(deviation: float) -> float:
    """Where a deviation lies in the plot, 0 to 100."""
    return round(50 * (1 + max(-1.0, min(1.0, deviation / REACH))), 1)


def _size(claim: Claim) -> float | None:
    """Deviation from the number stated, or from the bound, whether it is broken or not."""
    if isinstance(claim.observed, str | bool):
        return None
    if claim.bounds:
        bound = claim.bounds[0][1]
        return (float(claim.observed) - bound) / abs(bound) if bound else None
    return claim.deviation


@dataclass(frozen=True)
class Overview:
    """What the front page shows of the studies."""

    studies: Sequence[Study]
    contents: Contents

    @property
    def answers(self) -> dict[str, list[tuple[str, str]]]:
        """Sentences by topic, each with the study it is of; the contents' topics first."""
        told: dict[str, list[tuple[str, str]]] = {topic: [] for topic in self.contents.topics}
        for study in self.studies:
            for section in study.sections:
                for topic, sentences in section.front.items():
                    told.setdefault(topic, []).extend((sentence, study.name) for sentence in sentences)
        return told

    @property
    def printed(self) -> list[Printed]:
        """The paper's printed results, those that differ last within each kind as they come."""
        rows = []
        readings = [reading for study in self.studies for reading in study.readings]
        for stand in stands(r for r in readings if r.claim.kind in PRINTED):
            sizes = [(reading, _size(reading.claim)) for reading in stand.readings]
            marks = [
                Mark(_place(size), abs(size) > REACH, reading.study, reading.test, reading.claim)
                for reading, size in sizes
                if size is not None
            ]
            claim = stand.first
            if claim.bounds:
                band = (0.0, 50.0) if claim.bounds[0][0] == "<=" else (50.0, 100.0)
            else:
                band = (_place(-(claim.rtol or 0.0)), _place(claim.rtol or 0.0))
            rows.append(Printed(stand, band, marks))
        return rows

    @property
    def bodies(self) -> dict[str, list[Pixels]]:
        """Designs of the front page by body, in the contents' order of methods."""
        found: dict[str, list[Pixels]] = {}
        for design in blocks_of(self.studies, Pixels):
            if design.front:
                found.setdefault(design.body, []).append(design)
        place = {method: k for k, method in enumerate(self.contents.methods)}
        return {
            body: sorted(designs, key=lambda design: place.get(design.method, len(place)))
            for body, designs in found.items()
        }

    @property
    def columns(self) -> dict[str, int]:
        """The column of every method of the front page's designs, from 0, in the contents' order."""
        shown = dict.fromkeys(design.method for designs in self.bodies.values() for design in designs)
        known = [method for method in self.contents.methods if method in shown]
        return {method: k for k, method in enumerate(dict.fromkeys((*known, *shown)))}

    def drawn(self, directory: Path) -> Mapping[str, bytes]:
        """The designs as one figure, for pages that are text, if the pictures of all are in the directory."""
        bodies = self.bodies
        paths = {d.file: directory / "figures" / f"{d.file}.png" for designs in bodies.values() for d in designs}
        if not paths or not all(path.exists() for path in paths.values()):
            return {}
        with mpl.style.context(STYLE):
            return {DESIGNS: self._figure(bodies, paths)}

    def _figure(self, bodies: Mapping[str, Sequence[Pixels]], paths: Mapping[str, Path]) -> bytes:
        columns = self.columns
        shapes = [designs[0].size[1] / designs[0].size[0] for designs in bodies.values()]
        figure = Figure(
            figsize=(1.75 * len(columns), sum(1.75 * shape + 0.62 for shape in shapes)), layout="constrained"
        )
        axes = figure.subplots(
            len(bodies), len(columns), squeeze=False, height_ratios=[shape + 0.2 for shape in shapes]
        )
        for ax in axes.flat:
            ax.set_axis_off()
        for row, (body, designs) in zip(axes, bodies.items(), strict=True):
            for design in designs:
                ax = row[columns[design.method]]
                grey, opacity = np.moveaxis(np.asarray(Image.open(paths[design.file])).astype(float) / 255, -1, 0)
                ax.imshow(1 - grey * opacity - (1 - opacity), cmap="gray_r", vmin=0, vmax=1, interpolation="nearest")
                ax.contour(opacity, levels=[0.5], colors="#0072b2", linewidths=0.6) if opacity.min() < 1 else None
                ax.set_title(f"{design.method}\n{values(design)}", fontsize=9)
            row[0].text(-0.06, 0.5, body, transform=row[0].transAxes, rotation=90, va="center", ha="right", fontsize=10)
        return drawn(figure, "front")


def values(design: Pixels) -> str:
    """Own and true objective of a design."""
    true = "not judged" if design.true is None else digits3(design.true)
    return f"own {digits3(design.own)}, true {true}"
