"""A mesh of quads for a rectangle with a circular hole: a lattice, and around the hole an O-grid that fits it."""

import numpy as np
from skfem import MeshQuad

from mpmtop.arrays import Array, Index
from mpmtop.errors import InvalidScene
from reference_fem.mesh import GEOMETRY_TOLERANCE, element_centres, element_sides, lattice


def around_hole(
    lower: tuple[float, float],
    upper: tuple[float, float],
    centre: tuple[float, float],
    radius: float,
    size: float | tuple[float, float],
) -> MeshQuad:
    """Quads over the rectangle without the circle, conforming and convex, corners counterclockwise.

    Outside a box around the hole they are lattice cells of side `size`. The box is the largest square about the centre
    that the rectangle holds, widened to lattice lines. From each lattice node on its perimeter, R from the centre, a
    ray runs to the circle, with nodes at radius (R / radius)^(k/m), k = 0 to m: all elements along a ray are alike in
    shape, and m makes them square on average. Any two rays bound convex quads.

    The circle is replaced by the chords between its nodes: with n of them the mesh covers too much by
    radius^2 sum(angle - sin angle) / 2 = O(1 / n^2). Raises InvalidScene for a hole that is narrower than a cell or
    nearer than half a cell to an edge of the rectangle, and if cells of this size do not divide the rectangle.
    """
    cells = lattice((np.array(lower, float), np.array(upper, float)), np.broadcast_to(np.asarray(size, float), 2))
    sides = element_sides(cells)[0]
    middle = np.array(centre, float)
    reach = float(np.min([middle - lower, upper - middle]))
    if not 2 * radius >= sides.max() * (1 - GEOMETRY_TOLERANCE):  # also catches NaN
        raise InvalidScene(
            f"hole of radius {radius}: its diameter is below a cell's side {sides.max()}, use smaller ones"
        )
    if not reach - radius >= sides.max() / 2 * (1 - GEOMETRY_TOLERANCE):
        raise InvalidScene(
            f"hole of radius {radius} at {centre} comes nearer than half a cell to the edge of the rectangle {lower} "
            f"to {upper}: shrink it or move it inwards, or use smaller cells"
        )
    count = np.rint(np.subtract(upper, lower) / sides).astype(int)
    first = np.maximum(np.floor((middle - reach - lower) / sides + GEOMETRY_TOLERANCE).astype(int), 0)
    last = np.minimum(np.ceil((middle + reach - lower) / sides - GEOMETRY_TOLERANCE).astype(int), count)
    box_lower, box_upper = lower + first * sides, lower + last * sides
    outside = np.any((element_centres(cells) < box_lower) | (element_centres(cells) > box_upper), axis=1)
    perimeter = _perimeter(first, last, count[1] + 1)
    p, ring = _o_grid(cells.p, perimeter, middle, radius)
    t = np.hstack([cells.t[::-1, outside], ring])  # the lattice's corners run clockwise
    return MeshQuad(p, np.ascontiguousarray(t)).remove_unused_nodes()


def _perimeter(first: Index, last: Index, column: int) -> Index:
    """Nodes (n,) of a box of lattice lines, counterclockwise, for nodes numbered in columns along y."""
    (i0, j0), (i1, j1) = first, last
    i = np.concatenate([np.arange(i0, i1), np.full(j1 - j0, i1), np.arange(i1, i0, -1), np.full(j1 - j0, i0)])
    j = np.concatenate([np.full(i1 - i0, j0), np.arange(j0, j1), np.full(i1 - i0, j1), np.arange(j1, j0, -1)])
    return i * column + j


def _o_grid(p: Array, perimeter: Index, centre: Array, radius: float) -> tuple[Array, Index]:
    """Nodes p (2, v) with those of the rays from the perimeter (n,) to the circle added, and the quads between them."""
    ray = p[:, perimeter] - centre[:, None]
    R = np.hypot(*ray)
    ahead, behind = np.roll(ray, -1, axis=1), np.roll(ray, 1, axis=1)
    angle = np.arctan2(behind[0] * ahead[1] - behind[1] * ahead[0], np.sum(behind * ahead, axis=0)) / 2
    stretch = np.log(R / radius) / angle  # layers that would make the elements of a ray square
    layers = max(1, round(float(np.exp(np.mean(np.log(stretch))))))
    k = np.arange(layers)[:, None] / layers
    inner = centre[:, None, None] + ray[:, None] / R * radius * (R / radius) ** k  # (2, m, n)
    n = len(perimeter)
    node = np.vstack([p.shape[1] + np.arange(layers * n).reshape(layers, n), perimeter])
    following = np.roll(node, -1, axis=1)
    quads = np.stack([node[:-1], node[1:], following[1:], following[:-1]])
    return np.hstack([p, inner.reshape(2, -1)]), quads.reshape(4, -1)
