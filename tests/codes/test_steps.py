"""Load steps of a code: sound ones pass, Kirchhoff's stress in place of Cauchy's is named, wrong answers too."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3, gimp, tent
from validation.codes import cases, steps
from validation.codes.adapter import Adapter
from validation.codes.card import scorecard
from validation.methods.points import PointMethod
from validation.methods.protocol import Case, Step


@pytest.mark.parametrize("function", [tent, gimp, bspline2])
def test_our_load_steps_pass(function: ShapeFunction) -> None:
    card = scorecard(PointMethod("ours", function), steps.checks())
    assert [row.verdict for row in card.rows] == ["passes", "passes", "passes", "reported", "passes", "reported"]


def test_functions_without_load_steps_are_not_asked() -> None:
    card = scorecard(PointMethod("cubic", bspline3), steps.checks())
    assert {row.verdict for row in card.rows} == {"not supported"}


def test_small_loads_are_the_linear_analysis() -> None:
    """The last of the steps in the limit: GIMP's displacements and stresses, to what the background takes:
    1e-5 of the modulus over the whole box, beside a slender body that is some ten times softer than it."""
    case = steps._pulled(1e-7)
    method = PointMethod("GIMP", gimp)
    (step,), linear = method.steps(case, 1), method.analyse(case)
    np.testing.assert_allclose(step.x - case.points.x, linear.u, atol=1e-3 * np.abs(linear.u).max())
    assert linear.stress is not None
    np.testing.assert_allclose(step.stress, linear.stress, atol=1e-3 * np.abs(linear.stress).max())


class Theirs:
    capabilities = frozenset({"load steps", "body forces"})
    inner = PointMethod("ours", gimp)

    def __init__(self, spoil: Any) -> None:
        self.spoil = spoil

    def steps(self, case: Case, count: int) -> Any:
        return self.spoil(case, self.inner.steps(case, count))


def kirchhoff(case: Case, found: list[Step]) -> list[Step]:
    """J is that of the column's closed form, and one where strains are small."""
    above = -found[-1].stress[:, 1] if "column" in case.name else np.zeros(len(case.moduli))
    return [Step(x, stress * steps.stretch_of(np.maximum(above, 0))[:, None]) for x, stress in found]


def straight(case: Case, found: list[Step]) -> list[Step]:
    """What small strains and rotations give: displacements in proportion to the load."""
    u = PointMethod("ours", gimp).analyse(replace(case, forces=case.carried, body_force=None)).u
    return [Step(case.points.x + u * n / len(found), step.stress) for n, step in enumerate(found, 1)]


SPOILT = {
    "Kirchhoff": (kirchhoff, "stress is Cauchy's", "mean error"),
    "one step less": (lambda case, found: found[:-1], "mirror image", "Misanswered: 3 steps of cantilever"),
    "three columns of x": (
        lambda case, found: [Step(np.pad(x, ((0, 0), (0, 1))), s) for x, s in found],
        "mirror image",
        r"Misanswered: x \(288, 3\)",
    ),
    "not finite": (lambda case, found: [Step(x * np.nan, s) for x, s in found], "mirror image", "are not finite"),
    "straight": (straight, "deflection of a slender cantilever", "of the arm, right"),
    "one way": (lambda case, found: [Step(np.abs(x), np.abs(s)) for x, s in found], "mirror image", ""),
}


KINDS = {"Kirchhoff": ["Kirchhoff's stress in place of Cauchy's"], "straight": ["small strains or rotations"]}


@pytest.mark.parametrize("how", SPOILT)
def test_spoilt_steps_are_found(how: str) -> None:
    spoil, check, said = SPOILT[how]
    card = scorecard(Adapter(Theirs(spoil)), steps.checks())
    row = next(row for row in card.rows if row.check.name == check)
    assert row.verdict == "fails" and re.search(said, row.where)
    assert card.kinds == KINDS.get(how, [])


def test_the_column_s_stretch_is_that_of_hencky_s_law() -> None:
    """E ln(l) / l = -load."""
    load = np.linspace(0, 1, 11)
    stretch = steps.stretch_of(load)
    np.testing.assert_allclose(np.log(stretch) / stretch, -load, atol=1e-14)
    assert cases.column("column", steps.CELLS).carried.sum() == pytest.approx(-1)
