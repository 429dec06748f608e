"""The beam in slices: what it must give for points that move in ways with a known answer."""

import numpy as np
import pytest

from mpmtop.crossing import Bump, Periodic, Uniform
from validation.bodies.sliced_beam import LENGTH, beam_rises, energy_shares, material


def test_shares_are_those_of_timoshenko() -> None:
    """Bending grows towards the clamp, shear is the same in all; together 1."""
    share = energy_shares()
    assert share.sum() == pytest.approx(1, rel=1e-14)
    assert np.all(np.diff(share) < 0)
    material = 1 / (1 - 0.3**2), 5 / 6 / 2.6  # E / (1 - nu^2), kappa G
    bending, shear = LENGTH**3 / (3 * material[0] * 20**3 / 12), LENGTH / (material[1] * 20)
    # differences of neighbours leave bending's part alone: those of cubes from 40^3 to 0
    assert share[0] - share[-1] == pytest.approx((40**3 - 39**3 - 1) / 40**3 * bending / (bending + shear), rel=1e-12)


def test_still_points_change_nothing() -> None:
    assert beam_rises(Uniform(0.0)) == pytest.approx({"standard": 0, "GIMP": 0}, abs=1e-14)


def test_a_column_that_jumps_alone() -> None:
    """One of 10 boundaries, at 20 h: standard has 1/2 and 3/2 left and right of it; GIMP loses 0.26 h of a domain."""
    counted, covered = material(Periodic(20, 0.26))
    assert counted[19:21].tolist() == [0.5, 1.5]
    np.testing.assert_allclose(covered[19:21], [0.74, 1.26], rtol=1e-12)
    assert np.all(np.delete(counted, [19, 20]) == 1)
    share = energy_shares()
    assert beam_rises(Periodic(20, 0.26))["standard"] == pytest.approx(share[19] - share[20] / 3, rel=1e-12)


def test_neighbours_that_move_alike() -> None:
    """A wide bump takes the same points over the boundary, and leaves the slices all but a few per cent of domains."""
    alone, alike = material(Periodic(4)), material(Bump(4, 1.5))
    assert np.array_equal(alone[0], alike[0])
    assert np.abs(alike[1] - 1).max() < 0.5 * np.abs(alone[1] - 1).max()


def test_no_material_is_lost() -> None:
    """What leaves a slice enters another, whichever way it is counted."""
    for part in material(Bump(4, 1.25)):
        assert part.sum() == pytest.approx(LENGTH, rel=1e-12)
