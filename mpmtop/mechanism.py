"""Mechanisms: where a body can move without resistance, said in the words of the body."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from mpmtop.arrays import Array
from mpmtop.errors import UnsupportedBody
from mpmtop.model import Model
from mpmtop.solvers import SingularMatrix

CONNECTS = 1e-7
"""Points softer than this part of the stiffest tie nothing to a support: only used to say what floats."""


@contextmanager
def mechanism_named(model: Model, moduli: Array) -> Iterator[None]:
    """Turn a SingularMatrix within into UnsupportedBody, naming the node and the island it belongs to."""
    try:
        yield
    except SingularMatrix as error:
        raise UnsupportedBody(
            f"the body can move without resistance: {place(model, moduli, error.unknown)}, carries no stiffness; hold "
            "the body there, connect it to a support, or raise E_min / E0 (`contrast`)"
        ) from error


def place(model: Model, moduli: Array, unknown: int) -> str:
    """In words: the unknown's node, and the island of points it belongs to if no support holds a node of that."""
    dof = model.stiffness.dof[unknown]
    transfer, position = model.transfer, model.points.x
    x, y = model.grid.node_positions(transfer.nodes[dof // 2])
    named = f"displacement {'xy'[dof % 2]} of the node at ({x:g}, {y:g})"
    a, p = len(transfer.nodes), len(moduli)
    stiff = moduli > CONNECTS * np.max(moduli)
    point, k = np.nonzero(transfer.touched & stiff[:, None])
    ties = sp.coo_array((np.ones(len(point)), (transfer.stencil[point, k], a + point)), shape=(a + p, a + p))
    piece = connected_components(ties, directed=False)[1]
    with_it = piece == piece[dof // 2]
    island = np.flatnonzero(with_it[a:] & stiff)
    supported = np.ones(2 * a, dtype=bool)
    supported[model.stiffness.dof] = False
    if len(island) == 0:
        return f"{named}, where all material is void"
    if np.any(supported.reshape(-1, 2)[with_it[:a]]):
        return named
    (x0, y0), (x1, y1) = position[island].min(axis=0), position[island].max(axis=0)
    extent = f"{len(island)} points from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g})"
    return f"{named}, on an island that no support holds, of {extent}"
