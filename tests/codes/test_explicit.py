"""A code that steps in time answers statics: ramped, damped, and with what is left of the motion."""

import numpy as np
import pytest

from mpmtop.errors import NotConverged
from mpmtop.shape_functions import tent
from tests.codes.swinging import Swinging
from validation.codes import cases
from validation.codes.card import scorecard
from validation.codes.checks import every
from validation.codes.explicit import relaxed
from validation.methods.points import PointMethod

SOME = ["mean stress, loads on points", "residual kinetic energy", "plane stress", "gradient", "compliance stated"]


def test_an_explicit_code_answers_statics_to_its_accuracy() -> None:
    """Ours in statics, to what the root of the kinetic energy says; asked for no gradient; the rest is reported."""
    code = relaxed(Swinging(), 1e-3, block=30)
    assert "gradient" not in code.capabilities and code.name == "swinging MPM"
    case = cases.cantilever("cantilever")
    ours, theirs = PointMethod("tent", tent).analyse(case), code.analyse(case)
    off = np.abs(theirs.u - ours.u).max() / np.abs(ours.u).max()
    assert off <= 1e-3 and theirs.kinetic is not None and 0 < theirs.kinetic <= 1e-8
    card = scorecard(code, [check for check in every() if check.way == "analysis" and check.name in SOME])
    rows = {row.check.name: row for row in card.rows}
    assert rows["mean stress, loads on points"].verdict == "passes"
    assert rows["mean stress, loads on points"].check.at_most == 1e-3
    assert rows["residual kinetic energy"].verdict == "reported" and rows["residual kinetic energy"].observed <= 1e-8
    assert rows["compliance stated"].verdict == "not stated"


def test_what_does_not_come_to_rest_is_no_answer() -> None:
    """Without damping it swings for ever; an unstable one has no energy that is finite."""
    with pytest.raises(NotConverged, match="damp otherwise, allow more blocks"):
        relaxed(Swinging(damping=0.0), 1e-3, ramp=1, block=10, blocks=5).analyse(cases.cantilever("cantilever"))
    with pytest.raises(ValueError, match="give positive numbers"):
        relaxed(Swinging(), 0.0)


def test_codes_of_statics_have_no_kinetic_energy() -> None:
    (check,) = (check for check in every() if check.name == "residual kinetic energy")
    assert scorecard(PointMethod("tent", tent), [check]).rows[0].verdict == "not stated"
