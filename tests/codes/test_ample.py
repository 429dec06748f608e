"""AMPLE driven live, where a copy of it and Octave are: the environment variable AMPLE names its folder."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

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


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize(("kind", "function"), [("ample", tent), ("ample-gimp", gimp)])
def test_ample_s_answers_are_ours(kind: str, function: ShapeFunction, name: str) -> None:
    """Its routines as they are, in small strain: displacements to rounding, stress to what finite strain leaves."""
    folder = os.environ.get("AMPLE")
    if not folder or shutil.which("octave-cli") is None:
        pytest.skip("AMPLE is the user's copy: set AMPLE to its folder, and install octave-cli")
    case = CASES[name]
    ours, theirs = PointMethod("ours", function).analyse(case), code(f"{kind}:{folder}", 600.0).analyse(case)
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
