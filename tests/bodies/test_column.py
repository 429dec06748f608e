"""The column under its own weight: the deformed shape against its law and an integral, the errors against statics."""

import numpy as np
import pytest
from scipy.integrate import quad

from mpmtop.shape_functions import ShapeFunction, gimp, tent
from validation.bodies.column import BASE_STRESS, LENGTH, YOUNG, ample, errors, hencky


def test_stretch_carries_the_weight_above() -> None:
    Y = np.linspace(0, LENGTH, 21)
    stretch = hencky(Y).stretch
    # E ln(l) / l = -rho g (l0 - Y); Lambert's W is good to rounding
    np.testing.assert_allclose(YOUNG * np.log(stretch) / stretch, -BASE_STRESS * (1 - Y / LENGTH), atol=1e-9)


@pytest.mark.parametrize("Y", [0.0, 10.0, 37.5, 50.0])
def test_height_is_the_integral_of_the_stretch(Y: float) -> None:
    integral, _ = quad(lambda t: float(hencky(np.array(t)).stretch), 0, Y, epsabs=1e-11)
    assert float(hencky(np.array(Y)).y) == pytest.approx(integral, abs=1e-10)  # of the quadrature


@pytest.mark.parametrize("function", [tent, gimp])
@pytest.mark.parametrize("cells", [8, 20])
def test_undeformed_column_has_the_stress_of_its_cells_centres(function: ShapeFunction, cells: int) -> None:
    # statics: the tent's stress in a cell is that at its centre, h / 4 from every point
    found = errors(cells, function, deformed=False)
    assert found.initial_volume == pytest.approx(1 / (4 * cells), rel=1e-9)  # conditioning 1e3 times rounding
    assert found.volume == pytest.approx(found.initial_volume, rel=1e-12)  # the same volumes


def test_amples_column_is_as_high() -> None:
    # an independent code's largest displacement; its error falls from 5e-3 at 8 cells to 4e-4 at 64, below 1e-3
    assert float(ample().loc[("GIMP", 64), "min_uy"]) == pytest.approx(float(hencky(LENGTH).y) - LENGTH, rel=1e-3)
