"""The judge on load cases, constraints and designs cut to black and white."""

from dataclasses import replace

import numpy as np
import pytest

from mpmtop.criteria import AtMost, Compliance, PNormStress, Worst
from mpmtop.scene import Scene
from reference_fem.reanalyse import build_judge, judge_criteria, judge_stress, thresholded
from reference_fem.simp import design_problem
from tests.methods.test_criteria_agree import BODY, CASES, DESIGN, LIMITS, scene

STRESS = AtMost(PNormStress(8, 0.5), 3.0)


@pytest.mark.parametrize("black_and_white", [False, True])
def test_one_bilinear_element_for_each_point_is_the_problem_itself(black_and_white: bool) -> None:
    """All criteria in all cases, of grey densities and cut ones."""
    asked = scene(constraints=(*LIMITS, STRESS))
    of = design_problem(asked, 0.5)
    x = of.model.centres
    half = np.full_like(x, 0.25)
    rho = np.random.default_rng(0).uniform(0.2, 1, len(x))
    rho = thresholded(rho, of.model.area) if black_and_white else rho
    judge = build_judge(asked, x, half, split=1, order=1)
    judged, at = judge_criteria(judge, rho, judge(rho)), of.analyse(rho)
    # rounding times the contrast's inverse, 1e4, where void carries load
    np.testing.assert_allclose(judged.objectives, at.objectives, rtol=1e-9)
    np.testing.assert_allclose(judged.constraints, at.constraints[1:], rtol=1e-9, atol=1e-9)
    assert judged.objective == at.objectives.max()


def test_criteria_are_those_of_compliance_and_stress() -> None:
    """On the fine mesh: what the judge says of one case, and its p-norm by points, whatever the mesh."""
    one = Scene("one", replace(BODY, loads=CASES[1].loads), DESIGN, Compliance(), (STRESS,))
    x = design_problem(one, 0.5).model.centres
    rho = np.random.default_rng(1).uniform(0.2, 1, len(x))
    judge = build_judge(one, x, np.full_like(x, 0.25))
    judgement = judge(rho)
    judged = judge_criteria(judge, rho, judgement)
    assert judged.objective == pytest.approx(judgement.compliance, rel=1e-14)
    stressed = replace(judge, objective=STRESS.criterion)
    assert judged.constraints[0] == pytest.approx(judge_stress(stressed, rho, judgement).p_norm / 3 - 1, rel=1e-12)
    in_cases = build_judge(
        replace(one, objective=Worst(Compliance()), cases=CASES, body=BODY), x, np.full_like(x, 0.25)
    )
    of_cases = judge_criteria(in_cases, rho, in_cases(rho))
    assert of_cases.objectives[1] == pytest.approx(CASES[1].weight * judgement.compliance, rel=1e-12)
    assert len(of_cases.objectives) == len(in_cases(rho).states) == 3


def test_thresholded() -> None:
    """0 and 1 alone; the volume kept to half a point, whatever their sizes; what is left out is not denser."""
    rng = np.random.default_rng(2)
    rho, volume = rng.uniform(size=200), rng.uniform(0.5, 2, 200)
    black = thresholded(rho, volume)
    assert set(black) == {0.0, 1.0}
    assert abs(volume @ black - volume @ rho) <= volume.max() / 2
    assert 0 <= volume @ rho - volume @ thresholded(rho, volume, exceed=0.0) < volume.max()
    assert rho[black == 1].min() >= rho[black == 0].max()
    np.testing.assert_array_equal(thresholded(rho, volume, 0.5), rho > 0.5)
    np.testing.assert_array_equal(thresholded(black, volume), black)
    pairs, one = (
        np.repeat(np.linspace(0.1, 0.9, 100), 2),
        np.ones(200),
    )  # mirror images, and what rounding makes of them
    np.testing.assert_array_equal(thresholded(pairs + 1e-9 * rng.normal(size=200), one), thresholded(pairs, one))
