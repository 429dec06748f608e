"""Checks of load steps in large deformation: what holds whatever the law, and two bodies with closed forms."""

from dataclasses import replace
from functools import partial

import numpy as np

from mpmtop.arrays import Array
from validation.bodies.column import stretch_of
from validation.bodies.large import elastica
from validation.codes import cases
from validation.codes.answers import Misanswered, NotSupported, off
from validation.codes.card import Check, Observed
from validation.methods.protocol import Capability, Case, Step, Steps

STEPS: frozenset[Capability] = frozenset({"load steps"})
SMALL, LARGE = 1e-7, 0.02
"""Of the cantilever's unit load: a tip displacement of 1e-6 of its length, and of a tenth."""
CELLS, COUNT = 8, 10
"""Of the column: cells over its height, load steps."""
BENT = 3.0
"""P L^2 / EI: the end goes down by 0.6 of the length, three fifths of what small rotations give."""
AMPLE_CELLS, AMPLE_STEPS = 16, 40


def asked(code: Steps, case: Case, count: int) -> list[Step]:
    """The code's steps, counted and finite."""
    lacks = sorted(case.needs - {"analysis"} - code.capabilities)
    if lacks:
        raise NotSupported(", ".join(lacks))
    found = list(code.steps(case, count))
    p = len(case.moduli)
    if len(found) != count:
        raise Misanswered(f"{len(found)} steps of {case.name}: give {count}")
    for x, stress in found:
        if np.shape(x) != (p, 2) or np.shape(stress) != (p, 3):
            raise Misanswered(f"x {np.shape(x)}, stress {np.shape(stress)}: give {(p, 2)} and {(p, 3)} for each step")
        if not (np.all(np.isfinite(x)) and np.all(np.isfinite(stress))):
            raise Misanswered(f"positions or stresses of {case.name} are not finite")
    return found


def _pulled(load: float) -> Case:
    made = cases.cantilever("cantilever")
    assert made.forces is not None
    return replace(made, name=f"cantilever under {load:g} of its load, large deformation", forces=load * made.forces)


def linear(code: Steps) -> Observed:
    """Half of what twice a small load does, by what it does itself."""
    one, two = (asked(code, _pulled(k * SMALL), 1)[-1].x - _pulled(SMALL).points.x for k in (1, 2))
    return Observed(float(off(two / 2, one).max()))


def mirrored(code: Steps) -> Observed:
    """Difference of the displacements and stresses of a mirrored cantilever, taken back."""
    here = _pulled(LARGE)
    there = cases.MIRRORED(here, f"{here.name}, in a mirror")
    one, other = asked(code, here, 4)[-1], asked(code, there, 4)[-1]
    error = off((other.x - there.points.x) * [-1, 1], one.x - here.points.x)
    return Observed(float(np.maximum(error, off(other.stress * [1, 1, -1], one.stress)).max()))


def _column(code: Steps) -> tuple[Array, Array, Array]:
    """Stress (p,) of a column of unit modulus under its weight, of unit stress at the base; weight (p,) above each
    point; and the stretch (p,) there by Hencky's law."""
    case = cases.column("column under its weight, large deformation", CELLS)
    above = 1 - (case.points.x[:, 1] - cases.HOME) / CELLS
    return asked(code, case, COUNT)[-1].stress[:, 1], above, stretch_of(above)


def cauchy(code: Steps) -> Observed:
    """Mean error of the Cauchy stress by that of the same numbers taken for Kirchhoff's."""
    found, above, stretch = _column(code)
    as_cauchy, as_kirchhoff = np.mean(np.abs(found + above)), np.mean(np.abs(found + above * stretch))
    kind = "Kirchhoff's stress in place of Cauchy's" if as_kirchhoff < 0.5 * as_cauchy else ""
    return Observed(float(as_cauchy / as_kirchhoff), f"mean error {as_cauchy:.3g} of the stress at the base", kind)


def column_error(code: Steps) -> Observed:
    """Mean error of the Cauchy stress, by that at the base."""
    found, above, _ = _column(code)
    return Observed(float(np.mean(np.abs(found + above))))


def bent(code: Steps) -> Observed:
    """Error of the end's deflection, by that of the elastica in closed form."""
    case = cases.slender("slender cantilever, large deformation", BENT)
    assert case.forces is not None
    last = np.any(case.forces != 0, axis=1)
    arm = float(case.points.x[:, 0].max()) - cases.HOME
    moved = (asked(code, case, COUNT)[-1].x - case.points.x)[last].mean(axis=0) / arm
    along, across = elastica(BENT)
    words = f"({moved[0]:.4f}, {moved[1]:.4f}) of the arm, right ({-along:.4f}, {-across:.4f})"
    return Observed(
        abs(moved[1] / -across - 1), words, "small strains or rotations" if moved[1] < -0.9 * BENT / 3 else ""
    )


def heavy(code: Steps) -> Observed:
    """Mean error of the Cauchy stress of AMPLE's column, four times its modulus heavy, by that at the base."""
    case = cases.column("AMPLE's column, large deformation", AMPLE_CELLS, weight=4.0)
    right = -(1 - (case.points.x[:, 1] - cases.HOME) / AMPLE_CELLS)
    return Observed(float(np.mean(np.abs(asked(code, case, AMPLE_STEPS)[-1].stress[:, 1] / 4 - right))))


def checks() -> list[Check]:
    """All checks of load steps."""
    eighth = abs(elastica(BENT)[1] / elastica(BENT * 8 / 9)[1] - 1)
    check = partial(Check, "load steps", needs=STEPS)
    return [
        check(
            "small loads act in proportion",
            observe=linear,
            at_most=1e-4,
            why="displacements of 1e-6 of the length change stiffness by as much, times a slenderness of two, squared",
            look="a residual that is met too roughly; a load that is not ramped from zero",
            rounding=True,
        ),
        check(
            "mirror image",
            observe=mirrored,
            at_most=1e-6,
            why="the same steps in another frame, to the tolerance of Newton's method, 1e-9 and room",
            look="the order of F's components, the sign of a rotation; domains that are stretched along one axis only",
            rounding=True,
        ),
        check(
            "stress is Cauchy's",
            observe=cauchy,
            at_most=0.5,
            why="a column is statically determinate: its Cauchy stress is the weight above, whatever the law; "
            "Kirchhoff's is less by the stretch, 0.57 at the base. A half tells them apart beside a crossing error",
            look="stress by J, the determinant of F; loads that follow masses, not volumes",
        ),
        check(
            "mean error of stress, column under its weight",
            observe=column_error,
            why="by the stress at the base; crossing is most of it, ten times as much by tents as by GIMP",
            look="",
        ),
        check(
            "deflection of a slender cantilever",
            observe=bent,
            at_most=eighth,
            why="the elastica under a load less by a ninth: bilinear functions two cells deep are stiffer in bending "
            "by 1 / (2 x 2^2), an eighth; shear adds 0.6 %",
            look="rotations of stress and domains; points that lose their cell; loads that do not go with their points",
        ),
        check(
            "mean error of stress, AMPLE's column",
            observe=heavy,
            why="four times its modulus heavy, 16 cells, 40 steps, at half its height in the end; AMPLE 1.1 gives "
            "0.0867 by its tents, 0.00366 by its GIMP",
            look="",
        ),
    ]
