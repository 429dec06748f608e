"""The validation report: studies run by pytest itself, their files, and the pages in a real browser."""

import contextlib
import csv
import html
import json
import os
import pty
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import matplotlib.style
import numpy as np
import pandas as pd
import pytest
from markdown_it import MarkdownIt

from validation.__main__ import BEGIN, END, main, with_findings
from validation.harness import plugin
from validation.harness import progress as counting
from validation.harness.blocks import Table, raster
from validation.harness.claims import Reading, Statement, Tally, stands
from validation.harness.pages import replace
from validation.harness.report import Locked, Report
from validation.harness.show import cell, changed, digits3, number, per_cent, show
from validation.harness.store import CLAIM_COLUMNS, Section, Study, read
from validation.harness.style import STYLE
from validation.harness.timed import read_timed
from validation.measures.drawing import draw_design, draw_points

pytest_plugins = ["pytester"]

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


@pytest.fixture(scope="module")
def studied(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A folder of two studies that were run once, and what pytest printed."""
    folder = tmp_path_factory.mktemp("studies")
    (folder / "pytest.ini").write_text("[pytest]\nmarkers = benchmark\n")
    write_study(folder, "crossing", CROSSING)
    write_study(folder, "other", OTHER)
    (folder / LOCKED).parent.mkdir()
    (folder / LOCKED).write_text(",kept,dropped\n0,1.0,2.0\n")
    return folder, run(folder)


def test_failing_tests_keep_their_claims(studied: tuple[Path, str]) -> None:
    folder, printed = studied
    rows = claims(folder / "reports")
    assert tuple(rows[0]) == CLAIM_COLUMNS
    shown = ("study", "kind", "claim", "observed", "expected", "rtol", "verdict", "reason")
    reason = "GIMP is smooth, see [the optimum](#test_optimum)"
    assert [tuple(row[name] for name in shown) for row in rows] == [
        ("crossing", "result", "jump, tent | solid", "0.137", "0.138", "0.02", "agrees", ""),
        ("crossing", "result", "jump, GIMP | solid", "0.02", "0.138", "0.02", "differs", reason),
        ("crossing", "check", "not a number", "nan", "<= 1", "", "fails", ""),
        ("crossing", "check", "speed-up", "see timings", ">= 2", "", "holds", ""),
        ("other", "check", "radius", "3.0", "", "", "reported", ""),
    ]
    assert {row["stated"] for row in rows if row["kind"] == "result"} == {"a jump of 13.8 %"}
    assert "5 claims of 2 studies ran; statements of the paper: 0 agree, 1 by reading, 0 differ" in printed
    assert "our checks: 1 of 2 hold; locked values: 1 of 1 within tolerance; sections that failed: 2" in printed
    assert f"report: {folder / 'reports' / 'index.html'}" in printed
    page = (folder / "reports" / "crossing.md").read_text()
    assert "`test_optimum` ended with RuntimeError" in page
    assert r"| jump, GIMP \| solid. *Most likely reason:* GIMP is smooth" in page
    assert "test_skipped" not in page


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


@pytest.mark.parametrize("suffix", ["md", "html"])
def test_what_the_paper_says_stands_apart_from_our_checks(studied: tuple[Path, str], suffix: str) -> None:
    paper = ["The paper’s words", "Our reading", "We get", "Deviation", "Verdict", "Counts as agreement"]
    ours = ["Check", "We get", "Required", "Verdict", "Why"]
    listed = tables(studied[0] / "reports" / f"claims.{suffix}")
    assert [[word.replace("'", "’") for word in rows[0]] for rows in listed] == [paper, ours, ours]
    readings, checks, other = ([row[-5:-1] for row in rows[1:]] for rows in listed)
    assert [row[-3:] for row in readings] == [
        ["13.7\u00a0%", "-0.72\u00a0%", "✓ agrees"],
        ["2\u00a0%", "-86\u00a0%", "✗ differs"],
    ]
    assert [row[0] for row in checks] == ["not a number", "speed-up"]
    assert [row[-1].split()[-1] for row in checks] == ["fails", "holds"]
    assert other == [["radius", "3", "–", "○ reported"]]
    crossing = studied[0] / "reports" / f"crossing.{suffix}"
    assert [[word.replace("'", "’") for word in rows[0]] for rows in tables(crossing)[:2]] == [paper, ours]


@pytest.mark.parametrize("suffix", ["md", "html"])
def test_the_answer_comes_first(studied: tuple[Path, str], suffix: str) -> None:
    """What was asked, found and follows, before anything else; on the front page by topic, the printed results too."""
    texts = {
        name: html.unescape((studied[0] / "reports" / f"{name}.{suffix}").read_text()) for name in ("index", "crossing")
    }
    page = texts["crossing"]
    order = [
        "Does a column that",
        "With tent the tip jumps by 13.7%.",
        "Keep points as seeded.",
        "scene",
        "introduction",
    ]
    places = [page.index(words) for words in order]
    assert places == sorted(places)
    front = texts["index"]
    for words in ("With tent the tip jumps by 13.7%.", "Keep points as seeded.", "a jump of 13.8 %", "by reading"):
        assert words in front
    assert "Of the 1 numbers that the paper prints as results: 0 met without fitting" in front


def test_what_failed_and_drifted_is_on_the_front_page(studied: tuple[Path, str], pytester: pytest.Pytester) -> None:
    front = (studied[0] / "reports" / "index.html").read_text()
    assert "Sections that failed: <b>2</b>" in front
    assert "<b>1</b> of <b>1</b> within their tolerance, largest drift 0" in front
    shutil.copytree(studied[0], pytester.path, dirs_exist_ok=True)
    (pytester.path / LOCKED).write_text(",kept\n0,1.25\n")
    assert "locked values: 0 of 1 within tolerance" in rerun(pytester, "-k", "locked")
    front = (pytester.path / "reports" / "index.html").read_text()
    assert "Locked values: <b>0</b> of <b>1</b>" in front
    row = next(row for rows in tables(pytester.path / "reports" / "index.html") for row in rows if "kept" in row[0])
    assert row[1:] == ["1.25", "1", "-20\u00a0%", "10⁻¹⁰\u00a0%"]
    assert "1.25" not in b"".join(committed(pytester.path / "reports").values()).decode(errors="ignore")


def test_every_section_says_which_run_it_is_of(studied: tuple[Path, str], pytester: pytest.Pytester) -> None:
    shutil.copytree(studied[0], pytester.path, dirs_exist_ok=True)
    reports = pytester.path / "reports"
    rerun(pytester, "-k", "jump")
    page = (reports / "crossing.html").read_text()
    notes = re.findall(r'<p class="of-run">(.*?)</p>', page)
    assert [note.startswith("This run: ") for note in notes] == [True, False, False]
    assert notes[1].startswith("Not run this time; from the run of ")
    assert notes[0].endswith("Again: <code>pytest studies/crossing/test_crossing.py -k test_jump</code>")
    shutil.rmtree(reports / "timed")
    rerun(pytester, "-k", "jump")
    assert "Not run on this machine: as kept with the code." in (reports / "crossing.html").read_text()


def test_readings_of_one_sentence_count_once() -> None:
    said = Statement("Sect. 6.1", "slower", "trend")
    printed = Statement("Fig. 9", "83.57", "calibrated", 83.57)
    misprint = Statement("Eq. (7)", "1 - d²", "erratum")
    report = Report("study", "test", set())
    report.check("one reading", 1.0, at_least=1.05, source=said)
    report.check("another", 1.7, at_least=1.05, source=said)
    report.check("only reported", 1.0, source=said)
    report.check("fitted", 84.57, printed.value, rtol=0.03, source=printed)
    report.check("printed", 0.125, 0.125, source=misprint)
    report.check("ours", 1.0, at_most=2.0, source="our bound")
    report.check("ours, too", 1.0, source="for comparison")
    readings = [Reading(claim, "study", "test") for claim in report.claims]
    assert [(len(stand.readings), stand.state) for stand in stands(readings)][:2] == [(3, "by reading"), (1, "agrees")]
    tally = Tally.of(readings)
    assert {kind: dict(states) for kind, states in tally.paper.items() if states} == {
        "trend": {"by reading": 1},
        "calibrated": {"agrees": 1},
    }
    assert (dict(tally.checks), dict(tally.errata)) == ({"holds": 1, "reported": 1}, {"holds": 1})
    assert tally.headline().endswith("results: 0 met without fitting, 1 met by fitting, 0 not met.")


def test_a_place_in_the_paper_needs_what_is_stated_there() -> None:
    places = ("Sect. 6.1: stiffer", "Sects. 2 and 3", "Fig. 9", "Figs. 9, 10", "Eq. (7)", "Eqs. (7, 8)", "Table 2")
    for place in (*places, "Appendix: identical", "Appendix, Eq. A.1"):
        with pytest.raises(ValueError, match="give the Statement"):
            Report("study", "test", set()).check("claim", 1.0, source=place)
    for own in ("our bound", "Svanberg (2002), Sect. 5", "Section of ours", "Tables", "Figure", ""):
        assert Report("study", "test", set()).check("claim", 1.0, source=own)


@pytest.mark.parametrize(
    ("stated", "now", "rtol", "drift", "within"),
    [
        (2.0, 2.1, 0.06, 0.05, True),
        (-2.0, -2.2, 0.05, -0.1, False),
        (0.0, 0.0, 0.0, 0.0, True),
        (0.0, 1.0, 0.5, np.inf, False),
    ],
)
def test_drift(stated: float, now: float, rtol: float, drift: float, within: bool) -> None:
    lock = Locked("number", stated, now, rtol)
    assert lock.drift == pytest.approx(drift)
    assert lock.within == within


def test_designs_are_one_pixel_for_each_smallest_point() -> None:
    """Rows from the top; a coarse rectangle covers as many pixels as it is larger; nothing outside the body."""
    x = np.array([(0.5, 0.5), (1.5, 0.5), (0.5, 1.5), (3.0, 1.0)])
    half = np.array([(0.5, 0.5)] * 3 + [(1.0, 1.0)])
    grey, opacity = np.moveaxis(raster(x, half, np.array([0.0, 1.0, 0.2, 0.6])), -1, 0)
    assert grey.tolist() == [[204, 0, 102, 102], [255, 0, 102, 102]]
    assert opacity.tolist() == [[255, 0, 255, 255], [255, 255, 255, 255]]


def test_a_lock_misses_no_column(studied: tuple[Path, str]) -> None:
    assert re.search(r"test_locked - AssertionError: other numbers than test_locked.csv holds", studied[1])


def test_measured_times_stay_out_of_what_is_committed(studied: tuple[Path, str]) -> None:
    reports = studied[0] / "reports"
    assert ",2.5,>= 2," in (reports / "timed" / "ratios.csv").read_text()
    provenance = json.loads((reports / "data" / "provenance.json").read_text())
    text = b"".join(content for file, content in committed(reports).items() if is_text(file)).decode()
    assert "2.5" not in text
    assert not [name for name in ("date", "machine", "python", "command") if provenance[name] in text]
    assert str(studied[0]) not in text


def test_measured_seconds_are_shown_with_their_machine(studied: tuple[Path, str]) -> None:
    reports = studied[0] / "reports"
    assert (reports / "timed" / ".gitignore").read_text() == "*\n"  # of its own: no seconds reach a commit
    assert "8.125" in (reports / "timed" / "crossing_seconds.csv").read_text()
    assert not [file for file, content in committed(reports).items() if is_text(file) and b"8.125" in content]
    machine = json.loads((reports / "data" / "provenance.json").read_text())["machine"]
    assert "logical cores, BLAS threads: " in machine
    page, text = (html.unescape((reports / f"timings.{suffix}").read_text()) for suffix in ("html", "md"))
    for shown in (machine, "8.125", "Seconds against error", "Optimised compliance"):
        assert shown in page
        assert shown in text
    assert page.count("data:image/svg+xml") == 1
    assert "(timed/crossing_clock.svg)" in text


def test_benchmarks_run_only_when_asked_for(studied: tuple[Path, str], pytester: pytest.Pytester) -> None:
    reports = pytester.path / "reports"
    shutil.copytree(studied[0], pytester.path, dirs_exist_ok=True)
    assert "2 skipped" in studied[1]  # the other one skips itself
    assert "2 claims of 1 studies ran" in rerun(pytester, "--benchmark", "-m", "benchmark")
    measured = (reports / "benchmark.md").read_text()
    assert "5 claims of 2 studies ran" in rerun(pytester)  # and what it had recorded stays
    assert "finest" in {row["claim"] for row in claims(reports)}
    assert (reports / "benchmark.md").read_text() == measured
    assert "finest ratio | – | 6.75" in measured
    provenance = json.loads((reports / "data" / "provenance.json").read_text())
    assert f"Measured on {provenance['machine']}; {provenance['date'][:10]}" in measured
    assert "6.75" in (reports / "benchmark" / "ratios.csv").read_text()  # kept with the code
    assert not (reports / "benchmark" / ".gitignore").exists()
    assert "6.75" not in (reports / "timed" / "ratios.csv").read_text()


def test_times_of_another_version_are_left_out(studied: tuple[Path, str], pytester: pytest.Pytester) -> None:
    shutil.copytree(studied[0], pytester.path, dirs_exist_ok=True)
    (pytester.path / "reports" / "timed" / "sections.json").write_text('[{"study": "crossing", "machine": "old"}]')
    assert "2 claims of 1 studies ran" in rerun(pytester, "-k", "jump")
    assert "crossing.md" in (pytester.path / "reports" / "timings.md").read_text()


def test_a_damaged_benchmark_is_not_overwritten(
    studied: tuple[Path, str], pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    shutil.copytree(studied[0], pytester.path, dirs_exist_ok=True)
    store = pytester.path / "reports" / "benchmark" / "sections.json"
    store.parent.mkdir()
    store.write_text("<<<<<<< HEAD")
    with pytest.raises(ValueError, match="is not a store of this report: restore the committed one"):
        read_timed(store.parents[1])
    # at once, not after the studies
    refused = pytester.runpytest_subprocess(*OPTIONS, "-k", "jump")
    assert "restore the committed one" in refused.stderr.str()
    assert "passed" not in refused.stdout.str()
    assert store.read_text() == "<<<<<<< HEAD"


def test_an_interrupted_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = tmp_path / "index.md"
    replace(page, "whole")
    monkeypatch.setattr(os, "replace", lambda *paths: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        replace(page, "the next one")
    assert page.read_text() == "whole"


def test_where_the_time_goes(studied: tuple[Path, str]) -> None:
    """Every study with the seconds of all its tests: the progress of `test_jump` alone sleeps for 0.8 s."""
    text = (studied[0] / "reports" / "timings.md").read_text()
    wall, cpu = map(float, re.findall(r"\(crossing.md\) \| ([\d.]+) \| ([\d.]+) \|", text)[0])
    assert wall >= 0.8
    assert cpu < wall  # asleep
    assert "(other.md) |" in text


def test_quick_leaves_slow_tests_out(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_plain="import pytest\n@pytest.mark.slow\ndef test_slow(): pass\ndef test_fast(): pass")
    pytester.makeini("[pytest]\nmarkers = slow")
    assert "1 passed, 1 skipped" in rerun(pytester, "--quick")
    assert "2 passed" in rerun(pytester)


def test_pages_need_nothing_but_themselves(studied: tuple[Path, str]) -> None:
    pages = list((studied[0] / "reports").glob("*.html"))
    assert {page.stem for page in pages} == {"index", "claims", "timings", "benchmark", "crossing", "other"}
    for page in pages:
        text = page.read_text()
        assert not re.search(r"<(script [^>]*src|iframe|object|embed)|@import|url\(|fetch\(|XMLHttp", text)
        assert all(source.startswith("data:") for source in re.findall(r'(?:src|srcset)="([^"]*)"', text))
        assert re.findall(r'<link [^>]*href="([^"]*)"', text) == ["data:,"]
        assert "&lt;friends&gt;" in text
    assert 'alt="Design of the tent run"' in (studied[0] / "reports" / "crossing.html").read_text()


def test_a_second_run_writes_the_same_bytes(studied: tuple[Path, str], pytester: pytest.Pytester) -> None:
    first = committed(studied[0] / "reports")
    assert {"index.md", "figures/crossing_design.svg", "data/crossing_wide.csv", "data/other.json"} < first.keys()
    shutil.copytree(studied[0], pytester.path, dirs_exist_ok=True)
    assert "5 claims of 2 studies ran" in rerun(pytester)
    assert committed(pytester.path / "reports") == first


def test_a_partial_run_keeps_what_it_did_not_run(studied: tuple[Path, str], pytester: pytest.Pytester) -> None:
    folder, reports = pytester.path, pytester.path / "reports"
    shutil.copytree(studied[0], folder, dirs_exist_ok=True)
    first = committed(reports)
    assert "2 claims of 1 studies ran" in rerun(pytester, "-k", "jump")
    assert committed(reports) == first

    without_optimum = re.sub(r"def test_optimum.*?(?=def test_locked)", "", CROSSING, flags=re.DOTALL)
    write_study(folder, "crossing", without_optimum)
    shutil.rmtree(folder / "studies" / "other")
    (reports / "figures" / "own.svg").write_text("not the report's")
    assert "2 claims of 1 studies ran" in rerun(pytester, "-k", "jump")
    gone = {"other.md", "data/other.json", "figures/crossing_design.svg", "data/crossing_wide.csv"}
    gone |= {"figures/crossing_own.png", "figures/front_designs.svg"}
    assert committed(reports).keys() == first.keys() - gone | {"figures/own.svg"}
    assert not (reports / "other.html").exists()
    assert {row["claim"] for row in claims(reports)} == {"jump, tent | solid", "jump, GIMP | solid"}
    assert "speed-up" not in (reports / "timed" / "ratios.csv").read_text()
    assert not list((reports / "timed").glob("*_*.*"))


@pytest.mark.parametrize(
    ("folder", "page"),
    [
        ("validation/studies/crossing", "crossing"),
        ("validation/studies/crossing/l_bracket", "crossing_l_bracket"),
        ("studies/of/ours/studies/hole", "hole"),
        ("validation/studies", ""),
        ("tests/mpmtop", ""),
    ],
)
def test_a_page_is_named_after_its_folder(folder: str, page: str) -> None:
    assert plugin.study_of(Path("/home") / folder) == page


def test_a_study_without_a_folder_is_told_where_it_belongs(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_plain="def test_plain(report): pass")
    assert "move it to a folder of its own in validation/studies" in rerun(pytester)


def test_nothing_is_written_without_a_study(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_plain="def test_plain(): pass")
    assert "1 passed" in rerun(pytester)
    assert not (pytester.path / "reports").exists()


def test_progress_shows_on_a_terminal(studied: tuple[Path, str]) -> None:
    assert "\ntent: iteration 2, 0 s" in studied[1].replace("\r", "")


def test_progress_shows_in_a_log_of_processes_beside_each_other(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    write_study(pytester.path, "crossing", CROSSING)
    pytester.makeini("[pytest]\nmarkers = benchmark")
    done = pytester.runpytest_subprocess(*OPTIONS, "-n", "2", "-k", "jump")
    assert {"tent: iteration 2, 0 s", "GIMP: iteration 2, 0 s"} <= set(done.stderr.lines)


@pytest.mark.parametrize(
    ("observed", "expectation", "verdict", "stated"),
    [
        (1.02, {"expected": 1.0, "rtol": 0.03}, "agrees", 1.0),
        (-1.04, {"expected": -1.0, "rtol": 0.03}, "differs", -1.0),
        (3200, {"expected": 3200}, "agrees", 3200),
        (np.float64(0.0181), {"at_most": 0.018}, "differs", "<= 0.018"),
        (12.0, {"at_least": 10, "at_most": 20}, "agrees", ">= 10 and <= 20"),
        (np.bool_(True), {"expected": False}, "differs", False),
        ("tent", {"expected": "tent"}, "agrees", "tent"),
        (np.inf, {"at_most": 1.0}, "differs", "<= 1"),
        (np.nan, {}, "differs", ""),
        (2.0, {}, "not stated", ""),
    ],
)
def test_verdicts(observed: float, expectation: dict[str, float], verdict: str, stated: object) -> None:
    report = Report("study", "test", set())
    assert report.check("claim", observed, **expectation, source="source") == (verdict != "differs")
    assert (report.claims[0].verdict, report.claims[0].expected) == (verdict, stated or stated)
    json.dumps(report.claims[0].observed, allow_nan=False)


@pytest.mark.parametrize(
    "expectation",
    [{"rtol": 0.1}, {"expected": 0.0, "rtol": 0.1}, {"expected": True, "rtol": 0.1}, {"expected": 1.0, "at_most": 1.0}],
)
def test_meaningless_expectations_are_refused(expectation: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="'claim'"):
        Report("study", "test", set()).check("claim", 1.0, **expectation, source="source")


def test_names_are_files_of_their_own() -> None:
    taken: set[str] = set()
    frame = pd.DataFrame({"a": [1.23456789, None], "b": [np.int64(3), 4]}, index=pd.Index(["x", "y"], name="case"))
    report = Report("study", "test", taken)
    report.table("t", frame, "caption", digits=3)
    (table,) = report.blocks
    assert (table.columns, table.rows) == (["case", "a", "b"], [["x", 1.23, 3], ["y", None, 4]])  # type: ignore[union-attr]
    with pytest.raises(ValueError, match="already recorded"):
        Report("study", "other", taken).table("t", frame, "caption")
    with pytest.raises(ValueError, match="file name"):
        report.table("../t", frame, "caption")
    with pytest.raises(ValueError, match="rename"):
        Report("index", "test", taken)


def test_cells() -> None:
    assert [show(value) for value in (None, True, 3, 3.0, 1e-6, 2.5e20, "x")] == [
        "–",
        "yes",
        "3",
        "3",
        "10⁻⁶",
        "2.5·10²⁰",
        "x",
    ]
    assert [number(value) for value in (84.5735, 1204.0, 16200, 1234567.0, 0.01, 9.97171e-7, -0.0, np.inf)] == [
        *("84.6", "1200", "16,200", "1.23·10⁶", "0.01", "9.97·10⁻⁷", "0", "∞"),
    ]
    assert [per_cent(0.0366), per_cent(-0.5, 2, sign=True), per_cent(0.138, sign=True)] == [
        *("3.66\u00a0%", "-50\u00a0%", "+13.8\u00a0%"),
    ]
    assert cell("|u| over\n two lines") == r"\|u\| over two lines"


def test_points_are_drawn_small_and_without_seams() -> None:
    x = np.stack(np.meshgrid(np.arange(180) + 0.5, np.arange(90) + 0.5), axis=-1).reshape(-1, 2) / 6
    half_length = np.full_like(x, 1 / 12)
    with mpl.rc_context():
        mpl.style.use(STYLE)
        figure, ax = plt.subplots()
        drawn = draw_points(ax, x, half_length, np.ones(len(x)), vmin=0, vmax=2, label="stress")
        assert drawn.get_clim() == (0, 2)
        report = Report("study", "test", set())
        figure.canvas.draw()
        pixels = np.asarray(figure.canvas.buffer_rgba())  # type: ignore[attr-defined]
        left, bottom, right, top = ax.transData.transform([(1, 1), (29, 14)]).astype(int).ravel()
        inside = pixels[pixels.shape[0] - top : pixels.shape[0] - bottom, left:right].reshape(-1, 4)
        assert len(np.unique(inside, axis=0)) == 1
        draw_design(plt.figure().add_subplot(), x, half_length, np.random.default_rng(0).random(len(x)))
        report.figure("noise", plt.gcf(), "the least compressible design of the finest scene")
    assert len(report.files["study_noise.svg"]) < 200_000  # what a page of several figures can carry


MEASURE = """<!DOCTYPE html><title>not measured</title>
<iframe style="width:{width}px;height:800px;border:0" srcdoc="{page}"></iframe>
<script>
addEventListener("load", () => {{
  const page = document.querySelector("iframe").contentDocument, root = page.documentElement;
  for (const fold of page.querySelectorAll("details")) fold.open = true;
  const drawn = [...page.images].map(i => i.naturalWidth && Math.min(i.clientWidth, i.clientHeight));
  const cut = [...page.querySelectorAll(".scroll")].filter(t => t.scrollWidth > t.clientWidth + 1);
  const bare = [...page.querySelectorAll("input, select")].filter(i => !i.labels.length).length;
  const form = page.querySelector(".filters");
  let filtered = null;
  if (form) {{
    form.elements.state.value = "differs";
    form.dispatchEvent(new Event("input"));
    filtered = [...page.querySelectorAll("tbody.stand")].filter(row => row.offsetParent).map(row => row.dataset.kind);
    form.elements.text.value = "no such words";
    form.dispatchEvent(new Event("input"));
    filtered.push(form.querySelector("output").textContent);
  }}
  document.title = JSON.stringify({{shown: root.clientWidth, needed: root.scrollWidth, drawn: drawn,
    cut: cut.map(table => table.getAttribute("aria-label")), bare: bare, filtered: filtered,
    ground: getComputedStyle(page.body).backgroundColor}});
}});
</script>"""


@pytest.fixture(scope="module")
def browse(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., str]:
    """What a browser prints of a page, with options of its command line."""
    names = ("chromium", "chromium-browser", "google-chrome")
    browser = next((path for path in map(shutil.which, names) if path), None)
    if browser is None:
        pytest.skip(f"none of {', '.join(names)} is installed: the pages are not tried in a browser")
    flags = "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    flags += "--disable-component-update --disable-sync --window-size=1400,900 "
    flags += f"--user-data-dir={tmp_path_factory.mktemp('profile')}"

    def browsed(page: Path, *options: str) -> str:
        command = [browser, *flags.split(), *options, page.as_uri()]
        return subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout

    return browsed


def measured(browse: Callable[..., str], page: Path, folder: Path, width: int, *options: str) -> dict[str, Any]:
    """Of a page in a window of a width: widths shown and needed, sizes of pictures, tables that are cut, fields without
    a label, kinds of the claims that differ after filtering by that, and what filtering by other words says."""
    framed = folder / f"{page.stem}_{width}.html"
    framed.write_text(MEASURE.format(page=html.escape(page.read_text()), width=width))
    title = re.search(r"<title>(.*?)</title>", browse(framed, "--dump-dom", *options))
    assert title is not None
    found: dict[str, Any] = json.loads(html.unescape(title[1]))
    return found


@pytest.mark.parametrize(("name", "pictures"), [("index", 1), ("claims", 0), ("crossing", 2)])
@pytest.mark.parametrize("width", [390, 1300])
def test_pages_fit_phone_and_screen(
    studied: tuple[Path, str], browse: Callable[..., str], tmp_path: Path, name: str, pictures: int, width: int
) -> None:
    found = measured(browse, studied[0] / "reports" / f"{name}.html", tmp_path, width)
    assert found["shown"] <= width
    assert found["needed"] == found["shown"], f"{name} scrolls sideways"
    assert len(found["drawn"]) == pictures
    assert all(size > 50 for size in found["drawn"])  # px; a picture that failed to load measures 0 or an icon's 16
    assert not found["bare"]
    if width == 1300:
        assert not found["cut"]
    assert found["filtered"] == (["result", "0 of 4"] if name == "claims" else None)


def test_pages_print_and_turn_dark(studied: tuple[Path, str], browse: Callable[..., str], tmp_path: Path) -> None:
    page = studied[0] / "reports" / "crossing.html"
    browse(page, f"--print-to-pdf={tmp_path / 'page.pdf'}")
    pdf = (tmp_path / "page.pdf").read_bytes()
    assert pdf.startswith(b"%PDF")
    assert b"/Image" in pdf  # the figure's points
    grounds = {
        scheme: measured(browse, page, tmp_path, 1300, f"--blink-settings=preferredColorScheme={value}")["ground"]
        for scheme, value in (("dark", 0), ("light", 1))
    }
    assert grounds == {"dark": "rgb(20, 24, 30)", "light": "rgb(255, 255, 255)"}


def test_the_readme_says_what_the_report_found() -> None:
    """Its numbers are those of the committed stores: `make validate` writes both."""
    readme = (ROOT / "README.md").read_text("utf-8")
    assert with_findings(readme, ROOT / "reports") == readme


def test_every_difference_from_the_paper_has_a_reason_with_its_number() -> None:
    """In the committed stores: what most likely makes it, and what was computed for that."""
    differing = [
        (study.name, claim)
        for study in read(ROOT / "reports").values()
        for claim in study.claims
        if claim.of_paper and claim.verdict == "differs"
    ]
    bare = [(name, claim.claim) for name, claim in differing if not re.search(r"\d", claim.reason)]
    assert not bare


def test_claims_of_a_section_have_names_of_their_own() -> None:
    report = Report("study", "test", set())
    report.check("jump", 1.0, source="ours")
    with pytest.raises(ValueError, match="two claims"):
        report.check("jump", 2.0, source="ours")


def test_rows_of_sections_make_one_table_and_sentences_take_measured_values() -> None:
    reports = [Report("study", f"test_{k}", set()) for k in range(2)]
    for k, report in enumerate(reports):
        report.opening.table(f"part_{k}", pd.DataFrame({"error": [0.5 + k]}), "caption", part_of="whole")
    reports[0].check("error of | it", 0.25, source="ours")
    sections = [Section(r.test, "", "", "", r.claims, r.blocks, opening=r.opening.blocks) for r in reports]
    found = ["Takes {seconds, all} s, error {error of | it}.", "Takes {never measured} s."]
    study = Study("study", "", "", sections, found=found)
    (table,) = study.opening
    assert isinstance(table, Table)
    assert (table.file, table.rows) == ("study_whole", [[0.5], [1.5]])
    assert study.filled("found", {"seconds, all": 5.021}) == ["Takes 5.02 s, error 0.25."]
    assert study.filled("found", {}) == []


@pytest.mark.parametrize(
    ("ratio", "words"), [(0.0366, "3.7% higher"), (-0.002, "0.2% lower"), (-0.0001, "unchanged"), (0.0, "unchanged")]
)
def test_changes_in_words(ratio: float, words: str) -> None:
    assert changed(ratio) == words


def test_designs_beside_each_other_have_as_many_digits() -> None:
    assert [digits3(value) for value in (85.05, 90.0, 1.2, 7.494, 146.0, 1204.0, 0.5, 1.5e-9)] == [
        *("85.0", "90.0", "1.20", "7.49", "146", "1200", "0.500", "1.5·10⁻⁹"),
    ]


def test_findings_come_from_the_stores(studied: tuple[Path, str]) -> None:
    text = with_findings(f"before\n{BEGIN}old\n{END}\nafter\n", studied[0] / "reports")
    assert text.startswith(f"before\n{BEGIN}![Designs")
    assert text.endswith(f"{END}\nafter\n")
    assert "- **With crossing.** With tent the tip jumps by 13.7%. With GIMP the tip jumps by 2.0%.\n" in text
    assert "old" not in text
    with pytest.raises(ValueError, match="put it where the findings belong"):
        with_findings("no marks", studied[0] / "reports")


def test_what_moved_between_two_reports(
    studied: tuple[Path, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before, after, page = studied[0] / "reports", tmp_path / "after", tmp_path / "diff.html"
    shutil.copytree(before, after)
    assert main(["diff", str(before), str(after), "-o", str(page)]) == 0
    assert "Nothing moved." in page.read_text()
    store = after / "data" / "crossing.json"
    stored = json.loads(store.read_text())
    jump = stored["sections"][0]["claims"][0]
    jump |= {"observed": 0.2, "verdict": "differs"}
    store.write_text(json.dumps(stored))
    (after / "figures" / "crossing_design.svg").write_text("<svg/>")
    assert main(["diff", str(before), str(after), "-o", str(page)]) == 1
    assert "moved: 1 claims (by 0.46 of themselves at most), 1 verdicts, 0 cells, 0 locked values, 1 figures" in (
        capsys.readouterr().out
    )
    text = html.unescape(page.read_text())
    assert re.search(r"jump, tent \| solid</td>.*>0.137<.*>0.2<.*>\+46\u00a0%<", text)
    assert text.count("crossing_design.svg, ") == 4  # captions and alternative texts
    with pytest.raises(SystemExit):
        main(["diff", str(before), str(tmp_path / "nothing")])
    assert "no report in" in capsys.readouterr().err


CRASHING = '''
"""A study whose test ends its process"""
import os

def test_crash(report):
    """Crash"""
    if "CRASH" in os.environ:
        os._exit(3)
    assert report.check("claim", 1, 1, source="ours")
'''


def test_a_crash_is_seen_in_the_report(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    """What an earlier run recorded must not stand there as if it had been confirmed."""
    write_study(pytester.path, "crashing", CRASHING)
    rerun(pytester)
    monkeypatch.setenv("CRASH", "1")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    pytester.runpytest_subprocess(*OPTIONS, "-n", "1", "--max-worker-restart=0")
    assert "a crash of the process" in (pytester.path / "reports" / "crashing.md").read_text()
