"""Codes in files: what is written reads back, a driver in Octave answers, hostile answers are named and cost a row."""

import json
import shutil
from pathlib import Path

import meshio
import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.grid import Grid
from mpmtop.shape_functions import gimp, tent
from tests.codes.conftest import write_answer
from validation.codes import cases, steps
from validation.codes.adapter import NoAdapter
from validation.codes.answers import Misanswered, NotStated
from validation.codes.card import Card, Check, scorecard
from validation.codes.checks import every
from validation.codes.command import AnsweredFolder, CommandCode
from validation.codes.files import (
    folder_of,
    functions_name,
    read_answer,
    read_functions,
    steps_name,
    write_case,
    write_cases,
)
from validation.methods.points import PointMethod
from validation.methods.protocol import Answer, Case, Shape, Step

HERE = Path(__file__).parent
SOME = [
    "rigid motion, uneven points",
    "rigid motion, points on grid lines",
    "patch test, uniform points",
    "mean stress, loads on points",
    "mean stress, loads at positions",
    "two layers, stretched",
    "plane stress",
    "origin negative",
    "energy balance, uneven points",
    "compliance stated",
    "self weight, points of unequal size",
]


def some(names: list[str] = SOME) -> list[Check]:
    return [check for check in every() if check.way == "analysis" and check.name in names]


def test_octave_drives_a_toy_mpm() -> None:
    """Written for this test in another language: right by all that it can do, and with our tent's digits."""
    octave = shutil.which("octave-cli")
    if octave is None:
        pytest.skip("octave-cli is not installed: the driver of this test is written in Octave")
    code = CommandCode(f"{octave} --no-gui -q {HERE / 'toy_mpm.m'} {{case}} {{answer}}")
    assert (code.name, code.version) == ("toy MPM", "1") and "loads at positions" not in code.capabilities
    card = scorecard(code, some())
    words = {row.check.name: row.verdict for row in card.rows}
    assert words.pop("mean stress, loads at positions") == "not supported"
    assert words.pop("compliance stated") == "not stated"
    assert set(words.values()) == {"passes"}, card.of("fails")
    case = cases.under_weight("uneven", cases.uneven((12, 6)))
    theirs, ours = code.analyse(case), PointMethod("tent", tent).analyse(case)
    np.testing.assert_allclose(theirs.u, ours.u, atol=1e-11 * np.abs(ours.u).max())
    assert theirs.stress is not None and ours.stress is not None
    np.testing.assert_allclose(theirs.stress, ours.stress, atol=1e-11 * np.abs(ours.stress).max())


# --- a folder of answers ----------------------------------------------------------------------------------------------


def test_numbers_pass_through_files_to_the_last_bit(asked: tuple[Path, Case]) -> None:
    folder, case = asked
    table = np.genfromtxt(folder / "points.csv", delimiter=",", names=True)
    assert np.array_equal(np.stack([table["x"], table["y"]], 1), case.points.x)
    assert np.array_equal(np.stack([table["force_x"], table["force_y"]], 1), case.carried)
    held = np.genfromtxt(folder / "held.csv", delimiter=",", names=True)
    assert np.array_equal(held["i"], case.held.node[:, 0]) and np.array_equal(held["fixed_y"], case.held.fixed[:, 1])
    said = json.loads((folder / "case.json").read_text())
    assert said["grid"] == {"origin": [0, 0], "h": [1, 1], "cells": [16, 10]} and said["material"]["plane"] == "strain"
    assert np.array_equal(meshio.read(folder / "points.vtu").points[:, :2], case.points.x)
    answer, ours = read_answer(folder, case)[0], PointMethod("tent", tent).analyse(case)
    assert np.array_equal(answer.u, ours.u) and np.array_equal(answer.stress, ours.stress)


def test_an_answer_may_be_a_vtu(asked: tuple[Path, Case]) -> None:
    folder, case = asked
    expected = read_answer(folder, case)[0]
    (folder / "answer.csv").unlink()
    vertices = [("vertex", np.arange(len(case.moduli))[:, None])]
    fields = {"displacement": np.pad(expected.u, ((0, 0), (0, 1))), "stress": expected.stress}
    meshio.Mesh(np.pad(case.points.x, ((0, 0), (0, 1))), vertices, point_data=fields).write(folder / "answer.vtu")
    found = read_answer(folder, case)[0]
    assert np.array_equal(found.u, expected.u) and np.array_equal(found.stress, expected.stress)
    (folder / "answer.vtu").write_text("nothing of the kind")
    with pytest.raises(Misanswered, match="no VTU file with point data"):
        read_answer(folder, case)


def test_a_table_of_a_spreadsheet_is_read(asked: tuple[Path, Case]) -> None:
    """With a byte order mark, spaces around names, capitals, and a column of its own."""
    folder, case = asked
    right, path = read_answer(folder, case)[0], folder / "answer.csv"
    first, *rows = path.read_text().splitlines()
    lines = [f"Note, {first.upper().replace(',', ' , ')}", *(f"7,{row}" for row in rows)]
    path.write_text("\r\n".join(lines), "utf-8-sig")
    assert np.array_equal(read_answer(folder, case)[0].u, right.u)


def test_a_folder_of_answers_is_a_code(tmp_path: Path) -> None:
    """What was not answered fails by name and costs one row; what is not finite, too; no stress is not stated."""
    assert write_cases(tmp_path, some(["mean stress, loads on points", "points in another order"])) == 2
    assert "half the sides of its domain" in (tmp_path / "SCHEMA.md").read_text()
    said = {"name": "by hand", "capabilities": ["analysis"]}
    (tmp_path / "code.json").write_text(json.dumps(said))
    folder, case = tmp_path / folder_of("cantilever"), cases.cantilever("cantilever")
    write_answer(folder, case)

    def card() -> Card:
        return scorecard(AnsweredFolder(tmp_path), some(["mean stress, loads on points", "points in another order"]))

    mean, order = card().rows
    assert (mean.verdict, order.verdict) == ("passes", "fails")
    assert order.where == "Misanswered: there is no answer.csv in cantilever__points_in_another_order"
    text = (folder / "answer.csv").read_text()
    lines = text.splitlines()
    (folder / "answer.csv").write_text("\n".join([*lines[:-1], lines[-1].rpartition(",")[0] + ",nan"]))
    assert "1 of 288 stresses of cantilever are not finite" in card().rows[0].where
    (folder / "answer.csv").write_text(text.replace("sxx", "txx"))
    assert (card().rows[0].verdict, card().rows[0].where) == ("not stated", "stress")
    with pytest.raises(NotStated, match="dcde"):
        AnsweredFolder(tmp_path).gradient(case)


def test_functions_pass_through_files(tmp_path: Path) -> None:
    """Rows in any order, nodes of a point wherever they stand."""
    path = tmp_path / "answer.csv"
    path.write_text("point,i,j,n,dn_dx,dn_dy\n1,4,5,0.25,1,2\n0,1,1,1,0,0\n1,3,5,0.75,-1,-2\n")
    shape = read_functions(path, 3)
    assert shape.N.tolist() == [[1, 0], [0.25, 0.75], [0, 0]] and shape.node[1].tolist() == [[4, 5], [3, 5]]
    assert shape.grad_N[1].tolist() == [[1, 2], [-1, -2]]
    with pytest.raises(Misanswered, match="numbered from 0 to 1; there are 0 to 0"):
        read_functions(path, 1)


def test_load_steps_pass_through_files(tmp_path: Path) -> None:
    """A folder of answers gives the steps; rows in another order, too few and none are named."""
    case, right = steps._pulled(0.02), PointMethod("GIMP", gimp).steps(steps._pulled(0.02), 2)
    (tmp_path / "code.json").write_text('{"name": "by hand", "capabilities": ["load steps"]}')
    folder = tmp_path / folder_of(steps_name(case, 2))
    write_case(folder, case, 2)
    assert json.loads((folder / "case.json").read_text())["steps"] == 2
    p, path = len(case.moduli), folder / "answer.csv"
    rows = np.vstack(
        [np.column_stack([np.full(p, k), np.arange(p), x, stress]) for k, (x, stress) in enumerate(right, 1)]
    )

    def answer(rows: Array) -> list[Step]:
        np.savetxt(path, rows, "%.17g", ",", header="step,point,x,y,sxx,syy,sxy", comments="")
        return AnsweredFolder(tmp_path).steps(case, 2)

    for found, expected in zip(answer(rows), right, strict=True):
        assert np.array_equal(found.x, expected.x) and np.array_equal(found.stress, expected.stress)
    for wrong, said in (
        (rows[:-1], "575 rows for 288 points after each of 2 steps"),
        (rows[::-1], "row 0 is not of step 1, point 0"),
    ):
        with pytest.raises(Misanswered, match=said):
            answer(wrong)


def test_capabilities_in_files_are_checked(tmp_path: Path) -> None:
    for said, wrong in (
        ("{}", "give `name` and a list"),
        ('{"name": "x", "capabilities": ["magic"]}', r"\['magic'\] are no capabilities"),
        ("not json", "give `name` and a list"),
    ):
        (tmp_path / "code.json").write_text(said)
        with pytest.raises(NoAdapter, match=wrong):
            AnsweredFolder(tmp_path)


def test_all_cases_are_written(tmp_path: Path) -> None:
    """Whatever a sound code is asked is there: GIMP's questions, by their folders."""
    write_cases(tmp_path, every())
    there = {path.name for path in tmp_path.iterdir() if path.is_dir()}

    class Asking:
        name, version = "asking", ""
        inner = PointMethod("GIMP", gimp)
        capabilities = inner.capabilities

        def analyse(self, case: Case) -> Answer:
            assert folder_of(case.name) in there
            return self.inner.analyse(case)

        def gradient(self, case: Case) -> Array:
            return self.inner.gradient(case)

        def steps(self, case: Case, count: int) -> list[Step]:
            assert folder_of(steps_name(case, count)) in there
            return self.inner.steps(case, count)

        def shape(self, x: Array, half_length: Array, grid: Grid) -> Shape:
            assert folder_of(functions_name(x, half_length, grid)) in there
            return self.inner.shape(x, half_length, grid)

    assert scorecard(Asking(), every()).of("fails") == []
