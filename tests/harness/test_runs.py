"""Runs of pytest and the stores: what a run of a part keeps, skips, refuses and prints."""

import gc
import json
import os
import re
import shlex
import shutil
import subprocess
from itertools import chain
from pathlib import Path

import pytest

from tests.harness.studies import CROSSING, OPTIONS, ROOT, claims, committed, rerun, write_study
from validation.contents import CONTENTS
from validation.harness import plugin
from validation.harness.pages import replace
from validation.harness.timed import read_timed

pytest_plugins = ["pytester"]


def test_a_lock_misses_no_column(studied: tuple[Path, str]) -> None:
    assert re.search(r"test_locked - AssertionError: other numbers than test_locked.csv holds", studied[1])


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


def test_quick_leaves_slow_tests_out(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_plain="import pytest\n@pytest.mark.slow\ndef test_slow(): pass\ndef test_fast(): pass")
    pytester.makeini("[pytest]\nmarkers = slow")
    assert "1 passed, 1 skipped" in rerun(pytester, "--quick")
    assert "2 passed" in rerun(pytester)


def test_make_paper_runs_the_pages_of_the_paper(pytester: pytest.Pytester) -> None:
    recipe = subprocess.run(["make", "-n", "paper"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    command = next(shlex.split(line) for line in recipe.splitlines() if "pytest validation" in line)
    every = {*chain.from_iterable(CONTENTS.groups.values())}
    for name in every:
        write_study(pytester.path, name, "def test_it(): pass")
    collected = rerun(pytester, *command[command.index("--group") :], "--collect-only")
    ran = set(re.findall(r"studies/(\w+)/test_", collected))
    assert ran == set(CONTENTS.groups["The paper"])
    # and these are what the paper's figures are reproduced by: every page that is named after some of them
    titles = {page.stem: page.read_text().splitlines()[0] for page in (ROOT / "reports").glob("*.md")}
    assert {name for name, title in titles.items() if "(Figs. " in title} == ran - {"choices"}


def test_studies_that_start_first_are_there() -> None:
    assert {*plugin.LONGEST} < {*chain.from_iterable(CONTENTS.groups.values())}


def test_a_group_that_there_is_not_is_refused(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_plain="def test_fast(): pass")
    refused = pytester.runpytest_inprocess(*OPTIONS, "--group", "Robustnes")
    assert "'The paper', 'Beyond the paper', 'Cost', 'Robustness'" in refused.stderr.str()


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


def test_the_collector_leaves_alone_what_is_loaded() -> None:
    try:
        plugin.pytest_collection_finish()
        assert not any(found is vars(plugin) for found in gc.get_objects())
    finally:
        gc.unfreeze()
    assert any(found is vars(plugin) for found in gc.get_objects())


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
