"""Bodies, methods, loads and units at random: what is found is right, or refused by name. More in the benchmark."""

import pytest

from validation.bodies.hostile import RIGHT, outcomes


@pytest.mark.slow
def test_right_or_named() -> None:
    count, other = outcomes(0, 30)
    assert not other
    assert count[RIGHT] >= 20
