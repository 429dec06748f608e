"""Runs that studies share: made once in a session, never taken from another one."""

import importlib
import os
import sys
from pathlib import Path

import pytest

from tests.harness.studies import OPTIONS, ROOT, rerun
from validation.harness.shared import FOLDER

pytest_plugins = ["pytester"]

COSTLY = """
from pathlib import Path
from validation.harness.shared import shared

@shared
def costly(n, factor=2):
    with Path("computed").open("a") as computed:
        computed.write("x")
    return factor * n
"""
STUDY = """
import os
from pathlib import Path
from costly import costly

def test_twice(request):
    assert costly(3) == 6 and costly(3) == 6
    folders = Path("folders")
    folders.mkdir(exist_ok=True)
    worker = getattr(request.config, "workerinput", {}).get("workerid", "alone")
    (folders / worker).write_text(os.environ["MPMTOP_SHARED"])
"""


@pytest.fixture
def elsewhere(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that a user's shell names, beside a study of one costly function."""
    stale = pytester.mkdir("stale")
    monkeypatch.setenv(FOLDER, str(stale))
    monkeypatch.setenv("PYTHONPATH", f"{ROOT}{os.pathsep}{pytester.path}")
    monkeypatch.syspath_prepend(pytester.path)
    pytester.makepyfile(costly=COSTLY)
    return stale


def used(folder: Path) -> dict[str, Path]:
    """The folder of shared runs that each process had."""
    return {file.name: Path(file.read_text()) for file in (folder / "folders").iterdir()}


def test_a_session_makes_its_own_whatever_the_shell_has_set(pytester: pytest.Pytester, elsewhere: Path) -> None:
    """Once each, also in a run within this process; afterwards the folder is gone and the variable as it was."""
    pytester.makepyfile(test_study=STUDY)
    for times in (1, 2):
        assert "1 passed" in rerun(pytester)
        assert (pytester.path / "computed").read_text() == times * "x"
        assert not used(pytester.path)["alone"].exists()
    assert os.environ[FOLDER] == str(elsewhere) and not list(elsewhere.iterdir())


def test_workers_take_that_of_their_session(pytester: pytest.Pytester, elsewhere: Path) -> None:
    for name in ("one", "other"):
        folder = pytester.mkdir(name)
        (folder / f"test_{name}.py").write_text(STUDY)
    pytester.runpytest_subprocess(*OPTIONS, "-n", "2").assert_outcomes(passed=2)
    found = used(pytester.path)
    assert found.keys() == {"gw0", "gw1"} and len({*found.values(), elsewhere}) == 2
    assert not found["gw0"].exists() and not list(elsewhere.iterdir())


def test_another_source_or_argument_is_another_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path / "runs"))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    source, computed = tmp_path / "costly_here.py", tmp_path / "computed"
    source.write_text(COSTLY)
    module = importlib.import_module("costly_here")
    monkeypatch.delitem(sys.modules, "costly_here")
    assert [module.costly(3), module.costly(3), module.costly(n=3, factor=2)] == [6, 6, 6]
    assert computed.read_text() == "x"
    assert [module.costly(4), module.costly(3, 5), module.costly(3)] == [8, 15, 6]
    assert computed.read_text() == "xxx"
    source.write_text(COSTLY.replace("factor * n", "factor * n + 1"))
    importlib.invalidate_caches()
    assert importlib.import_module("costly_here").costly(3) == 7
    assert computed.read_text() == "xxxx"
