"""The basis on the outline of the body, which elements need not reach, and what acts there."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree
from skfem import CellBasis, MeshQuad

from mpmtop.arrays import Array, Index
from mpmtop.errors import LoadOutsideBody
from mpmtop.outline import Surface, surface
from mpmtop.region import Region
from reference_fem.boundary import Locate, locate_in_lattice, locate_in_mesh, reference_in_lattice, reference_in_mesh
from reference_fem.mesh import element_centres, shortest_side

REACH = 1.0  # of an element's longest side: how far the outline may be from the nearest element
NEAREST = 16  # centres, one of them that of the element nearest to a position so near


class MeshKind(NamedTuple):
    """What differs between a lattice of quads and any other mesh.

    locate      basis, positions (k, 2) -> the elements (k,) that hold them, and reference coordinates (2, k)
    reference   basis, elements (k,), positions (k, 2) -> reference coordinates (2, k)
    lines       mesh -> coordinates (m,) along x and along y at which an outline is cut to be integrated over
    """

    locate: Locate
    reference: Callable[[CellBasis, Index, Array], Array]
    lines: Callable[[MeshQuad], tuple[Array, Array]]


def _lattice_lines(mesh: MeshQuad) -> tuple[Array, Array]:
    return np.unique(mesh.p[0]), np.unique(mesh.p[1])


def even_lines(mesh: MeshQuad) -> tuple[Array, Array]:
    """Lines a shortest side apart, as edges may run anywhere: kinks of the functions are then met to that."""
    side = shortest_side(mesh)
    x, y = (np.arange(a.min(), a.max() + side, side) for a in mesh.p)
    return x, y


LATTICE = MeshKind(locate_in_lattice, reference_in_lattice, _lattice_lines)
ANY_MESH = MeshKind(locate_in_mesh, reference_in_mesh, even_lines)


class AtOutline(NamedTuple):
    """Displacement N u (2k,) and strain B u (3k,), (xx, yy, 2 xy), at k positions, each in the functions of `element`
    (k,)."""

    element: Index
    N: sp.csr_matrix
    B: sp.csr_matrix


def outline(domain: Region, region: Region, mesh: MeshQuad, kind: MeshKind) -> Surface:
    """The part of the domain's outline in `region`, to integrate over."""
    return surface(domain, region, kind.lines(mesh))


def at_outline(basis: CellBasis, x: Array, kind: MeshKind) -> AtOutline:
    """The basis at positions x (k, 2) of the outline, in the nearest element each.

    Outside of it the functions are continued linearly from its nearest position x0, N(x0) + grad N(x0) . (x - x0), so
    that they sum to one and reproduce linear fields: an outline need not follow stairs or chords. Raises
    LoadOutsideBody where the nearest element is further than REACH.
    """
    mesh, (k, n) = basis.mesh, (len(x), basis.Nbfun)
    tree = cKDTree(element_centres(mesh))
    near = tree.query(x, k=np.arange(1, min(NEAREST, mesh.t.shape[1]) + 1))[1]
    many = near.shape[1]
    on = _nearest_in(mesh, near.ravel(), np.repeat(x, many, axis=0)).reshape(k, many, 2)
    distance = np.hypot(*np.moveaxis(on - x[:, None], -1, 0))
    # of elements as near as each other the one with the nearest centre
    first = np.argmin(np.rint(distance / (1e-9 * shortest_side(mesh))), axis=1)
    at = np.arange(k), first
    corners = mesh.p[:, mesh.t[:, near[at]]]
    reach = REACH * np.hypot(*(np.roll(corners, -1, axis=1) - corners)).max(axis=0)
    if np.any(distance[at] > reach):
        far = x[np.argmax(distance[at] - reach)]
        raise LoadOutsideBody(f"no element within {REACH:g} sides of the outline at {far}: use smaller elements")
    element, x0 = near[at], on[at]
    place = np.clip(kind.reference(basis, element, x0), 0, 1)
    value, strain = np.zeros((k, 2, n)), np.zeros((k, 3, n))
    for i in range(n):
        field = basis.elem.gbasis(basis.mapping, place[:, :, None], i, tind=element)[0]
        grad = np.asarray(field.grad)[..., 0]  # (2, 2, k), d u_i / d x_j
        value[:, :, i] = np.asarray(field)[:, :, 0].T + np.einsum("ijk,kj->ki", grad, x - x0)
        strain[:, :, i] = np.stack([grad[0, 0], grad[1, 1], grad[0, 1] + grad[1, 0]], axis=1)
    return AtOutline(element, _rows(value, basis, element), _rows(strain, basis, element))


def _rows(values: Array, basis: CellBasis, element: Index) -> sp.csr_matrix:
    """(k v, N) of values (k, v, n) of the elements' functions."""
    k, v, n = values.shape
    column = np.broadcast_to(basis.element_dofs[:, element].T[:, None], values.shape)
    return sp.csr_matrix((values.ravel(), column.ravel(), n * np.arange(k * v + 1)), shape=(k * v, basis.N))


def _nearest_in(mesh: MeshQuad, cell: Index, x: Array) -> Array:
    """The position (k, 2) in each convex element (k,) that is nearest to x (k, 2): x itself where that is inside."""
    start = mesh.p[:, mesh.t[:, cell]]  # (2, 4, k)
    along = np.roll(start, -1, axis=1) - start
    arm = x.T[:, None] - start
    turn = along[0] * arm[1] - along[1] * arm[0]
    inside = np.all(turn >= 0, axis=0) | np.all(turn <= 0, axis=0)
    t = np.clip(np.sum(along * arm, axis=0) / np.sum(along**2, axis=0), 0, 1)
    on = start + t * along
    edge = np.argmin(np.hypot(*(on - x.T[:, None])), axis=0)
    return np.where(inside[:, None], x, on[:, edge, np.arange(len(x))].T)
