"""Load steps and gradients against independent codes."""

from functools import cache

import numpy as np
import pandas as pd
import pytest

from mpmtop.large_deformation.law import jacobian, kirchhoff, out_of_plane, stress
from mpmtop.large_deformation.objectives import EndCompliance, EndStress, gradient
from mpmtop.large_deformation.steps import Trajectory, trajectory
from mpmtop.shape_functions import ShapeFunction, gimp, tent
from tests.mpmtop.large_deformation.cases import DATA, PROTOTYPE, ample, model, moduli

TOL = 1e-13
"""Newton's, as in these codes. The cases' condition leaves 1e-14 of it in x."""


@cache
def run(case: str) -> Trajectory:
    return trajectory(model(PROTOTYPE[case]), moduli(), tol=TOL)


@pytest.mark.parametrize("shape_function", [tent, gimp], ids=lambda s: s.__name__)
def test_ample(shape_function: ShapeFunction) -> None:
    """Positions, deformation gradients, domains and Cauchy stresses of AMPLE's steps 1 to 4; and Newton's steps."""
    beam = ample(shape_function)
    path = trajectory(beam, np.full(len(beam.points.x), beam.young), tol=TOL)
    data = pd.read_csv(DATA / f"ample_{shape_function.__name__}.csv")
    assert set(data.step) == {1, 2, 3, 4}
    for step, rows in data.groupby("step"):
        state, p = path.states[step], rows.point.to_numpy() - 1
        np.testing.assert_allclose(state.x[p], rows[["x", "y"]], atol=1e-10)
        np.testing.assert_allclose(state.F[p].reshape(-1, 4), rows[["F11", "F12", "F21", "F22"]], atol=1e-10)
        F = state.F[p]
        tau, zz = beam.young * kirchhoff(stress(beam.law, F), F), beam.young * out_of_plane(beam.law, F)
        cauchy = np.stack([tau[:, 0, 0], tau[:, 1, 1], zz, tau[:, 0, 1]], axis=1) / jacobian(F)[:, None]
        expected = rows[["sxx", "syy", "szz", "sxy"]].to_numpy()
        np.testing.assert_allclose(cauchy, expected, atol=1e-10 * np.abs(expected).max())
        if shape_function is gimp:
            np.testing.assert_allclose(state.half_length[p], rows[["lx", "ly"]], atol=1e-10)
    assert path.parts[:4] == (1,) * 4  # AMPLE has no line search and cuts no step
    assert max(path.newton_steps[:4]) <= 8


@pytest.mark.parametrize("case", PROTOTYPE)
def test_prototype(case: str) -> None:
    path = run(case)
    for step, rows in pd.read_csv(DATA / f"{case}.csv").groupby("step"):
        state, p = path.states[step], rows.point.to_numpy()
        np.testing.assert_allclose(state.x[p], rows[["x", "y"]], atol=1e-10)
        np.testing.assert_allclose(state.F[p].reshape(-1, 4), rows[["F11", "F12", "F21", "F22"]], atol=1e-10)
        np.testing.assert_allclose(state.half_length[p], rows[["lx", "ly"]], atol=1e-10)
    assert path.displacement()[:, 1].min() < -2.5  # a large one


@pytest.mark.parametrize("objective", [EndCompliance(), EndStress(8.0, 0.0)], ids=["compliance", "stress"])
@pytest.mark.parametrize("case", PROTOTYPE)
def test_gradient_of_the_prototype(case: str, objective: EndCompliance | EndStress) -> None:
    expected = pd.read_csv(DATA / "gradient.csv")[
        f"{case}_{'compliance' if isinstance(objective, EndCompliance) else 'stress'}"
    ]
    found = gradient(objective, model(PROTOTYPE[case]), run(case), np.ones(len(expected)))[1]
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())
