"""Bodies, methods, loads and units at random: what is found is right, or refused by name. More in the benchmark."""

import pytest

from validation.bodies.hostile import LAST_BITS, RIGHT, outcome, outcomes


@pytest.mark.slow
def test_right_or_named() -> None:
    count, other = outcomes(0, 30)
    assert not other
    assert count[RIGHT] >= 20


@pytest.mark.parametrize(("seed", "expected"), [(627, RIGHT), (1057, RIGHT), (1268, LAST_BITS)])
def test_loads_of_a_billionth(seed: int, expected: str) -> None:
    """3e-9 to 7e-9 of E: the quadratic terms of one Newton step, 1e-6 of the forces, are below what rounding may leave
    at worst, and must go; without a background, void of 1e-9 leaves the gradient three digits."""
    assert outcome(seed) == expected
