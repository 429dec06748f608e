"""Questions in files, for codes of any language: each case is a folder, its answer a table.

`SCHEMA` is the page that goes beside them.
"""

import csv
import json
from collections.abc import Iterable, Mapping
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple, get_args

import meshio
import numpy as np

from mpmtop.arrays import Array, Index, Mask
from mpmtop.grid import Grid
from validation.codes.adapter import NoAdapter
from validation.codes.answers import Misanswered
from validation.codes.card import Check
from validation.codes.words import table
from validation.methods.protocol import Answer, Capability, Case, Shape, Step

SCHEMA = """# Cases in files

Every folder is one case; `case.json` says what it is. Lengths, forces and moduli are in any consistent units, plane
problems are of unit thickness, static, of small strain but for load steps. Points, and nodes along each axis, are
numbered from 0.

`case.json`
: `kind` "analysis", "functions" or "load steps"; `grid`: `origin` (x, y), cell size `h` (x, y), number of `cells`
  (x, y): node (i, j) is at origin + (i, j) h; `material`: `poisson`, `plane` "strain" or "stress"; of load steps their
  number, `steps`.

`points.csv`, one row for each material point
: `point, x, y, volume, half_x, half_y` (half the sides of its domain), `young`; `force_x, force_y`: all that the point
  carries, body force included, in units of force: the nodal forces are sum_p N_i(x_p) force_p. The part of it that is a
  body force is also given per volume, `body_x, body_y`. `points.vtu` is the same to look at.

`held.csv`, nodes that supports hold, also those that no point is near
: `i, j, x, y`, `fixed_x, fixed_y` (1 held, 0 free), `value_x, value_y`: the displacement at which they are held.

`loads.csv`, forces at positions that belong to no point
: `x, y, force_x, force_y`; often empty.

The answer to an analysis is `answer.csv` (or `answer.vtu`, with point data `displacement` and `stress`), one row for
each point, in the order of `points.csv`
: `point, x, y` as in the case, by which the order is checked, `ux, uy`, and, as far as the code states them,
  `sxx, syy, sxy` (of the tensor, tension positive) and `dcde`, the derivative of the compliance by the point's modulus.

The answer to functions, `answer.csv`, has one row for each node of each point, `point, i, j, n, dn_dx, dn_dy`; in
`points.csv` there are positions and domains only.

The answer to load steps, `answer.csv`, has one row for each point after each of the `steps`, which are numbered from 1:
`step, point, x, y, sxx, syy, sxy`, position and Cauchy stress. In step n of N, n / N of the forces act, carried by the
points, of fixed direction; strains and rotations are large.

`code.json`, beside the folders, says what the code is: `name`, `version`, `capabilities` (words out of the list below)
and, if it is not rounding, `accuracy`, the relative error that its numerics leave. It is asked what it is capable of
only. A code that steps in time gives `explicit`, too: numbers of blocks of time steps in which the load is ramped,
`ramp`, and which follow at most, `blocks`, and of steps in a `block`. Its command is called once for each case and then
reads lines `LEVEL STEPS`: it makes STEPS time steps under LEVEL times the forces, writes {answer} anew, and says
`moved KINETIC STORED`, kinetic and strain energy; its other output is passed over. It ends with its input.
"""


IN_FILES = """`case` is how a class in Python is asked; in files `case.points`, `.moduli`, `.carried` and `.body_force`
are columns of `points.csv`, `case.held` is `held.csv`, `case.acts` is `loads.csv`, and the rest is in `case.json`.
"""
KNOWN: tuple[Capability, ...] = tuple(word for word in get_args(Capability) if word != "sheared domains")
"""What can be asked in files."""
BLOCKS = ("ramp", "block", "blocks")
LARGEST = 2**26
"""Bytes of an answer that is read: 64 MB; the largest asked for, some ten load steps of 288 points, has half of one."""


class CodeFile(NamedTuple):
    """What a code in files says of itself."""

    name: str
    version: str
    capabilities: frozenset[Capability]
    accuracy: float
    explicit: Mapping[str, int] | None = None
    """Numbers of blocks and steps for `explicit.relaxed`, of a code that steps in time."""


def read_code(path: Path) -> CodeFile:
    """`code.json`; NoAdapter says what is wrong with it."""
    try:
        said = json.loads(path.read_text("utf-8"))
        words = said["capabilities"]
        found = str(said["name"]), str(said.get("version", "")), frozenset(words), float(said.get("accuracy", 0.0))
        explicit = {name: int(said["explicit"][name]) for name in BLOCKS} if "explicit" in said else None
    except OSError as error:
        raise NoAdapter(f"{path}: the code has to say there what it is capable of ({error.strerror})") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise NoAdapter(
            f"{path}: give `name` and a list of `capabilities` as JSON, and numbers for `explicit` ({error})"
        ) from error
    if unknown := sorted(found[2] - set(KNOWN)):
        raise NoAdapter(f"{path}: {unknown} are no capabilities in files; there are {KNOWN}")
    return CodeFile(*found, explicit)


def write_case(folder: Path, case: Case, steps: int | None = None) -> None:
    """The files of a case: of an analysis, or of so many load steps."""
    material, points = case.body.material, case.points
    kind, counted = ("analysis", {}) if steps is None else ("load steps", {"steps": steps})
    _describe(folder, kind, case.name, case.grid, {"poisson": material.poisson, "plane": material.plane}, counted)
    body = np.zeros_like(points.x) if case.body_force is None else case.body_force
    _table(
        folder / "points.csv",
        "point,x,y,volume,half_x,half_y,young,force_x,force_y,body_x,body_y",
        *(points.x, points.volume[:, None], points.half_length, case.moduli[:, None], case.carried, body),
    )
    held = case.held
    columns = held.node, held.position, held.fixed, held.value
    _table(folder / "held.csv", "i,j,x,y,fixed_x,fixed_y,value_x,value_y", *columns, numbered=False)
    _table(folder / "loads.csv", "x,y,force_x,force_y", case.acts.position, case.acts.force, numbered=False)
    vertices = [("vertex", np.arange(len(points.x))[:, None])]
    fields = {"volume": points.volume, "young": case.moduli, "force": _three(case.carried)}
    meshio.Mesh(_three(points.x), vertices, point_data=fields).write(folder / "points.vtu")


def write_functions(folder: Path, x: Array, half_length: Array, grid: Grid) -> None:
    """The files of a question for shape functions."""
    _describe(folder, "functions", folder.name, grid, {})
    _table(folder / "points.csv", "point,x,y,half_x,half_y", x, half_length)


def functions_name(x: Array, half_length: Array, grid: Grid) -> str:
    """Name of a question for shape functions: of its numbers."""
    numbers = np.concatenate([x.ravel(), half_length.ravel(), grid.origin, grid.h, grid.cells])
    return f"functions {sha256(np.ascontiguousarray(numbers, float).tobytes()).hexdigest()[:10]}"


def steps_name(case: Case, count: int) -> str:
    """Name of a question for load steps."""
    return f"{case.name}, {count} steps"


def folder_of(name: str) -> str:
    """A case's name as that of a folder."""
    return "".join(c if c.isalnum() or c in ".-" else "_" for c in name)


def _describe(
    folder: Path, kind: str, name: str, grid: Grid, material: Mapping[str, Any], more: Mapping[str, Any] | None = None
) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    laid = {"origin": grid.origin, "h": grid.h, "cells": grid.cells}
    said = {"kind": kind, "name": name, "grid": laid, "material": material, **(more or {})}
    (folder / "case.json").write_text(json.dumps(said, indent=1) + "\n", "utf-8")


def _table(path: Path, header: str, *columns: Array | Index | Mask, numbered: bool = True) -> None:
    """Rows of numbers that read back to the last bit."""
    rows = np.concatenate([np.asarray(column, float) for column in columns], axis=1).tolist()
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header.split(","))
        writer.writerows(([k] if numbered else []) + [_short(v) for v in row] for k, row in enumerate(rows))


def _short(value: float) -> str:
    return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)


def _three(vectors: Array) -> Array:
    return np.pad(vectors, ((0, 0), (0, 1)))


def read_answer(folder: Path, case: Case, stem: str = "answer") -> tuple[Answer, Array | None]:
    """The answer to a case, and dC/dE (p,) if it is there. Misanswered says what is wrong with it."""
    tabled, drawn = folder / f"{stem}.csv", folder / f"{stem}.vtu"
    if not tabled.exists() and drawn.exists():
        return _read_vtu(drawn, case), None
    columns = _read_table(tabled, ("x", "y", "ux", "uy"))
    _check_places(tabled, np.stack([columns["x"], columns["y"]], axis=1), case)
    u = np.stack([columns["ux"], columns["uy"]], axis=1)
    stress = None
    if all(name in columns for name in ("sxx", "syy", "sxy")):
        stress = np.stack([columns[name] for name in ("sxx", "syy", "sxy")], axis=1)
    return Answer(u, stress), columns.get("dcde")


def _read_vtu(path: Path, case: Case) -> Answer:
    try:
        mesh = meshio.read(path)
        u = np.asarray(mesh.point_data["displacement"], float)[:, :2]
        stress = mesh.point_data.get("stress")
    except (Exception, SystemExit) as error:  # meshio ends the process over a file that it cannot read
        raise Misanswered(f"{path}: no VTU file with point data `displacement` ({error})") from error
    _check_places(path, np.asarray(mesh.points, float)[:, :2], case)
    return Answer(u, None if stress is None else np.asarray(stress, float))


def read_functions(path: Path, count: int) -> Shape:
    """The answer to a question for shape functions at `count` points."""
    columns = _read_table(path, ("point", "i", "j", "n", "dn_dx", "dn_dy"))
    point = columns["point"].astype(int)
    if len(point) and not (point.min() >= 0 and point.max() < count):
        raise Misanswered(
            f"{path}: points are numbered from {point.min()} to {point.max()}; there are 0 to {count - 1}"
        )
    order = np.argsort(point, kind="stable")
    place = np.arange(len(point)) - np.searchsorted(point[order], point[order])
    n = int(place.max(initial=0)) + 1
    node, N, grad_N = np.zeros((count, n, 2)), np.zeros((count, n)), np.zeros((count, n, 2))
    at = point[order], place
    node[at] = np.stack([columns["i"], columns["j"]], axis=1)[order]
    N[at] = columns["n"][order]
    grad_N[at] = np.stack([columns["dn_dx"], columns["dn_dy"]], axis=1)[order]
    return Shape(node.astype(np.intp), N, grad_N)


def read_steps(path: Path, case: Case, count: int) -> list[Step]:
    """The answer to a question for load steps: rows of all points in their order, step by step."""
    columns = _read_table(path, ("step", "point", "x", "y", "sxx", "syy", "sxy"))
    p = len(case.moduli)
    if len(columns["step"]) != count * p:
        raise Misanswered(f"{path}: {len(columns['step'])} rows for {p} points after each of {count} steps")
    step, point = np.divmod(np.arange(count * p), p)
    wrong = np.flatnonzero((columns["step"] != step + 1) | (columns["point"] != point))
    if len(wrong):
        raise Misanswered(f"{path}: row {wrong[0]} is not of step {step[wrong[0]] + 1}, point {point[wrong[0]]}")
    x = np.stack([columns["x"], columns["y"]], axis=1).reshape(count, p, 2)
    stress = np.stack([columns[name] for name in ("sxx", "syy", "sxy")], axis=1).reshape(count, p, 3)
    return [Step(*after) for after in zip(x, stress, strict=True)]


def _read_table(path: Path, needed: Iterable[str]) -> dict[str, Array]:
    """Columns by name, read no further than `LARGEST`. Misanswered says what is wrong with the file."""
    if not path.exists():
        raise Misanswered(f"there is no {path.name} in {path.parent.name}")
    if not path.is_file():
        raise Misanswered(f"{path} is no file")
    if (size := path.stat().st_size) > LARGEST:
        raise Misanswered(f"{path}: {size / 1e6:,.0f} MB: an answer has some hundred bytes for each point")
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            header, *rows = [row for row in csv.reader(file) if row]
        names = [name.strip().lower() for name in header]
        values = np.array([[float(value) for value in row] for row in rows] or np.zeros((0, len(names))))
    except (OSError, UnicodeError, ValueError, csv.Error) as error:
        raise Misanswered(f"{path}: no table of numbers under a line of names ({error})") from error
    if values.shape[1] != len(names):
        raise Misanswered(f"{path}: {values.shape[1]} columns under {len(names)} names")
    if twice := sorted({name for name in needed if names.count(name) > 1}):
        raise Misanswered(f"{path}: there is a column {', '.join(twice)} twice")
    if lacking := [name for name in needed if name not in names]:
        found = "".join(c if c.isprintable() else "?" for c in ", ".join(names)[:200])
        raise Misanswered(f"{path}: no column {', '.join(lacking)}; there are {found}")
    return dict(zip(names, values.T, strict=True))


def _check_places(path: Path, x: Array, case: Case) -> None:
    """Misanswered if the answer's points, by their positions, are not the case's in its order."""
    right, near = case.points.x, 1e-6 * float(case.points.half_length.min())
    if len(x) != len(right):
        raise Misanswered(f"{path}: {len(x)} rows for {len(right)} points")
    if np.all(np.abs(x - right) <= near):
        return
    alike = np.abs(x[np.lexsort(np.rint(x / near).T)] - right[np.lexsort(np.rint(right / near).T)]).max() <= 2 * near
    wrong = int(np.flatnonzero(np.any(~(np.abs(x - right) <= near), axis=1))[0])
    said = "the points are in another order" if alike else "x and y are not those of the case"
    raise Misanswered(f"{path}: {said}, from row {wrong} on: give them in that of points.csv")


class Recorder:
    """A code of all capabilities that writes down what it is asked, and answers nothing."""

    name, version, capabilities = "recorder", "", frozenset(KNOWN)

    def __init__(self, folder: Path) -> None:
        self.folder, self.written = folder, set[str]()

    def analyse(self, case: Case) -> Answer:
        """Zeros."""
        name = folder_of(case.name)
        if name not in self.written:
            write_case(self.folder / name, case)
            self.written.add(name)
        return Answer(np.zeros_like(case.points.x), np.zeros((len(case.moduli), 3)), 0.0)

    def gradient(self, case: Case) -> Array:
        """Zeros."""
        self.analyse(case)
        return np.zeros(len(case.moduli))

    def steps(self, case: Case, count: int) -> list[Step]:
        """Where the points were, without stress."""
        name = folder_of(steps_name(case, count))
        if name not in self.written:
            write_case(self.folder / name, case, count)
            self.written.add(name)
        return [Step(case.points.x, np.zeros((len(case.moduli), 3)))] * count

    def shape(self, x: Array, half_length: Array, grid: Grid) -> Shape:
        """No weights."""
        name = folder_of(functions_name(x, half_length, grid))
        if name not in self.written:
            write_functions(self.folder / name, x, half_length, grid)
            self.written.add(name)
        return Shape(np.zeros((len(x), 1, 2), int), np.zeros((len(x), 1)), np.zeros((len(x), 1, 2)))


def write_cases(folder: Path, checks: Iterable[Check]) -> int:
    """All that the checks ask, each in a folder of its own, and the schema; how many there are."""
    recorder = Recorder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "SCHEMA.md").write_text(f"{SCHEMA}\n## Capabilities\n\n{IN_FILES}\n{table(KNOWN)}", "utf-8")
    for check in (check for check in checks if check.needs <= recorder.capabilities):
        with suppress(Exception), np.errstate(all="ignore"):  # zeros are no answer to compute with
            check.observe(recorder)
    return len(recorder.written)
