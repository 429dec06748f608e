"""Numbers in an array."""

import numpy as np

from mpmtop.arrays import distinct


def test_distinct_numbers_are_those_of_unique() -> None:
    rng = np.random.default_rng(0)
    for keys in (rng.integers(0, 40, 300), np.arange(9)[::-1], np.zeros(5, int), np.array([7]), np.empty(0, int)):
        np.testing.assert_array_equal(distinct(keys), np.unique(keys))
