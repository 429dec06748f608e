"""The examples of the documentation, each compared at small size."""

import re
from pathlib import Path

import pytest

from mpmtop.comparison.asked import ask
from mpmtop.comparison.command import DONE, EXAMPLES, main
from mpmtop.comparison.compare import write
from mpmtop.comparison.entries import Comparison
from mpmtop.comparison.scene_file import read_scene

FOLDER = Path(__file__).parents[3] / "mpmtop" / "examples"
SMALL = {"bridge": 0.4, "bracket": 1.0, "flexible_beam": 2.0, "inverter": 2.0, "scanned_hook": 1.0}
"""Cells twice as wide."""


def compared(name: str, folder: Path) -> Comparison:
    """Three iterations of a method of each kind on coarse cells: whether it runs from its file to its page."""
    scene, settings = read_scene(FOLDER / f"{name}.py")
    few = settings | {"h": SMALL[name], "iterations": 3, "methods": ("fem", "gimp")}
    return write(ask(scene, **few), folder, "a test", jobs=1, hours=1.0, live=False).found


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_runs_to_its_page(name: str, tmp_path: Path) -> None:
    found = compared(name, tmp_path)
    assert not any(entry.refusal for entry in found.entries)
    assert all(entry.run is not None and entry.run.iterations == 3 for entry in found.entries)
    page = (tmp_path / "index.html").read_text()
    assert f"<h1>{found.asked.scene.name}</h1>" in page


def test_every_example_is_known_written_and_told(tmp_path: Path) -> None:
    """By `new --like`, with the files that it reads; and with its picture in the documentation."""
    assert {path.stem for path in FOLDER.glob("*.py")} - {"__init__"} == set(EXAMPLES)
    told = (FOLDER / "README.md").read_text()
    for name in EXAMPLES:
        assert main(["new", str(tmp_path / f"{name}.py"), "--like", name]) == DONE
        assert read_scene(tmp_path / f"{name}.py").scene.name
        assert re.search(rf"^## .*`{name}\.py`", told, re.MULTILINE), name
        assert f"({name}.png)" in told and (FOLDER / f"{name}.png").stat().st_size < 200_000
