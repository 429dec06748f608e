"""Scene files that do not make a scene end in one sentence."""

from pathlib import Path

import pytest

from mpmtop.comparison.command import MOVED, STOPPED, WRONG, main, separated
from mpmtop.comparison.scene_file import SceneFileError, read_scene
from tests.mpmtop.comparison.scenes import SMALL

BAD = {
    "syntax": (SMALL + "def (:\n", "line 10: not Python"),
    "none": ("x = 1\n", "makes no Scene"),
    "two": (SMALL + "other = Scene('other', body, Design(0.5, 1.5))\n", r"makes 2 scenes \(scene, other\)"),
    "impossible": (SMALL.replace("0.4", "1.4"), "line 6: InvalidScene: volume fraction 1.4"),
    "raises": (SMALL + "1 / 0\n", "line 10: ZeroDivisionError"),
    "import": ("import nothing_of_that_name\n", "line 1: ModuleNotFoundError"),
    "exits": (SMALL + "raise SystemExit('enough')\n", "line 10: SystemExit: enough"),
}


@pytest.mark.parametrize("bad", BAD)
def test_a_bad_file_ends_in_one_sentence(bad: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, said = BAD[bad]
    path = tmp_path / "my_scene.py"
    path.write_text(source)
    with pytest.raises(SceneFileError, match=said):
        read_scene(path)
    assert main(["compare", str(path), "--out", str(tmp_path / "out")]) == WRONG
    printed = capsys.readouterr()
    assert printed.out == "" and printed.err.count("\n") == 1 and "Traceback" not in printed.err
    assert not (tmp_path / "out").exists()


def test_a_missing_file_is_told_with_what_writes_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", str(tmp_path / "nothing.py")]) == WRONG
    assert "there is no such file; `python -m mpmtop new" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("source", "options", "said"),
    [
        (SMALL, ["--hours", "1e-9"], "give a larger h or fewer iterations"),
        (SMALL, ["--h", "0.001"], "the largest problem measured has 2,000,000"),
        (SMALL, ["--h", "0.3"], "does not divide the domain's sides"),
        (SMALL + "h = (0.3, 0.2, 0.1)\n", [], "h = (0.3, 0.2, 0.1): give one positive number, or two"),
        (SMALL + "h = (0.5, 4 / 27)\n", ["--hours", "1e-9"], "give a larger h or fewer iterations"),
        (SMALL, ["--h", "0.5,0.1481", "--hours", "1e-9"], "give a larger h or fewer iterations"),
        (SMALL.replace("(-1.0, 0.0), (0.0, 4.0)", "(-9.0, 0.0), (-8.0, 4.0)"), [], "holds no node"),
        (SMALL + "methods = ('fem', 'spectral')\n", [], "method 'spectral'"),
    ],
)
def test_what_cannot_be_compared_ends_in_a_sentence(
    source: str, options: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A scene that would run for hours among them: it is told how long, before it runs."""
    path = tmp_path / "my_scene.py"
    path.write_text(source)
    assert main(["compare", str(path), "--out", str(tmp_path / "out"), "--jobs", "1", *options]) == WRONG
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("mpmtop: ") and said in last


def test_one_scene_under_two_names_is_one(tmp_path: Path) -> None:
    path = tmp_path / "my_scene.py"
    path.write_text(SMALL + "again = scene\n")
    found = read_scene(path)
    assert found.scene.name == "small beam" and found.settings == {
        "h": 1.0,
        "iterations": 40,
        "methods": ("fem", "mpm", "gimp"),
    }


def test_a_file_imports_what_lies_beside_it(tmp_path: Path) -> None:
    (tmp_path / "beside_it_lies.py").write_text("radius = 1.25\n")
    path = tmp_path / "my_scene.py"
    path.write_text("from beside_it_lies import radius\n" + SMALL.replace("0.4, 1.5", "0.4, radius"))
    assert read_scene(path).scene.design.filter_radius == 1.25


def test_names_are_separated_but_not_in_brackets() -> None:
    assert separated("none,periodic(4, 0.26) wave(8)") == ["none", "periodic(4, 0.26)", "wave(8)"]


def test_a_wrong_command_ends_with_two(capsys: pytest.CaptureFixture[str]) -> None:
    for argv in (["compare"], ["dance"], ["compare", "x.py", "--jobs", "0"], ["compare", "x.py", "--h", "1,2,3"]):
        with pytest.raises(SystemExit) as stopped:
            main(argv)
        assert stopped.value.code == 2
    assert len({0, WRONG, 2, MOVED, STOPPED}) == 5
