"""The whole loop against published optima: reference_fem, update rule and stopping rule together."""

import numpy as np
import pytest

from mpmtop.gcmma import OptimalityCriteria
from mpmtop.optimize import design_change, optimize
from mpmtop.scene import Material, PointLoad, Rectangle, Scene, Support
from reference_fem.simp import compliance_problem


def test_half_mbb_beam_by_optimality_criteria() -> None:
    """60 x 20, filter 2.4, move 0.2, stop at change 0.01: 233.71457 published.

    The published code finds its multiplier by a bisection to 1e-3 only; ours is exact, hence 3e-5 here. With that
    bisection the number is met to its last digit, see test_reference_fem.py.
    """
    scene = Scene(
        name="half MBB beam",
        domain=Rectangle((0, 0), (60, 20)),
        supports=(
            Support(Rectangle((0, 0), (0, 20)), (True, False)),
            Support(Rectangle((60, 0), (60, 0)), (False, True)),
        ),
        loads=(PointLoad((0, 20), (0, -1), points=0),),
        filter_radius=2.4,
        material=Material(1.0, 0.3, "stress"),
        volume_fraction=0.5,
        rho_min=0.0,
    )
    iterates = list(optimize(compliance_problem(scene, 1.0), OptimalityCriteria(0.2), stop=design_change(0.01)))
    assert iterates[0].objective == pytest.approx(1007.0221007, abs=5e-8)
    assert iterates[-1].converged
    assert iterates[-1].objective == pytest.approx(233.71457, rel=3e-5)
    np.testing.assert_allclose(iterates[-1].constraints, 0, atol=1e-9)  # the multiplier is exact
