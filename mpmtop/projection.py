"""Projection of filtered densities towards 0 and 1, and its derivative; see `mpmtop.design.Projection`."""

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from mpmtop.arrays import Array
from mpmtop.design import Projection


class Projected(NamedTuple):
    """Densities rho (p,) of filtered ones r (p,) and their derivatives: by r at a fixed threshold, and by that.

    d eta / dr (p,) is how the threshold follows the design; None where it does not.
    """

    rho: Array
    by_r: Array
    by_threshold: Array
    threshold_by_r: Array | None

    def pull_back(self, by_rho: Array) -> Array:
        """dJ/dr (p,) of dJ/drho."""
        by_r = self.by_r * by_rho
        return by_r if self.threshold_by_r is None else by_r + (self.by_threshold @ by_rho) * self.threshold_by_r


def project(projection: Projection, r: Array, volume: Array) -> Projected:
    """Densities of filtered densities r (p,) in [0, 1] at points of the given volumes (p,).

    Preserved is sum V rho = sum V r; with that, d eta / dr = V (1 - drho/dr) / sum V drho/deta.
    """
    if not projection.preserve_volume:
        return Projected(*_step(projection.beta, projection.threshold, r), None)
    beta, kept = projection.beta, volume @ r
    low, high = (volume @ (_step(beta, eta, r)[0] - r) for eta in (0.0, 1.0))  # it falls with the threshold
    eta = 0.0 if low <= 0 else 1.0 if high >= 0 else brentq(lambda e: volume @ _step(beta, e, r)[0] - kept, 0.0, 1.0)
    rho, by_r, by_threshold = _step(beta, eta, r)
    slope = volume @ by_threshold
    follows = volume * (1 - by_r) / slope if slope < 0 else np.zeros_like(r)
    return Projected(rho, by_r, by_threshold, follows)


def _step(beta: float, eta: float, r: Array) -> tuple[Array, Array, Array]:
    """rho, drho/dr and drho/deta, (p,) each."""
    t, t0, t1 = np.tanh(beta * (r - eta)), np.tanh(beta * eta), np.tanh(beta * (1 - eta))
    span = t0 + t1
    rho = (t0 + t) / span
    slope, slope0, slope1 = beta * (1 - t**2), beta * (1 - t0**2), beta * (1 - t1**2)
    return rho, slope / span, (slope0 - slope - rho * (slope0 - slope1)) / span
