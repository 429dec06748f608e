"""Two studies written to a folder, run by pytest itself, and what is read of their report."""

import contextlib
import csv
import html
import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import matplotlib.style
import pytest
from markdown_it import MarkdownIt

# imported before any run in this process: a run forgets what it imported, and extension modules load once
import validation.measures.drawing  # noqa: F401
from validation.harness import progress as counting

ROOT = Path(__file__).parents[2]
CROSSING = '''
"""Crossing & <friends>.

The *introduction*, with [a link](https://example.org).
"""

import time

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from validation.harness import progress as counting
from validation.harness.claims import Statement
from validation.measures.drawing import draw_design

ASKED = "Does a column that *crosses* matter?"
JUMP = Statement("Sect. 6.1", "a jump of 13.8 %", "result", 0.138, "%")
counting.EVERY = 0.1


@pytest.mark.benchmark
def test_finest(report):
    """The finest level."""
    report.check("finest", 1.5, source="none")
    report.timing("finest ratio", 6.75, source="none")


@pytest.mark.parametrize("shape, jump", [("tent", 0.137), ("GIMP", 0.02)])
def test_jump(report, progress, shape, jump):
    """Jump of the tip displacement."""
    for _ in progress(range(2), shape):
        time.sleep(0.2)
    report.text(f"Case **{shape}**.")
    report.found(f"With {shape} the tip jumps by {jump:.1%}.", front="With crossing")
    report.check(
        f"jump, {shape} | solid",
        jump,
        JUMP.value,
        rtol=0.02,
        source=JUMP,
        why="two per cent of it",
        reason="GIMP is smooth, see [the optimum](#test_optimum)",
    )


def test_optimum(report):
    """Optimised compliance."""
    x = np.stack(np.meshgrid(np.arange(80) / 2, np.arange(40) / 2), axis=-1).reshape(-1, 2)
    figure, ax = plt.subplots()
    draw_design(ax, x, np.array([0.25, 0.25]), x[:, 0] / 40)
    report.figure("design", figure, "Design of the `tent` run")
    wide = pd.DataFrame(1 / (3 + np.arange(24)).reshape(2, 12), columns=[f"a long heading {k}" for k in range(12)])
    report.table("wide", wide, "A table wider than a phone")
    cells = np.stack(np.meshgrid(np.arange(4) + 0.5, np.arange(2) + 0.5), axis=-1).reshape(-1, 2)
    report.design(
        "own",
        *(cells, np.array([0.5, 0.5]), np.arange(8) / 7),
        **{"body": "strip", "method": "MPM", "measure": "compliance", "own": 1.5, "true": 1.75, "front": True},
    )
    report.opening.text("The *scene*.")
    report.so("Keep points as seeded.", front="What to do")
    report.check("not a number", float("nan"), at_most=1.0, source="none")
    assert report.timing("speed-up", 2.5, at_least=2, source="our choice")
    report.timed.text("Least **CPU time**.")
    report.timed.table("seconds", pd.DataFrame({"CPU seconds": [8.125]}), "Measured seconds")
    figure, ax = plt.subplots()
    ax.plot([8.125, 9.5])
    report.timed.figure("clock", figure, "Seconds against error")
    raise RuntimeError("after its claims")


def test_locked(report, lock):
    lock({"kept": 1.0}, rtol=1e-12)


def test_skipped(report):
    pytest.skip("nothing to compare with")
'''
OTHER = '''
"""Another study."""


def test_open(report):
    report.check("radius", 3.0, source="our choice")
'''
OPTIONS = ["-p", "validation.conftest", "-p", "no:cacheprovider", "-W", "error", "-q", "--color=no"]
OPTIONS += ["--import-mode=importlib", "--rootdir=.", "--reports", "reports"]
LOCKED = "studies/crossing/locks/test_locked.csv"


def run(folder: Path) -> str:
    """pytest in a process of its own, on a terminal, on the studies in `folder`: what it prints."""
    environment = {name: value for name, value in os.environ.items() if name != "CI"}
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "pytest", *OPTIONS],
        cwd=folder,
        env=environment | {"PYTHONPATH": str(ROOT), "COLUMNS": "200", "TERM": "xterm"},
        stdout=theirs,
        stderr=theirs,
    )
    os.close(theirs)
    printed = b""
    with (
        open(ours, "rb", buffering=0) as terminal,
        contextlib.suppress(OSError),
    ):  # Linux: error at the end of a terminal
        while piece := terminal.read(4096):
            printed += piece
    process.wait()
    return printed.decode()


def write_study(folder: Path, name: str, text: str) -> None:
    """The study of that name among those in `folder`."""
    study = folder / "studies" / name / f"test_{name}.py"
    study.parent.mkdir(parents=True, exist_ok=True)
    study.write_text(text)


def rerun(pytester: pytest.Pytester, *arguments: str) -> str:
    """The same in this process, which is quicker, without a terminal and in the folder of `pytester`."""
    with mpl.rc_context(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(counting, "EVERY", counting.EVERY)  # which the study changes
        return pytester.runpytest_inprocess(*OPTIONS, *arguments).stdout.str()


def committed(reports: Path) -> dict[str, bytes]:
    """Content of the files of a report that are kept with the code."""
    local = {"timings.md", "provenance.json"}
    files = [
        file
        for file in reports.rglob("*.*")
        if file.suffix != ".html" and file.name not in local and file.parent.name != "timed"
    ]
    return {str(file.relative_to(reports)): file.read_bytes() for file in files}


def is_text(file: str) -> bool:
    """Whether a file of a report holds numbers as such, not as coordinates or pixels."""
    return not file.endswith((".svg", ".png"))


def claims(reports: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((reports / "data" / "claims.csv").read_text().splitlines()))


def tables(page: Path) -> list[list[list[str]]]:
    """Text of the cells of each table of a page, row by row, without what stands below it in the cell."""
    text = page.read_text()
    text = MarkdownIt(options_update={"html": False}).enable("table").render(text) if page.suffix == ".md" else text
    split = [
        [re.findall(r"<t[hd][ >].*?</t[hd]>", row, re.DOTALL) for row in table.split("</tr>")[:-1]]
        for table in re.findall(r"<table.*?</table>", text, re.DOTALL)
    ]
    tags = re.compile(r'<span class="(?:where|reason)".*?</span>|<[^>]*>')
    return [[[html.unescape(tags.sub("", cell)).strip() for cell in row] for row in rows] for rows in split]
