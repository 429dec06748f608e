"""AMPLE's column under its own weight, compacted to half its length, in load steps: stresses in closed form.

With nu = 0 a dead weight leaves the first Piola-Kirchhoff stress linear in the height, -w (L - Y), and the Cauchy
stress is the same: areas stay.
"""

import pytest

from mpmtop.shape_functions import gimp, tent
from validation.bodies.column import load_steps_error
from validation.measures.orders import observed_order


def test_gimp_converges() -> None:
    """Domains that follow the points: second order or nearly, and 2e-3 at 32 cells."""
    coarse, fine = (load_steps_error(cells, gimp, "stretched") for cells in (16, 32))
    assert fine < 2e-3
    assert observed_order(coarse, fine) > 1.5


@pytest.mark.parametrize("cells", [16, 32])
def test_tent_does_not(cells: int) -> None:
    """Crossing leaves an error that refinement does not take away."""
    assert load_steps_error(cells, tent, "fixed") > 5e-2
