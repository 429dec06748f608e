"""A command that steps in time is ramped and damped line by line; what it says wrongly, or not at all, is named."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from mpmtop.errors import NotConverged
from mpmtop.shape_functions import tent
from validation.codes import cases
from validation.codes.adapter import NoAdapter
from validation.codes.answers import Misanswered
from validation.codes.explicit import Relaxed
from validation.codes.named import code
from validation.codes.process import Crashed, TimedOut
from validation.methods.points import PointMethod

DRIVER = """
import json, math, sys, time
case, answer, right = sys.argv[1:]
if case == "capabilities":
    json.dump(SAID, open(answer, "w"))
    sys.exit(0)
names, *rows = open(right).read().split()
rows = [[float(word) for word in row.split(",")] for row in rows]
left = 1.0
print("some words of its own")
for line in sys.stdin:
    level, steps = line.split()
    left *= math.exp(-int(steps) / SLOW)
    part = float(level) * (1 - left)
    with open(answer, "w") as out:
        print(names, file=out)
        for row in rows:
            print(*row[:3], *(part * value for value in row[3:]), sep=",", file=out)
    DO
    print("moved", left**2, 1.0, flush=True)
"""
SAID = {"name": "creeping", "capabilities": ["analysis"], "accuracy": 1e-3}
BLOCKS = {"ramp": 3, "block": 10, "blocks": 40}
CASE = cases.cantilever("cantilever")


def stepping(
    tmp_path: Path, *, slow: float = 10.0, do: str = "pass", seconds: float = 60.0, **blocks: object
) -> Relaxed:
    """A driver whose displacements go to our tent's as exp(-steps / `slow`) goes to zero."""
    answer = PointMethod("tent", tent).analyse(CASE)
    assert answer.stress is not None
    rows = np.column_stack([np.arange(len(answer.u)), CASE.points.x, answer.u, answer.stress])
    right, driver = tmp_path / "right.csv", tmp_path / "driver.py"
    np.savetxt(right, rows, "%.17g", delimiter=",", header="point,x,y,ux,uy,sxx,syy,sxy", comments="")
    said = json.loads(json.dumps(SAID | {"explicit": BLOCKS | blocks}))
    driver.write_text(DRIVER.replace("SAID", repr(said)).replace("SLOW", str(slow)).replace("DO", do))
    found = code(f"{sys.executable} -S {driver} {{case}} {{answer}} {right}", seconds)
    assert isinstance(found, Relaxed)
    return found


def test_a_command_is_ramped_and_damped_to_its_accuracy(tmp_path: Path) -> None:
    """What it says beside its answers is passed over."""
    relaxed = stepping(tmp_path)
    assert (relaxed.name, relaxed.accuracy, relaxed.ramp) == ("creeping", 1e-3, 3)
    found, right = relaxed.analyse(CASE), PointMethod("tent", tent).analyse(CASE)
    assert np.abs(found.u - right.u).max() <= 1e-3 * np.abs(right.u).max()
    assert found.kinetic is not None and found.kinetic <= 1e-8


def test_a_body_that_creeps_has_not_come_to_rest(tmp_path: Path) -> None:
    """Its kinetic energy is next to nothing on its way: the change over a block is what counts."""
    still = 'print("moved 0.0 1.0", flush=True); continue'
    with pytest.raises(NotConverged, match=r"or the change over a block, is 1\.2e-01"):
        stepping(tmp_path, slow=1e3, do=still, blocks=5).analyse(CASE)


@pytest.mark.parametrize(
    ("do", "seconds", "error", "said"),
    [
        ("sys.exit('out of memory')", 60.0, Crashed, "exit code 1: some words of its own; out of memory"),
        ("print('moved it', flush=True)", 60.0, Crashed, "it said `moved it`: give two numbers, both energies"),
        ("import os; os.remove(answer)", 60.0, Misanswered, "there is no answer.csv in cantilever"),
        ("time.sleep(600)", 2.0, TimedOut, "no end after 2 s"),
        ("print('words', flush=True); continue", 2.0, TimedOut, "no end after 2 s"),
    ],
)
def test_what_a_command_does_not_answer_is_named(
    tmp_path: Path, do: str, seconds: float, error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        stepping(tmp_path, do=do, seconds=seconds).analyse(CASE)


def test_a_command_that_always_hangs_is_given_up(tmp_path: Path) -> None:
    relaxed = stepping(tmp_path, do="time.sleep(600)", seconds=0.5)
    for said in ("no end", "no end", "not asked: 2 calls before did not end in 0.5 s"):
        with pytest.raises(TimedOut, match=said):
            relaxed.analyse(CASE)


@pytest.mark.parametrize(
    ("wrong", "said"), [({"ramp": 0}, "give positive numbers"), ({"ramp": None}, "for `explicit`")]
)
def test_numbers_of_blocks_are_checked(tmp_path: Path, wrong: dict[str, object], said: str) -> None:
    with pytest.raises(NoAdapter, match=said):
        stepping(tmp_path, **wrong)
