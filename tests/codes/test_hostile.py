"""Hostile answers are named, read in no time, and cost their rows only; so do commands that crash, hang or talk."""

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from validation.codes.adapter import NoAdapter
from validation.codes.answers import Misanswered
from validation.codes.answers import asked as ask
from validation.codes.card import Check, scorecard
from validation.codes.checks import every
from validation.codes.command import CommandCode
from validation.codes.files import KNOWN, read_answer
from validation.methods.protocol import Answer, Case


def some(names: list[str]) -> list[Check]:
    return [check for check in every() if check.way == "analysis" and check.name in names]


def swapped(text: str) -> str:
    first, *rows = text.splitlines()
    return "\n".join([first, *rows[::-1]])


FOUR = [
    "rigid motion, uneven points",
    "rigid motion, points on grid lines",
    "patch test, uniform points",
    "mean stress, loads on points",
]
HOSTILE = {
    "cut off": (lambda text: "\n".join(text.splitlines()[:-3]), "285 rows for 288 points"),
    "in another order": (swapped, "the points are in another order, from row 0 on"),
    "of another case": (lambda text: text.replace("2.25", "2.35"), "x and y are not those of the case"),
    "without a column": (lambda text: text.replace("uy", "vy"), "no column uy; there are point, x, y, ux, vy"),
    "words": (lambda text: text.replace("2.75", "two"), "no table of numbers"),
    "ragged": (lambda text: text + "1,2\n", "no table of numbers"),
    "empty": (lambda text: "", "no table of numbers"),
    "a header alone": (lambda text: text.splitlines()[0], "0 rows for 288 points"),
    "cut off in a row": (lambda text: text[:-40], "no table of numbers"),
    "with a column twice": (lambda text: text.replace("sxx", "ux"), "ux twice"),
    "with columns too many": (lambda text: text.replace("\n", ",1\n").replace("sxy,1", "sxy"), "9 columns under 8"),
    "with decimal commas": (lambda text: text.replace(",", ";").replace(".", ","), "no table of numbers"),
    "too large for a number": (lambda text: text.replace("-0.", "-1e999"), "are not finite"),
    "of zeros": (lambda text: "\0" * 1000, r"there are \?{200}$"),
}


@pytest.mark.parametrize("how", HOSTILE)
def test_a_hostile_table_is_named(asked: tuple[Path, Case], how: str) -> None:
    folder, case = asked
    spoil, said = HOSTILE[how]
    (folder / "answer.csv").write_text(spoil((folder / "answer.csv").read_text()))
    with pytest.raises(Misanswered, match=said):
        answered_by(folder, case)


def answered_by(folder: Path, case: Case) -> Answer:
    """As a code in that folder answers a check."""
    inner = type(
        "There", (), {"capabilities": frozenset(KNOWN), "analyse": lambda self, case: read_answer(folder, case)[0]}
    )()
    return ask(inner, case)


def encoded(path: Path) -> None:
    path.write_text(path.read_text(), "utf-16")


def instead(make: Callable[[Path], object]) -> Callable[[Path], None]:
    """Something else in the file's place."""

    def spoil(path: Path) -> None:
        path.unlink()
        make(path)

    return spoil


def swollen(path: Path) -> None:
    """A file of a gigabyte, of which the disk holds nothing."""
    with path.open("r+b") as file:
        file.truncate(2**30)


NO_FILES = {
    "in another encoding": (encoded, "no table of numbers"),
    "a folder": (instead(lambda path: path.mkdir()), "is no file"),
    "a pipe that no one writes to": (instead(lambda path: os.mkfifo(path)), "is no file"),
    "a device without end": (instead(lambda path: path.symlink_to("/dev/zero")), "is no file"),
    "a link to nowhere": (instead(lambda path: path.symlink_to("nowhere")), "there is no answer.csv"),
    "a gigabyte": (swollen, r"1,074 MB: an answer has some"),
}


@pytest.mark.parametrize("how", NO_FILES)
def test_what_is_no_table_is_named(asked: tuple[Path, Case], how: str) -> None:
    """At once, and without reading it."""
    folder, case = asked
    spoil, said = NO_FILES[how]
    spoil(folder / "answer.csv")
    with pytest.raises(Misanswered, match=said):
        read_answer(folder, case)


def test_a_table_that_may_not_be_read_is_named(asked: tuple[Path, Case], monkeypatch: pytest.MonkeyPatch) -> None:
    """By the system's word for it; whoever runs tests may be allowed to read everything."""
    folder, case = asked

    def refused(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refused)
    with pytest.raises(Misanswered, match="Permission denied"):
        read_answer(folder, case)


# --- commands ---------------------------------------------------------------------------------------------------------

DRIVER = """
import json, os, sys, time
case, answer = sys.argv[1:]
if case == "capabilities":
    said = {"name": "hostile", "capabilities": ["analysis", "points anywhere", "prescribed displacements"]}
    json.dump(said, open(answer, "w"))
    sys.exit(0)
if case.endswith("cantilever"):
    DO
"""
TALK = "b = b'x' * 65536\n    while True: os.write(2, b)"
DEEDS = {
    "hangs": ("time.sleep(600)", "TimedOut: no end after 2 s"),
    "hangs with a child": ("os.system('sleep 600')", "TimedOut: no end after 2 s"),
    "crashes": ("sys.exit('out of memory')", "Crashed: exit code 1: out of memory"),
    "dies": ("os.kill(os.getpid(), 11)", "Crashed: signal 11: it said nothing"),
    "answers nothing": ("pass", "Misanswered: there is no answer.csv in cantilever"),
    "talks without end": (TALK, "TimedOut: no end after 2 s"),
    "leaves a child behind": (
        "import subprocess; subprocess.Popen(['sleep', '600'], start_new_session=True)",
        "Misanswered: there is no answer.csv in cantilever",
    ),
}


def hostile(tmp_path: Path, deed: str) -> CommandCode:
    driver = tmp_path / "driver.py"
    driver.write_text(DRIVER.replace("DO", deed))
    return CommandCode(f"{sys.executable} -S {driver} {{case}} {{answer}}", 2.0)


@pytest.mark.parametrize("how", DEEDS)
def test_a_hostile_command_is_named_and_costs_rows_only(tmp_path: Path, how: str) -> None:
    deed, said = DEEDS[how]
    row, other = scorecard(
        hostile(tmp_path, deed), some(["mean stress, loads on points", "rigid motion, uneven points"])[::-1]
    ).rows
    assert row.verdict == "fails" and row.where == said
    assert other.verdict == "fails" and other.where.startswith("Misanswered: there is no answer.csv in rigid_motion")


def test_a_command_that_always_hangs_is_given_up(tmp_path: Path) -> None:
    code = hostile(tmp_path, "pass")
    code.timeout = 0.3
    code.command = f"{sys.executable} -S -c 'import time; time.sleep(600)' {{case}} {{answer}}"
    started = time.monotonic()
    rows = scorecard(code, some(FOUR)).rows
    assert time.monotonic() - started < 30  # two waits of 0.3 s; the rest is a busy machine's
    assert rows[-1].where == "TimedOut: not asked: 2 calls before did not end in 0.3 s"


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("driver {case}", "names {case} and {answer}"),
        ("there-is-no-such-driver {case} {answer}", "asked for its capabilities: .* No such file"),
        (f"{sys.executable} -S -c 'raise SystemExit(3)' {{case}} {{answer}}", "exit code 3"),
        (f"{sys.executable} -S -c 'pass' {{case}} {{answer}}", "has to say there what it is capable of"),
    ],
)
def test_a_command_that_is_none_is_refused(command: str, said: str) -> None:
    with pytest.raises(NoAdapter, match=said):
        CommandCode(command, 20.0)
