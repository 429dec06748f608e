"""The parts of crossing's error, and points beyond the clamp."""

import numpy as np
import pandas as pd
import pytest

from mpmtop.errors import UnsupportedBody
from mpmtop.points import MaterialPoints, seed
from reference_fem.reanalyse import Judge, build_judge
from validation.bodies.scenes import SPACING, H, cantilever, extended_cantilever
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.methods.analyser import SHAPE_FUNCTIONS
from validation.studies.crossing.analysis import RTOL_ANALYSIS, exactly, solid

# points are moved off the clamp and over grid lines on purpose
pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")


@pytest.fixture(scope="module")
def judge(uniform: MaterialPoints) -> Judge:
    """Fine reference whose element centres are the points' places in the body."""
    return build_judge(cantilever(), uniform.x, uniform.half_length, split=1)


def timoshenko(length: float) -> float:
    """Tip displacement of the cantilever of a length [h] in plane strain, shear correction 5/6, by beam theory."""
    material = cantilever().body.material
    height, nu = 20.0, material.poisson
    modulus, shear = material.young / (1 - nu**2), material.young / (2 * (1 + nu))
    return length**3 / (3 * modulus * height**3 / 12) + length / (5 / 6 * shear * height)


@pytest.mark.slow
def test_error_split(report: Report, lock: Lock, uniform: MaterialPoints, judge: Judge) -> None:
    """Where the error of a shifted body comes from

    The tip displacement of the body shifted by 0.26 h in x, factor by factor. **Grid**: the functions on the background
    grid, integrated exactly (with the tent, bilinear finite elements), over the fine reference. **Quadrature**: uniform
    points over exact integration of the same functions. **Lever arm**: 0.26 h more length, by Timoshenko's beam.
    **Cut**: the rest of what exact integration of the shifted body sees, the gap at the clamp and the partly filled
    cells. **Crossing inside**: the extended body, which lies the same way on clamp and load at any shift, so that only
    its points move over the grid. **Crossing at the ends**: the rest.

    Inside a body a uniform shift changes little: every cell still holds as many points, in other places. With the tent
    the rise that is not lever arm or cut comes from the ends: in the clamped cell one column of two is left, for three
    quarters of its material. The other functions do not lose that column; their rise is lever arm and cut.
    """
    s = 0.26
    shift = np.array([s * H, 0.0])
    lower, upper = cantilever().body.domain.bounds
    long = seed(extended_cantilever().body.domain, (SPACING, SPACING))
    fine = judge(np.ones(judge.points)).compliance
    lever = timoshenko(40 + s) / timoshenko(40)
    rows: dict[str, dict[str, float]] = {}
    for name, function in SHAPE_FUNCTIONS.items():
        still, moved = (solid(cantilever(), uniform.moved(by), function) for by in (0 * shift, shift))
        exact = exactly(still, lower, upper, name)
        geometry = exactly(moved, lower + shift, upper + shift, name) / exact
        extended = [solid(extended_cantilever(), long.moved(by), function).tip for by in (0 * shift, shift)]
        rows[name] = {
            "grid": exact / fine,
            "quadrature": still.tip / exact,
            "shifted, total": moved.tip / still.tip,
            "= lever arm": lever,
            "x cut": geometry / lever,
            "x crossing inside": extended[1] / extended[0],
            "x crossing at the ends": moved.tip / still.tip / geometry * extended[0] / extended[1],
        }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("shape function")
    report.table("error_split", table, "Factors of the tip displacement, shift of 0.26 h in x.", 5)
    report.check(
        "crossing inside the body, uniform shift of 0.26 h: factor of the tip displacement, standard",
        rows["standard"]["x crossing inside"],
        source="for comparison",
    )
    inside = {name: row["x crossing inside"] - 1 for name, row in rows.items()}
    ends = {name: row["shifted, total"] - 1 for name, row in rows.items()}
    report.found(
        f"A uniform shift by {s} h changes the tip by {ends['standard']:+.1%} (standard) and {ends['GIMP']:+.1%} "
        "(GIMP), of "
        f"which crossing inside the body makes {inside['standard']:+.1%} and {inside['GIMP']:+.1%}."
    )
    report.so("Most of a uniform shift is lever arm, cut cells and the clamp: compare bodies that lie alike on both.")
    converged = report.check(
        "grid and quadrature of the unshifted body: factor of the tip displacement furthest from 1",
        max((row["grid"] * row["quadrature"] for row in rows.values()), key=lambda factor: abs(factor - 1)),
        1.0,
        rtol=0.01,
        source="our bound",
    )
    lock({f"{name}, {part}": v for name, row in rows.items() for part, v in row.items()}, rtol=RTOL_ANALYSIS)
    assert converged


def test_beyond_the_clamp(report: Report, uniform: MaterialPoints) -> None:
    """Further than 0.75 h

    Shifted by 0.76 h in x, no point is left in the cells at the clamp: with the tent nothing holds the body, and the
    analysis says so. The B-splines end with the last cell that holds a point and do not reach the clamp either. GIMP's
    domains do, by a hair: the body hangs on that.
    """
    outcomes: dict[str, str | float] = {}
    for name, function in SHAPE_FUNCTIONS.items():
        reference = solid(cantilever(), uniform, function).tip
        try:
            outcomes[name] = solid(cantilever(), uniform.moved((0.76 * H, 0.0)), function).tip / reference
        except UnsupportedBody as error:
            outcomes[name] = type(error).__name__
    table = pd.Series(outcomes, name="tip displacement / unshifted").rename_axis("shape function").to_frame()
    report.table("beyond", table, "The body shifted by 0.76 h in x.", 4)
    named = report.check(
        "outcome of a shift by 0.76 h, standard",
        outcomes["standard"],
        "UnsupportedBody",
        source="a body held by nothing",
    )
    assert named
