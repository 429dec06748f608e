"""Stress of the solid cantilever by the fine reference, and the norm in which fields of stress are compared."""

import numpy as np

from mpmtop.arrays import Array
from mpmtop.points import MaterialPoints
from reference_fem import elasticity
from reference_fem.reanalyse import build_judge
from validation.bodies.scenes import cantilever


def tensor_norm(stress: Array) -> float:
    """Root of the sum over all points of |sigma|^2, for stresses (p, 3) in Voigt order, sigma_xy counted twice."""
    return float(np.sqrt(np.sum(stress**2 * (1, 1, 2))))


def reference_stress(points: MaterialPoints) -> Array:
    """Stress (p, 3) of the solid cantilever at the points: biquadratic elements, one centred at each."""
    judge = build_judge(cantilever(), points.x, points.half_length, split=1)
    solid = np.ones(len(points.x))
    stress = elasticity.stress(judge.model, judge(solid).u, solid)[:, 0, :3]
    in_order = np.empty_like(stress)
    in_order[judge.owner] = stress
    return in_order
