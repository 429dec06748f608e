"""A page of several test modules: how it is headed, and the order of its sections."""

import json
from pathlib import Path

import pytest

from tests.harness.studies import OPTIONS, ROOT, claims, rerun
from validation.harness.heading import Heading, heading_of

pytest_plugins = ["pytester"]

MAIN = '''
"""A long study.

Its introduction.
"""

ASKED = "Does it hold?"
FOUND = ("Takes {seconds} s.",)
THEN = ("test_second",)


def test_first(report, shared):
    report.check("first", shared, source="ours")
'''
FIXTURES = """
import pytest


@pytest.fixture(scope="package")
def shared():
    return 1.5
"""
COUNTED = """import os

    with open("computed", "a") as computed:
        computed.write(os.environ["MALLOC_TRIM_THRESHOLD_"] + ";")
    return 1.5"""


def section(name: str) -> str:
    """A module with one section."""
    return f'def test_{name}(report, shared):\n    report.check("{name}", shared, source="ours")\n'


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """Folder of a study of four modules."""
    return write(tmp_path)


def write(root: Path) -> Path:
    folder = root / "studies" / "long"
    folder.mkdir(parents=True)
    (folder / "test_long.py").write_text(MAIN)
    (folder / "conftest.py").write_text(FIXTURES)
    for name in ("second", "by_name", "and_by_name"):
        (folder / f"test_{name}.py").write_text(section(name))
    return folder


def test_sections_come_in_the_order_of_the_page(study: Path) -> None:
    """Those of the module that heads it, those it names, the rest by name."""
    tests = ("test_first", "test_second", "test_and_by_name", "test_by_name")
    docstring = "A long study.\n\nIts introduction."
    assert heading_of(study) == Heading(docstring, "Does it hold?", ("Takes {seconds} s.",), (), tests)


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("test_long.py", None, "no test_long.py in"),
        ("test_long.py", MAIN.replace("test_second", "test_third"), "names 'test_third': no such module"),
        ("test_long.py", MAIN.replace('"Does it hold?"', '"Does it" + str(1)'), "ASKED of .* is computed"),
        ("test_second.py", section("first"), "two sections in .* are called 'test_first'"),
    ],
)
def test_pages_that_cannot_be_put_together(study: Path, file: str, text: str | None, message: str) -> None:
    (study / file).unlink()
    if text is not None:
        (study / file).write_text(text)
    with pytest.raises(ValueError, match=message):
        heading_of(study)


def test_a_run_of_one_module_keeps_the_page(pytester: pytest.Pytester) -> None:
    """Its heading and the sections of the other modules, in their order."""
    folder = write(pytester.path)
    store = pytester.path / "reports" / "data" / "long.json"
    assert "4 claims of 1 studies ran" in rerun(pytester)
    whole = store.read_text()
    assert json.loads(whole)["title"] == "A long study"
    assert "1 claims of 1 studies ran" in rerun(pytester, "studies/long/test_by_name.py")
    assert store.read_text() == whole
    assert [row["claim"] for row in claims(pytester.path / "reports")] == ["first", "second", "and_by_name", "by_name"]
    (folder / "test_second.py").write_text(section("first"))
    assert "two sections in" in rerun(pytester, "studies/long/test_by_name.py")


def test_a_study_runs_in_one_process(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    """What its sections share is computed once, however many processes of pytest-xdist there are."""
    folder = write(pytester.path)
    (folder / "conftest.py").write_text(FIXTURES.replace("return 1.5", COUNTED))
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.delenv("MALLOC_TRIM_THRESHOLD_", raising=False)
    assert pytester.runpytest_subprocess(*OPTIONS, "-n", "2").ret == 0
    assert (pytester.path / "computed").read_text() == f"{2**32};"  # its processes keep freed memory
    assert len(claims(pytester.path / "reports")) == 4
