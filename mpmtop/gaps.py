"""Gaps that the grid does not see: nodes that tie points together which the body does not connect.

Functions reach over empty space. Where two sides of a slit, or two bodies, have a node in common they move as if glued
there, however fine the points show the gap. Two points are in contact if their domains touch, to half the width of the
narrower one: on a lattice the next width that a gap can have is a whole one. A node glues if the points that touch it
are not all connected by contacts among those that touch it or one of the eight nodes around it: what is connected
within one more cell is a hole or the root of a slit, no longer than the grid resolves.

Only nodes that miss a part of their volume are looked at, as a gap as wide as the narrowest point takes it from one.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from mpmtop.arrays import Array, Index, Mask
from mpmtop.grid import Grid
from mpmtop.points import MaterialPoints
from mpmtop.region import Region
from mpmtop.transfer import Transfer

TOUCH = 0.75
"""Points are in contact up to this part of the narrower one's width between them. Neighbours across a corner are 0.41
of it apart, a row of points that is missing leaves 1 at whatever angle, and points that were moved may come near that.
"""


class Gap(NamedTuple):
    """Nodes that glue over a gap: how many, their bounding box, and the gap's width [length] at `place` (2,) in it,
    which is zero where the points do not show it, only the domain between them does."""

    nodes: int
    lower: Array
    upper: Array
    place: Array
    width: float


def glued_gaps(grid: Grid, points: MaterialPoints, transfer: Transfer, domain: Region | None = None) -> list[Gap]:
    """All gaps that nodes glue, the longest first. With the `domain` that the points were seeded in, points whose
    middle lies outside of it are not in contact: a slit between two rows of points leaves no point out."""
    filled = transfer.N_matrix.T @ points.volume / np.prod(grid.h)
    narrowest = float((2 * points.half_length / grid.h).min())
    # the node nearest to a gap of width w has a function of at least 1/2 over most of it: w / 4 is on the safe side
    suspect = filled < 1 - narrowest / 4
    if domain is not None:
        cut = ~_joined(points, domain)
        suspect |= transfer.N_matrix.T @ cut.astype(float) > 0
    incidence = _incidence(transfer)  # (a, p)
    suspects = np.flatnonzero(suspect)
    node, _, piece = _pieces(points, incidence[suspects], domain)
    suspects = suspects[_in_parts(node, piece, len(suspects))]
    if len(suspects) == 0:
        return []
    around = incidence.T @ _ring(grid, transfer, suspects)  # (p, suspects)
    node, point, piece = _pieces(points, sp.csr_array(around.T), domain)
    touching = np.asarray(incidence[suspects[node], point]).ravel() > 0
    node, point, piece = node[touching], point[touching], piece[touching]
    glues = _in_parts(node, piece, len(suspects))
    if not np.any(glues):
        return []
    glued = np.flatnonzero(glues)
    line = np.stack(np.divmod(transfer.nodes[suspects[glued]], grid.nodes[1]), axis=1)
    near = KDTree(line).query_pairs(1.5, output_type="ndarray")
    count, group = connected_components(_graph(near, len(glued)), directed=False)
    position = grid.node_positions(transfer.nodes[suspects[glued]])
    gaps = []
    for g in range(count):
        of_gap = np.flatnonzero(group == g)
        middle = of_gap[np.argmin(np.abs(position[of_gap] - position[of_gap].mean(axis=0)).sum(axis=1))]
        at_node = node == glued[middle]
        width = _width(points, point[at_node], piece[at_node])
        box = position[of_gap].min(axis=0), position[of_gap].max(axis=0)
        gaps.append(Gap(len(of_gap), *box, position[middle], width))
    return sorted(gaps, key=lambda gap: -gap.nodes)


def _incidence(transfer: Transfer) -> sp.csr_array:
    """Which point touches which node, (a, p), as ones."""
    point, k = np.nonzero(transfer.touched)
    shape = len(transfer.nodes), len(transfer.touched)
    return sp.csr_array((np.ones(len(point)), (transfer.stencil[point, k], point)), shape=shape)


def _ring(grid: Grid, transfer: Transfer, node: Index) -> sp.csr_array:
    """The nodes (n,) and the eight around each, as ones (a, n)."""
    row = grid.nodes[1]
    offset = (row * np.arange(-1, 2)[:, None] + np.arange(-1, 2)).ravel()
    wanted = transfer.nodes[node][:, None] + offset
    place = np.minimum(np.searchsorted(transfer.nodes, wanted), len(transfer.nodes) - 1)
    column, _ = np.nonzero(there := transfer.nodes[place] == wanted)
    return sp.csr_array((np.ones(len(column)), (place[there], column)), shape=(len(transfer.nodes), len(node)))


def _joined(points: MaterialPoints, domain: Region) -> Mask:
    """Which points (p,) have all four sides of their domain inside the body's domain."""
    tol = 1e-9 * float(points.half_length.min())
    inside = np.ones(len(points.x), dtype=bool)
    for axis in (0, 1):
        for side in (-1, 1):
            step = np.zeros_like(points.x)
            step[:, axis] = side * points.half_length[:, axis]
            inside &= domain.contains(points.x + step, tol)
    return inside


def _contacts(points: MaterialPoints, among: Index, domain: Region | None) -> Index:
    """Pairs (c, 2) of the points `among` (m,) in contact, by their place in it.

    Sizes that differ by more than a factor of two are searched apart, or a fine point would meet all others within a
    coarse one's reach.
    """
    half = points.half_length[among]
    shape = np.median(half, axis=0)
    x, radius = points.x[among] / shape, np.max(half / shape, axis=1)
    size = np.floor(np.log2(radius / radius.min()) + 1e-9)
    found = [np.empty((0, 2), np.intp)]
    for level in np.unique(size):
        coarse, finer = np.flatnonzero(size == level), np.flatnonzero(size < level)
        reach = (2 + 2 * TOUCH) * radius[coarse].max()
        tree = KDTree(x[coarse])
        found.append(coarse[tree.query_pairs(reach, output_type="ndarray")])
        if len(finer) > 0:
            near = tree.sparse_distance_matrix(KDTree(x[finer]), reach, output_type="ndarray")
            found.append(np.stack([coarse[near["i"]], finer[near["j"]]], axis=1))
    p, q = np.concatenate(found).T
    apart = np.hypot(*(x[p] - x[q]).T) - radius[p] - radius[q]
    touch = apart <= 2 * TOUCH * np.minimum(radius[p], radius[q])
    p, q = p[touch], q[touch]
    if domain is not None:
        middle = (points.x[among[p]] + points.x[among[q]]) / 2
        inside = domain.contains(middle, 1e-9 * float(half.min()))
        p, q = p[inside], q[inside]
    return np.stack([p, q], axis=1)


def _pieces(points: MaterialPoints, incidence: sp.csr_array, domain: Region | None) -> tuple[Index, Index, Index]:
    """Node, point and piece of every entry of `incidence` (n, p), (k,) each: entries of one node are in one piece if
    contacts connect their points among the points of that node."""
    node, point = np.repeat(np.arange(incidence.shape[0]), np.diff(incidence.indptr)), incidence.indices
    among, local = np.unique(point, return_inverse=True)
    pair = _contacts(points, among, domain)
    m = len(among)
    order = np.argsort(node * m + local)
    node, point, local = node[order], point[order], local[order]
    key = node * m + local
    # every node of the first point of each contact, and whether the second one is there, too
    by_point = np.argsort(local, kind="stable")
    count = np.bincount(local, minlength=m)
    end, many = np.cumsum(count)[pair[:, 0]], count[pair[:, 0]]
    contact = np.repeat(np.arange(len(pair)), many)
    entry = by_point[np.repeat(end - np.cumsum(many), many) + np.arange(len(contact))]
    wanted = node[entry] * m + pair[contact, 1]
    other = np.minimum(np.searchsorted(key, wanted), len(key) - 1)
    there = key[other] == wanted
    edges = np.stack([entry[there], other[there]], axis=1)
    return node, point, connected_components(_graph(edges, len(key)), directed=False)[1]


def _graph(pairs: Index, n: int) -> sp.coo_array:
    return sp.coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(n, n))


def _in_parts(node: Index, piece: Index, n: int) -> Mask:
    """Which of n nodes have entries in more than one piece."""
    first = np.unique(piece, return_index=True)[1]
    return np.bincount(node[first], minlength=n) > 1


def _width(points: MaterialPoints, point: Index, piece: Index) -> float:
    """Distance of the domains of the first piece's points from those of all others."""
    x, half = points.x[point], points.half_length[point]
    one, other = np.flatnonzero(piece == piece[0]), np.flatnonzero(piece != piece[0])
    between = np.abs(x[one, None] - x[other]) - half[one, None] - half[other]
    return float(np.hypot(*np.moveaxis(np.maximum(between, 0), -1, 0)).min())
