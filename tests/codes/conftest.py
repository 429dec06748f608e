"""A case in its folder, answered rightly."""

from pathlib import Path

import numpy as np
import pytest

from mpmtop.shape_functions import tent
from validation.codes import cases
from validation.codes.files import write_case
from validation.methods.points import PointMethod
from validation.methods.protocol import Case


def write_answer(folder: Path, case: Case) -> None:
    """Our tent's answer as a table."""
    answer = PointMethod("tent", tent).analyse(case)
    assert answer.stress is not None
    rows = np.column_stack([np.arange(len(answer.u)), case.points.x, answer.u, answer.stress])
    np.savetxt(folder / "answer.csv", rows, "%.17g", delimiter=",", header="point,x,y,ux,uy,sxx,syy,sxy", comments="")


@pytest.fixture
def asked(tmp_path: Path) -> tuple[Path, Case]:
    """A case in its folder, answered rightly."""
    case = cases.cantilever("cantilever")
    folder = tmp_path / "cantilever"
    write_case(folder, case)
    write_answer(folder, case)
    return folder, case
