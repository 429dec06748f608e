"""Symmetry demanded of a design: which variables are one."""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from mpmtop.arrays import Array, Index
from mpmtop.design import Mirror
from mpmtop.errors import InvalidScene

COINCIDES = 1e-6
"""Of a point's size: far above the rounding of an image, far below any arrangement that is meant."""


def orbits(mirrors: tuple[Mirror, ...], x: Array, half_length: Array, volume: Array) -> Index:
    """Number (a,), from 0 on, of the variable that each of the points x (a, 2) shares with its images.

    InvalidScene where a point's image is no point, or one of another volume: the filter would not be symmetric.
    """
    a = len(x)
    tree = KDTree(x)
    pairs = []
    for mirror in mirrors:
        distance, image = tree.query(mirror.image(x))
        alone = (distance > COINCIDES * half_length.min()) | (np.abs(volume[image] - volume) > COINCIDES * volume)
        if np.any(alone):
            raise InvalidScene(
                f"symmetry: {np.count_nonzero(alone)} of {a} points, the first at {x[alone][0]}, have no image of "
                f"their size in {mirror}: move the mirror, or choose points and passive regions that are symmetric"
            )
        pairs.append(image)
    graph = sp.coo_array(
        (np.ones(a * len(pairs)), (np.tile(np.arange(a), len(pairs)), np.concatenate(pairs))), shape=(a, a)
    )
    return connected_components(graph, directed=False)[1].astype(np.intp)
