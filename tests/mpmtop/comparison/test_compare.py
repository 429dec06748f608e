"""A comparison from end to end on a small beam: run, killed, taken again, locked, told."""

import csv
import os
import re
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mpmtop
from mpmtop.comparison.asked import ask
from mpmtop.comparison.command import DONE, MOVED, WRONG, main
from mpmtop.comparison.compare import compare
from mpmtop.comparison.one import optimise
from mpmtop.criteria import AtMost, Displacement
from mpmtop.optimizers import checkpoint
from mpmtop.region import Rectangle
from reference_fem.reanalyse import reanalyse
from tests.mpmtop.comparison.scenes import BEAM, SMALL

ROOT = Path(__file__).parents[3]


def started(folder: Path, out: str, *options: str) -> subprocess.Popen[bytes]:
    """The comparison in a process of its own."""
    command = [sys.executable, "-m", "mpmtop", "compare", "beam.py", "--out", out, *options]
    nowhere = subprocess.DEVNULL
    return subprocess.Popen(
        command, cwd=folder, env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=nowhere, stderr=nowhere
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene's file, and its comparison beside it."""
    folder = tmp_path_factory.mktemp("compared")
    (folder / "beam.py").write_text(SMALL)
    with started(folder, "out", "--jobs", "1") as run:
        assert run.wait(120) == DONE
    return folder


def numbers(folder: Path) -> dict[tuple[str, str], dict[str, str]]:
    with (folder / "files" / "numbers.csv").open() as file:
        return {(row["method"], row["crossing"]): row for row in csv.DictReader(file)}


def test_every_run_is_told_with_its_truth(folder: Path) -> None:
    """The truth is what `reanalyse` finds of the densities that the files hold."""
    told = numbers(folder / "out")
    crossed = "periodic(4, 0.26)"
    assert list(told) == [
        *(("fem", "none"), ("mpm", "none"), ("gimp", "none")),
        *(("mpm", crossed), ("gimp", crossed)),
    ]
    assert told["gimp", "none"]["same_as"] == "mpm" and told["gimp", crossed]["same_as"] == ""
    for name, row in (("fem", told["fem", "none"]), ("gimp-periodic-4-0.26", told["gimp", crossed])):
        with np.load(folder / "out" / "files" / f"{name}.npz") as design:
            true = reanalyse(BEAM, design["x"], design["half_length"], design["rho"], split=1).compliance
        assert float(row["true"]) == pytest.approx(true, rel=1e-9)  # the same equations


def test_the_files_that_the_page_names_are_there(folder: Path) -> None:
    page = (folder / "out" / "index.html").read_text()
    named = re.findall(r'href="(files/[^"]+)"', page)
    assert len(named) == 1 + 4 * 4  # the series, and of each run picture, history, densities, fields
    assert all((folder / "out" / name).stat().st_size > 0 for name in named)
    assert not re.search(r'(src|href)="(https?:)?//', page) and "url(" not in page.split("</style>")[0]
    assert len(page.encode()) < 3e6


def test_a_second_run_takes_what_it_has(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Here by the function, in this process."""
    before = (folder / "out" / "index.html").read_bytes()
    assert main(["compare", str(folder / "beam.py"), "--out", str(folder / "out"), "--jobs", "1"]) == DONE
    assert "4 of 4 runs are taken" in capsys.readouterr().err
    assert (folder / "out" / "index.html").read_bytes() == before


@pytest.mark.slow
def test_processes_beside_each_other_give_the_same_page(folder: Path) -> None:
    with started(folder, "two", "--jobs", "2") as run:
        assert run.wait(120) == DONE
    assert (folder / "two" / "index.html").read_bytes() == (folder / "out" / "index.html").read_bytes()


@pytest.mark.slow
def test_killed_and_started_again_it_gives_the_same_page(folder: Path) -> None:
    """Killed as soon as a checkpoint of each of the first runs is there, and when a run is done."""
    for sought in ("fem*.checkpoint.npz", "mpm-*.checkpoint.npz", "gimp*.npz"):
        with started(folder, "killed", "--jobs", "1") as run:
            end = time.monotonic() + 100
            while run.poll() is None and not list((folder / "killed").rglob(sought)) and time.monotonic() < end:
                time.sleep(0.002)
            assert list((folder / "killed").rglob(sought))
            run.kill()
    with started(folder, "killed", "--jobs", "1") as run:
        assert run.wait(120) == DONE
    assert (folder / "killed" / "index.html").read_bytes() == (folder / "out" / "index.html").read_bytes()
    assert not list((folder / "killed").rglob("*checkpoint*"))


def test_a_damaged_checkpoint_is_left_aside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And the run goes as if there had been none."""
    kept: list[Path] = []
    written = checkpoint.save_checkpoint

    def keep(path: Path, *content: object) -> None:
        kept.append(path)
        written(path, *content)  # type: ignore[arg-type]

    monkeypatch.setattr("mpmtop.optimizers.loop.save_checkpoint", keep)
    first = compare(BEAM, h=1.0, iterations=6, methods=("mpm",), crossing=("none",), out=tmp_path / "first")
    path = tmp_path / "second" / kept[0].relative_to(tmp_path / "first")
    path.parent.mkdir(parents=True)
    path.write_bytes(b"half a file")
    second = compare(BEAM, h=1.0, iterations=6, methods=("mpm",), crossing=("none",), out=tmp_path / "second")
    assert first.page.read_bytes() == second.page.read_bytes()


def test_a_lock_says_what_moved(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = folder / "beam.py"
    command = ["compare", str(scene), "--out", str(folder / "locked"), "--jobs", "1"]
    command += ["--methods", "fem", "--crossing", "none", "--lock"]
    lock = folder / "beam.lock.csv"
    assert main(command) == DONE and "values kept" in capsys.readouterr().err
    assert main(command) == DONE and "nothing moved" in capsys.readouterr().err
    kept = lock.read_text()
    own = next(csv.DictReader(kept.splitlines()))["own"]
    lock.write_text(kept.replace(own, repr(1.01 * float(own))) + "bspline3,none,1.0,1.0,1.0\n")
    assert main(command) == MOVED
    said = capsys.readouterr().err
    assert "FEM: own" in said and "(-0.99%)" in said and "cubic B-splines: was kept and is not among these" in said
    assert main(command[:-1]) == DONE and "FEM: own" in capsys.readouterr().err  # told, too, without being asked
    lock.write_text("no values\n")
    assert main(command) == WRONG
    assert main([*command[:-1], "--relock"]) == DONE and lock.read_text() == kept


def test_one_method_is_optimised_and_goes_on(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["optimize", str(folder / "beam.py"), "--method", "mpm", "--out", str(folder / "one"), "--every", "5"]
    assert main(command) == DONE
    told = numbers(folder / "out")["mpm", "none"]
    said = capsys.readouterr().out
    assert f"MPM: {float(told['own']):.6g}"[:9] in said
    for name in (
        "design.vtu",
        "design.png",
        "design.npz",
        "history.csv",
        "run.pvd",
        "run/00010.vtu",
        "frames/00005.png",
    ):
        assert (folder / "one" / name).stat().st_size > 0
    before = (folder / "one" / "history.csv").read_bytes()
    assert main(command) == DONE and (folder / "one" / "history.csv").read_bytes() == before


def test_a_limit_met_in_void_is_told_on_the_page_and_by_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A place in passive void, by either solver."""
    design = replace(BEAM.design, passive_void=Rectangle((3, 3), (5, 4)))
    limited = replace(BEAM, design=design, constraints=(AtMost(Displacement((4.0, 4.0), (0.0, -1.0)), 1e3),))
    asked: dict[str, Any] = {"h": 1.0, "iterations": 2, "crossing": ("none",)}
    page = compare(limited, methods=("fem", "mpm"), out=tmp_path, **asked).page.read_text()
    for method in ("FEM", "MPM"):
        assert re.search(rf"{method}: the displacement [\d.e+]+ at \(4.0, 4.0\) is that of void", page)
    optimise(ask(limited, methods=("mpm",), **asked), tmp_path / "one", every=None, live=False)
    assert "warning, the displacement" in capsys.readouterr().err


def test_new_writes_a_scene_that_reads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from mpmtop.comparison.scene_file import read_scene

    path = tmp_path / "mine.py"
    assert main(["new", str(path)]) == DONE
    assert "mpmtop compare mine.py" in path.read_text()
    assert read_scene(path).scene.body.loads
    assert main(["new", str(path)]) == WRONG
    assert "is there already" in capsys.readouterr().err


def test_the_face_has_it() -> None:
    assert mpmtop.compare is compare
