"""Starts of an optimisation that do not depend on the points: the same field on any of them."""

from collections.abc import Callable

import numpy as np

from mpmtop.arrays import Array

WAVES = 4
"""Cosines of a start."""
LONGEST = 2 * np.pi / 10
"""Largest wave number [1/h]: waves are 10 h long and more, so that every resolution and filter has them."""


def cosines(seed: int, volume_fraction: float = 0.4) -> Callable[[Array], Array]:
    """Densities of a start as a function of the positions (n, 2) [h]: the volume fraction times 1 plus `WAVES` cosines
    of random direction, length and phase, of 1/2 at most in all; none for seed 0, the uniform start."""
    rng = np.random.default_rng(seed)
    k, phase = rng.uniform(-LONGEST, LONGEST, (2, WAVES)), rng.uniform(0, 2 * np.pi, WAVES)
    size = 0.5 * (seed > 0) / WAVES

    def field(x: Array) -> Array:
        return volume_fraction * (1 + size * np.sum(np.cos(x @ k + phase), axis=1))

    return field
