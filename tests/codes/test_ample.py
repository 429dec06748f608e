"""AMPLE driven live, where a copy of it and Octave are: the environment variable AMPLE names its folder."""

import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.spatial import KDTree

from mpmtop.arrays import Array
from mpmtop.body import Body, Material, Support
from mpmtop.grid import Grid
from mpmtop.points import MaterialPoints, seed
from mpmtop.region import HalfPlane, Rectangle
from mpmtop.shape_functions import ShapeFunction, gimp, tent
from validation.codes import cases
from validation.codes.adapter import NoAdapter
from validation.codes.named import code
from validation.methods.points import PointMethod
from validation.methods.protocol import Case

CASES: dict[str, Case] = {
    "uneven points under weight": cases.under_weight("uneven", cases.uneven((12, 6))),
    "prescribed displacements": cases.patch("patch"),
    "a small cut": cases.cantilever("cut", cases.cantilever("seeded").points.moved((0.0, 1e-3))),
}
DATA = Path(__file__).parents[2] / "validation" / "data"
KINDS = {"ample": "mpm", "ample-gimp": "gimp"}


def live(kind: str) -> Any:
    """AMPLE in the folder that the environment names."""
    folder = os.environ.get("AMPLE")
    if not folder or shutil.which("octave-cli") is None:
        pytest.skip("AMPLE is the user's copy: set AMPLE to its folder, and install octave-cli")
    return code(f"{kind}:{folder}", 900.0)


def cut(cells: tuple[int, int], shift: float) -> Case:
    """The body of `data/ample`, moved along x off its clamp, under a unit force on its last column of points."""
    seeded = seed(Rectangle((0.0, 0.0), cells), (0.5, 0.5))
    last = seeded.x[:, 0] > seeded.x[:, 0].max() - 1e-9
    domain = Rectangle((shift, 0.0), (cells[0] + shift, cells[1]))
    body = Body(domain, (Support(HalfPlane((0.0, 0.0), (1.0, 0.0))),), (), Material(1e6, 0.3))
    grid = Grid((0.0, 0.0), (1.0, 1.0), (cells[0] + 2, cells[1]))
    force = np.outer(last / last.sum(), [0.0, -1.0])
    moduli = np.full(len(last), 1e6)
    return Case(
        f"body of {cells[0]} x {cells[1]} cells, cut by {shift:g}", body, seeded.moved((shift, 0)), grid, moduli, force
    )


def beam() -> Case:
    """The beam of `data/large_deformation`, its four first steps of six, points along y first."""
    points = seed(Rectangle((0.0, 9.0), (10.0, 10.0)), (0.125, 0.125))
    order = np.lexsort(points.x.T[::-1])
    points = MaterialPoints(points.x[order], points.volume[order], points.half_length[order])
    loaded = (points.x[:, 0] > 9.9) & (np.abs(points.x[:, 1] - 9.5) < 0.1)
    held = (
        Support(Rectangle((0.0, -np.inf), (0.0, np.inf)), (True, False)),
        Support(Rectangle((0.0, 9.5), (0.0, 9.5)), (False, True)),
    )
    body = Body(Rectangle((0.0, 9.0), (10.0, 10.0)), held, (), Material(12e6, 0.2))
    grid = Grid((0.0, 0.0), (0.5, 0.5), (22, 20))
    return Case("AMPLE's beam", body, points, grid, np.full(640, 12e6), np.outer(loaded / 2, [0.0, -30e3 * 4 / 6]))


def off(found: Array, right: Array) -> float:
    """Largest difference by the largest right value."""
    return float(np.abs(found - right).max() / np.abs(right).max())


@pytest.mark.parametrize("kind", KINDS)
def test_load_steps_are_those_kept(kind: str) -> None:
    """Every eighth point after steps 1 to 4 of 6, positions and stresses, to 1e-10 of the largest."""
    kept = pd.read_csv(DATA / "large_deformation" / f"ample_{KINDS[kind].replace('mpm', 'tent')}.csv")
    found = live(kind).steps(beam(), 4)
    for step, (x, stress) in enumerate(found, 1):
        right = kept[kept.step == step]
        at = right.point.to_numpy() - 1
        assert len(at) == 80
        assert off(x[at], right[["x", "y"]].to_numpy()) < 1e-10
        assert off(stress[at], right[["sxx", "syy", "sxy"]].to_numpy()) < 1e-10


@pytest.mark.parametrize("shift", [0.0, 0.3])
@pytest.mark.parametrize("kind", KINDS)
def test_a_crossed_body_is_that_kept(kind: str, shift: float) -> None:
    """3,200 points seeded, and moved by 0.3 cells over their grid lines: the points kept, to 1e-9 of the largest."""
    stem = f"cantilever40x20_{KINDS[kind]}_s{round(100 * shift):03d}"
    kept = pd.read_csv(DATA / "ample" / f"{stem}_points.csv")
    case = cut((40, 20), shift)
    answer = live(kind).analyse(case)
    at = KDTree(case.points.x).query(kept[["x", "y"]].to_numpy())[1]
    assert off(answer.u[at], kept[["ux_lin", "uy_lin"]].to_numpy()) < 1e-9
    assert off(answer.stress[at], kept[["sxx_lin", "syy_lin", "sxy_lin"]].to_numpy()) < 1e-8


def test_small_cuts_are_those_kept() -> None:
    """GIMP's compliance at cuts of 1e-1 to 1e-4, to 1e-9: where the cut is less, condition numbers are above 1e10."""
    code = live("ample-gimp")
    for shift, right in pd.read_csv(DATA / "ample" / "smallcut_gimp20x10.csv").to_numpy()[:4]:
        case = cut((20, 10), shift)
        assert case.forces is not None
        found = float(np.sum(case.forces * code.analyse(case).u))
        assert abs(found / right - 1) < 1e-9


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize(("kind", "function"), [("ample", tent), ("ample-gimp", gimp)])
def test_ample_s_answers_are_ours(kind: str, function: ShapeFunction, name: str) -> None:
    """Its routines as they are, in small strain: displacements to rounding, stress to what finite strain leaves."""
    case = CASES[name]
    ours, theirs = PointMethod("ours", function).analyse(case), live(kind).analyse(case)
    np.testing.assert_allclose(theirs.u, ours.u, atol=1e-9 * np.abs(ours.u).max())
    assert theirs.stress is not None and ours.stress is not None
    np.testing.assert_allclose(theirs.stress, ours.stress, atol=1e-8 * np.abs(ours.stress).max())


def test_a_folder_without_ample_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: "/usr/bin/octave-cli")
    with pytest.raises(NoAdapter, match=r"holds no functions/detMPs\.m"):
        code(f"ample:{tmp_path}")
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(NoAdapter, match="install GNU Octave"):
        code(f"ample-gimp:{tmp_path}")
