"""The page of a comparison: one file of HTML that holds all it shows."""

import base64
import platform
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

import mpmtop
from mpmtop.comparison.asked import METHODS, NONE, Asked
from mpmtop.comparison.entries import Comparison, Entry, measure, relative
from mpmtop.comparison.files import COLUMNS, has_fields, rows, table
from mpmtop.comparison.pictures import design_picture, histories, patterns, scene_picture
from mpmtop.comparison.verdict import verdict
from mpmtop.crossing import moved, named
from mpmtop.page.drawing import STYLE, drawn, embedded
from mpmtop.page.numbers import number, per_cent
from mpmtop.page.templates import templates
from mpmtop.scene import LoadCase
from reference_fem.reanalyse import thresholded

PACKAGES = ("numpy", "scipy", "scikit-fem")
"""Versions that decide the numbers, beside Python's."""


def page(found: Comparison, designs: Mapping[str, bytes], command: str, folder: str) -> str:
    """HTML of a comparison; `designs` are pictures by run, `folder` holds the files beside the page."""
    environment = templates(Path(__file__).parent / "templates")
    environment.filters |= {"number": shown, "per_cent": per_cent}
    crossings = [named(text) for text in found.asked.crossing if text != NONE]
    asked = found.asked
    return environment.get_template("comparison.html").render(
        scene=asked.scene,
        rows=verdict(found).rows,
        measure=measure(asked.scene),
        groups=[(heading(crossing), found.under(crossing)) for crossing in asked.crossing],
        entries=found.entries,
        methods=METHODS,
        relative=lambda value, to: "–" if np.isnan(to) else per_cent(relative(value, to), 2, True),
        image=embedded,
        designs=designs,
        cut={entry.slug: _cut(entry) for entry in found.found},
        warned=[entry for entry in found.found if entry.prepared and entry.prepared.findings],
        planned=[entry for entry in found.found if entry.prepared and entry.prepared.plan],
        histories=_svg(lambda: histories(found), "histories") if found.found else None,
        sketch=_svg(lambda: scene_picture(asked.scene, _drawn_model(found)), "scene"),
        patterns=_svg(lambda: patterns(crossings), "patterns") if crossings else None,
        words=[(str(crossing), moved(crossing).removeprefix("With ")) for crossing in crossings],
        parameters=parameters(asked),
        folder=folder,
        numbers=f"data:text/csv;base64,{base64.b64encode(table(rows(found), COLUMNS)).decode()}",
        has_fields=has_fields,
        command=command,
        versions=versions(),
    )


def shown(value: float, digits: int = 3) -> str:
    """A number, or what is said where the judge has none."""
    return "no equilibrium" if np.isnan(value) else number(value, digits)


def heading(crossing: str) -> str:
    """Over designs of one crossing."""
    return "Points as seeded" if crossing == NONE else moved(named(crossing)).removeprefix("With ").capitalize()


def versions() -> str:
    """What the numbers were computed with."""
    told = [f"mpmtop {mpmtop.__version__}", f"Python {platform.python_version()}"]
    for package in PACKAGES:
        try:
            told.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            told.append(f"{package} of unknown version")
    return ", ".join(told)


def parameters(asked: Asked) -> list[tuple[str, str]]:
    """What defines the comparison, by name."""
    scene, (lower, upper) = asked.scene, asked.scene.body.domain.bounds
    told: list[tuple[str, Any]] = [
        ("size", " × ".join(number(float(side), 6) for side in upper - lower)),
        ("cells", " × ".join(number(float(side), 6) for side in asked.h)),
        ("points per cell and direction", asked.ppc),
        ("material", _said(scene.body.material)),
        *((f"part {k} of another material", _said(each)) for k, each in enumerate(scene.body.parts, 1)),
        *((f"support {k}", _said(each)) for k, each in enumerate(scene.body.supports, 1)),
        *((f"load {k}", _said(each)) for k, each in enumerate(scene.body.loads, 1)),
        *((f"load case {k}", _case(each)) for k, each in enumerate(scene.cases, 1)),
        ("objective", _said(scene.objective)),
        *((f"constraint {k}", _said(each)) for k, each in enumerate(scene.constraints, 1)),
        *((part.name.replace("_", " "), _said(getattr(scene.design, part.name))) for part in fields(scene.design)),
        ("update rule", _said(asked.rule)),
        ("iterations at most", asked.iterations),
        *([("load steps", asked.load_steps)] if asked.load_steps else []),
        *([("ghost penalty", asked.ghost)] if asked.ghost else []),
    ]
    return [(name, str(value)) for name, value in told]


def _case(case: LoadCase) -> str:
    """A load case, short; without supports of its own it is on those of the body."""
    return _said(case).replace(", supports none)", ", supports of the body)") if case.supports is None else _said(case)


def _said(stated: Any) -> str:
    """Something stated, short: numbers in six digits, dataclasses with their fields."""
    if stated is None:
        return "none"
    if isinstance(stated, float):
        return number(stated, 6)
    if isinstance(stated, tuple):
        return f"({', '.join(map(_said, stated))})" if stated else "none"
    if is_dataclass(stated):
        inner = ", ".join(f"{part.name} {_said(getattr(stated, part.name))}" for part in fields(stated) if part.repr)
        return f"{type(stated).__name__}({inner})" if inner else type(stated).__name__
    return stated if isinstance(stated, str) else str(stated) if isinstance(stated, int) else type(stated).__name__


def _svg(make: Callable[[], Figure], name: str) -> dict[str, str]:
    with rc_context(STYLE):
        return embedded(drawn(make(), name))


def _cut(entry: Entry) -> bytes:
    assert entry.run is not None and entry.prepared is not None
    at = entry.prepared.design_points
    return design_picture(at, thresholded(entry.run.rho, at.volume))


def _drawn_model(found: Comparison) -> Any:
    """The first model with a grid or elements to draw; None if all are of load steps."""
    return next((entry.prepared.model for entry in found.found if entry.prepared and has_fields(entry)), None)
