"""The solid cantilever as a beam cut into slices of one cell: what moved points do to its tip, without a grid."""

import numpy as np

from mpmtop.arrays import Array
from mpmtop.crossing import Crossing
from mpmtop.points import seed
from validation.bodies.scenes import SPACING, H, cantilever

LENGTH, HEIGHT = 40, 20
"""Of the cantilever [h]."""
EDGE = 1e-9
"""A point so near to the right end of a slice [h] is in the next one, as on the grid."""


def beam_rises(crossing: Crossing) -> dict[str, float]:
    """Rise of the tip displacement by method, of slices as springs in series.

    A slice that holds the part m of its material is softer by 1 / m, so the rise is sum_c w_c (1 / m_c - 1), w_c the
    share of slice c in the strain energy. Standard MPM counts the points that lie in a slice, GIMP what lies there of
    their domains: neighbours that move alike leave every slice its domains, and take points from it all the same.
    """
    counted, covered = material(crossing)
    share = energy_shares()
    return {name: float(share @ (1 / m - 1)) for name, m in (("standard", counted), ("GIMP", covered))}


def material(crossing: Crossing) -> tuple[Array, Array]:
    """Part of its material that every slice (c,) holds, by points and by domains."""
    body = cantilever().body.domain
    points = seed(body, (SPACING, SPACING))
    row = crossing(points, body).x[points.x[:, 1] < SPACING, 0]  # all rows move alike
    cell, half = np.arange(LENGTH)[:, None], SPACING / 2
    counted = np.sum((row >= cell - EDGE) & (row < cell + H - EDGE), axis=1) * SPACING / H
    overlap = np.minimum(row + half, cell + H) - np.maximum(row - half, cell)
    return counted, np.sum(np.maximum(overlap, 0), axis=1) / H


def energy_shares() -> Array:
    """Share of every slice (c,) in the strain energy of a solid Timoshenko beam under a tip force: plane strain, shear
    correction 5/6."""
    solid = cantilever().body.material
    bending = solid.young / (1 - solid.poisson**2) * HEIGHT**3 / 12
    shear = 5 / 6 * solid.young / (2 * (1 + solid.poisson)) * HEIGHT
    left = LENGTH - np.arange(LENGTH)  # lever arm of the tip force at a slice's left end
    energy = (left**3 - (left - 1) ** 3) / (3 * bending) + 1 / shear
    return energy / energy.sum()
