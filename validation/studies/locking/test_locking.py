"""Volumetric locking

Optimised bodies are rarely incompressible, but a method that fails as nu → 1/2 is stiff before it gets there. Each
point, or Gauss point of an element, then asks for its own dilatation to vanish, and these are more conditions than the
nodes can meet. **B-bar** (Hughes 1980; for material points Coombs et al. 2018) asks once for each cell: the dilatation
of its points is replaced by their mean, `discretise(..., b_bar=True)`. The paper has nu = 0.3 throughout.

The body is Timoshenko's cantilever in plane strain, four times as long as deep, under the exact tractions of its closed
form; 2 x 2 points per cell. Errors of the tip displacement are relative; negative is too stiff, -1 does not move.
"""

import numpy as np
import pandas as pd
import pytest

from mpmtop.points import seed
from validation.bodies.beam import beam_body
from validation.bodies.sketch import CHOSEN, PAPER, body_opening
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.methods.analyser import SHAPE_FUNCTIONS
from validation.studies.locking.levels import (
    B_BAR,
    COARSE,
    CROSSED,
    FINE,
    PLAIN,
    POISSON,
    SEEDED,
    SPACING,
    arrangement_errors,
    locking_errors,
    locking_figure,
    plane_strain,
)

ASKED = "Does MPM lock as Poisson's ratio nears 1/2, and does B-bar cure it?"

MODERATE, LIMIT = 0.3, POISSON[-1]
SHOWN = (MODERATE, 0.49, 0.4999, LIMIT)
RTOL = 1e-4
"""Two direct solvers differ by 1e-6 of the errors that are locked, at nu = 0.49999."""
BSPLINES = ("quadratic B-spline", "cubic B-spline")
BOUNDED = 1.5
"""Without locking, errors have a limit. It is not that of nu = 0.3, as the solution differs, nu / (1 - nu) = 1 in place
of 0.43: half as much again is allowed for that. Locking multiplies by tens."""


@pytest.mark.slow
def test_poisson(report: Report, lock: Lock) -> None:
    """Error against Poisson's ratio

    Four cells over the depth. GIMP is not shown: no domain leaves its cell, so it is the standard method.
    """
    open_beam(report)
    errors = locking_errors()
    report.figure(
        "poisson",
        locking_figure(errors),
        f"Tip displacement, {COARSE} cells over the depth, nu from {POISSON[0]:g} on the left to {LIMIT:g}. The "
        "logarithm also dips where an error changes its sign.",
    )
    table = pd.DataFrame(
        [(*case, *(error[nu] for nu in SHOWN)) for case, error in errors.items()],
        columns=["method", "dilatation", *(f"nu = {nu:g}" for nu in SHOWN)],
    )
    report.table("poisson", table, "Relative error of the tip displacement.", 3)
    locks = [
        report.check(
            f"{name}, plain, nu = {LIMIT:g}: error", errors[name, PLAIN][LIMIT], at_most=-0.9, source="locking"
        )
        for name in ("standard", "FEM Q1")
    ]
    for name in BSPLINES:
        report.check(f"{name}, plain, nu = {LIMIT:g}: error", errors[name, PLAIN][LIMIT], source="for comparison")
    treated = {name: error for (name, treatment), error in errors.items() if treatment == B_BAR}
    cured = [
        report.check(
            f"{name}, B-bar: |error| at nu = {LIMIT:g} over nu = {MODERATE:g}",
            abs(error[LIMIT] / error[MODERATE]),
            at_most=BOUNDED,
            source="no locking: bounded as nu → 1/2",
        )
        for name, error in treated.items()
    ]
    settled = report.check(
        f"B-bar, all: largest change of the error from nu = {POISSON[-2]:g} to {LIMIT:g}",
        max(abs(error[LIMIT] - error[POISSON[-2]]) for error in treated.values()),
        at_most=0.5 - POISSON[-2],
        source="no locking: a limit, to first order in 1/2 - nu",
    )
    quadratic, plain = treated[BSPLINES[0]], errors[BSPLINES[0], PLAIN]
    factor = quadratic[MODERATE] / plain[MODERATE]
    report.found(
        f"At nu = {LIMIT:g} the tip moves by {1 + errors['standard', PLAIN][LIMIT]:.0%} of what is right with "
        "standard MPM, "
        f"by {1 + errors['FEM Q1', PLAIN][LIMIT]:.0%} with bilinear elements; with B-bar the largest error is "
        f"{max(abs(error[LIMIT]) for error in treated.values()):.1%}."
    )
    if factor > 1:
        report.so(
            f"B-bar is a cure to use against locking, not by default: at nu = {MODERATE:g} it multiplies the quadratic "
            f"B-spline's error by {factor:.1f}."
        )
    report.text(
        f"Standard MPM locks as the bilinear element does. B-splines lock later: at nu = {LIMIT:g} the quadratic one's "
        f"error is {plain[LIMIT]:.0%}. With B-bar none locks. What is left is positive, too soft, also at "
        f"nu = {MODERATE:g}, where B-bar multiplies the quadratic B-spline's error by {factor:.1f}: a cure to use "
        "against locking, not by default. Biquadratic elements need none here."
    )
    locked = {case: error for case, error in errors.items() if case[0] != "FEM Q2"}  # whose error rounding may reach
    lock({f"{', '.join(case)}, {nu:g}": e for case, error in locked.items() for nu, e in error.items()}, rtol=RTOL)
    assert all(locks) and all(cured) and settled


def open_beam(report: Report) -> None:
    """Sketch and parameters of the beam."""
    body = beam_body(COARSE, plane_strain(LIMIT))
    body_opening(
        report,
        body,
        seed(body.domain, (SPACING, SPACING)),
        {
            "size": (f"{4 * COARSE} h x {COARSE} h", CHOSEN),
            "material": (f"E = 1, plane strain, nu from {POISSON[0]:g} to {LIMIT:g}", CHOSEN),
            "load": ("the closed form's tractions on both ends", "Timoshenko and Goodier, Sect. 21"),
            "supports": ("two points of the left end", "Timoshenko and Goodier, Sect. 21"),
            "points": ("2 x 2 in each cell", PAPER),
        },
    )


@pytest.mark.slow
def test_mean_stress(report: Report, lock: Lock) -> None:
    """Mean stress, and points that have crossed

    Eight cells over the depth, points as seeded and **crossed** by `periodic(4, 0.26)`: the last column of points
    before every fourth cell boundary is pushed over it, which leaves cells with two points and with six. The error of
    the mean stress at the points, root of the mean square over that of the exact one, tells what displacements may
    hide: where a method locks, the mean stress differs from point to point by tens of times the stress itself.
    """
    errors = arrangement_errors((MODERATE, LIMIT))
    table = pd.DataFrame(
        [(*case, *error[MODERATE], *error[LIMIT]) for case, error in errors.items()],
        columns=[
            *("points", "method", "dilatation"),
            *(f"{quantity} at {nu:g}" for nu in (MODERATE, LIMIT) for quantity in ("tip", "stress")),
        ],
    )
    report.table("mean_stress", table, "Relative errors of tip displacement and mean stress at two values of nu.", 3)
    seeded, crossed = ({name: errors[a, name, B_BAR] for name in SHAPE_FUNCTIONS} for a in (SEEDED, CROSSED))
    # exact: linear in y over a cell; at +-1/4 of the cell from its mean, beside a root mean square of n / sqrt(12)
    one_per_cell = np.sqrt(12) / (4 * FINE)
    smooth = [
        report.check(
            f"{name}, B-bar, as seeded, nu = {LIMIT:g}: error of the mean stress",
            error[LIMIT].mean_stress,
            round(one_per_cell, 4),
            rtol=0.05,  # in quadrature, errors of a third of it: the discretisation's own, without locking
            source="one value for each cell, and little else",
        )
        for name, error in seeded.items()
    ]
    cured = report.check(
        f"B-bar, all functions and arrangements: largest |tip error| at nu = {LIMIT:g} over nu = {MODERATE:g}",
        max(abs(error[LIMIT].tip / error[MODERATE].tip) for of in (seeded, crossed) for error in of.values()),
        at_most=BOUNDED,
        source="no locking: bounded as nu → 1/2",
    )
    for name in BSPLINES:
        report.check(
            f"{name}, as seeded, nu = {MODERATE:g}: error of the mean stress, B-bar over plain",
            seeded[name][MODERATE].mean_stress / errors[SEEDED, name, PLAIN][MODERATE].mean_stress,
            source="for comparison",
        )
    before, after = ([error[nu].mean_stress for error in crossed.values()] for nu in (MODERATE, LIMIT))
    report.text(
        "As seeded, B-bar's mean stress is in error by its being one value for each cell, and by little else: no "
        "checkerboard here, though bilinear displacements with one mean stress per cell are not stable in every "
        "problem. For **B-splines this is no full cure**: their displacement no longer locks, but their mean stress "
        "comes down to the tent's order, at every nu. A mean stress that is itself a spline, of one order less, would "
        "keep theirs (Elguedj et al. 2008); it is not provided. With points that have crossed none locks, either, but "
        f"nu → 1/2 magnifies what crossing does to the mean stress: errors of {min(before):.0%} to {max(before):.0%} "
        f"at nu = {MODERATE:g} become {min(after):.0%} to {max(after):.0%} at nu = {LIMIT:g}."
    )
    lock(
        {
            f"{', '.join(case)}, {nu:g}: {quantity}": e
            for case, error in errors.items()
            for nu, both in error.items()
            for quantity, e in both._asdict().items()
        },
        rtol=RTOL,
    )
    assert all(smooth) and cured
