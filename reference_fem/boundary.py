"""Supports and loads of a body on a finite element mesh."""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from skfem import CellBasis, MeshQuad

from mpmtop.arrays import Array, Index, Mask
from mpmtop.body import Body, Support
from mpmtop.errors import InvalidScene, LoadOutsideBody, UnsupportedBody
from reference_fem.mesh import GEOMETRY_TOLERANCE, corner_jacobians, element_centres, element_sides, shortest_side

Locate = Callable[[CellBasis, Array], tuple[Index, Array]]


def held_dofs(body: Body, basis: CellBasis, tol: float) -> Mask:
    """Which of the dofs (N,) the supports hold. Raises UnsupportedBody if they leave a part of the body free, which a
    body on springs or held edges may be until it is factored."""
    components = basis.split_indices()
    x = basis.doflocs.T
    held = np.zeros(basis.N, bool)
    for support in body.held:
        inside = support.region.contains(x, tol)
        if not inside.any():
            lower, upper = support.region.bounds
            raise UnsupportedBody(
                f"the support from {lower} to {upper} holds no node: move or enlarge it to reach the mesh"
            )
        for dofs, fixed in zip(components, support.fixed, strict=True):
            held[dofs] |= fixed & inside[dofs]
    if not (body.edges or body.springs):
        _check_rigid_motions(basis, held)
    return held


def prescribed(supports: tuple[Support, ...], basis: CellBasis, tol: float) -> Array:
    """Displacements (N,) that supports prescribe, zero elsewhere; InvalidScene where two disagree."""
    x = basis.doflocs.T
    value, given = np.zeros(basis.N), np.zeros(basis.N, bool)
    for support in supports:
        inside = support.region.contains(x, tol)
        for dofs, fixed, u in zip(basis.split_indices(), support.fixed, support.displacement, strict=True):
            own = dofs[inside[dofs]] if fixed else dofs[:0]
            if np.any(given[own] & (value[own] != u)):
                raise InvalidScene(f"two supports displace the node at {x[own][0]} differently: move one of them")
            value[own], given[own] = u, True
    return value


def _check_rigid_motions(basis: CellBasis, held: Mask) -> None:
    """Raise UnsupportedBody if the held dofs leave a part of the mesh a rigid motion: held motions of rank below 3."""
    pairs = (np.repeat(basis.element_dofs[0], basis.Nbfun), basis.element_dofs.T.ravel())
    graph = sp.coo_matrix((np.ones(len(pairs[0])), pairs), shape=(basis.N, basis.N))
    parts, part = connected_components(graph, directed=False)
    xy = (basis.doflocs - basis.doflocs.mean(axis=1)[:, None]) / np.ptp(basis.doflocs)
    motion = np.zeros((basis.N, 3))  # translation in x, in y, rotation
    for a, dofs in enumerate(basis.split_indices()):
        motion[dofs, a] = 1.0
        motion[dofs, 2] = (-xy[1, dofs], xy[0, dofs])[a]
    gram = np.zeros((parts, 3, 3))
    np.add.at(gram, part[held], motion[held, :, None] * motion[held, None, :])
    loose = np.flatnonzero(np.linalg.matrix_rank(gram, hermitian=True) < 3)
    if len(loose):
        around = basis.doflocs[:, part == loose[0]].mean(axis=1)
        raise UnsupportedBody(
            f"{len(loose)} of {parts} connected part(s) of the body can move rigidly, the first around {around}: hold "
            "both components, at two nodes or more in all, of each part, or take the part out of the domain"
        )


def locate_in_lattice(basis: CellBasis, x: Array) -> tuple[Index, Array]:
    """Element (k,) of lattice quads that holds each position x (k, 2), and where in it: reference coordinates (2, k).

    A position on an edge or a corner may be taken in any element that touches it: the basis is continuous. Raises
    LoadOutsideBody for a position in no element.
    """
    sides = element_sides(basis.mesh)
    distance, cell = cKDTree(element_centres(basis.mesh) / sides.min(axis=0)).query(x / sides.min(axis=0), p=np.inf)
    _check_inside(x, distance <= 0.5 + GEOMETRY_TOLERANCE)
    return cell, reference_in_lattice(basis, cell, x)


def reference_in_lattice(basis: CellBasis, cell: Index, x: Array) -> Array:
    """Reference coordinates (2, k) of positions x (k, 2) in elements (k,) of a lattice."""
    corner, along, _, across = np.moveaxis(basis.mesh.p[:, basis.mesh.t[:, cell]], 0, -1)  # each (k, 2)
    # scikit-fem's first axis need not be x; by projection, as each is along x or y, and not by LAPACK: a last bit of
    # the load would make another fingerprint
    axes = np.stack([along - corner, across - corner])  # (2, k, 2)
    return np.sum(axes * (x - corner), axis=-1) / np.sum(axes**2, axis=-1)


def reference_in_mesh(basis: CellBasis, cell: Index, x: Array) -> Array:
    """The same in convex quads of any shape, by Newton's method on the bilinear map."""
    # Newton's error is the square of its last step; a position outside by the tolerance is moved onto the edge
    return basis.mapping.invF(x.T[:, :, None], cell, newton_tol=10 * GEOMETRY_TOLERANCE)[:, :, 0]


def locate_in_mesh(basis: CellBasis, x: Array) -> tuple[Index, Array]:
    """The same as `locate_in_lattice` for convex quads of any shape, by Newton's method on the bilinear map.

    A position is in the element of the nearest centre or, where that is another one, in the one it is deepest in among
    those with a centre as near as that of an element around the position can be.
    """
    centres = element_centres(basis.mesh)
    tree = cKDTree(centres)
    cell = tree.query(x)[1]
    elsewhere = np.flatnonzero(_depth(basis.mesh, cell, x) < 0)
    if len(elsewhere):
        reach = float(np.hypot(*(basis.mesh.p[:, basis.mesh.t] - centres.T[:, None])).max())
        near = cKDTree(x[elsewhere]).sparse_distance_matrix(tree, reach, output_type="coo_matrix")
        depth = _depth(basis.mesh, near.col, x[elsewhere[near.row]])
        deepest_last = np.argsort(depth)
        cell[elsewhere[near.row[deepest_last]]] = near.col[deepest_last]  # the last one stays
    _check_inside(x, _depth(basis.mesh, cell, x) >= -GEOMETRY_TOLERANCE * shortest_side(basis.mesh))
    return cell, reference_in_mesh(basis, cell, x)


def _depth(mesh: MeshQuad, cell: Index, x: Array) -> Array:
    """Distance (k,) of each position x (k, 2) to the nearest edge line of its convex element (k,), negative outside."""
    corners = mesh.p[:, mesh.t[:, cell]]
    (ax, ay), (bx, by) = np.roll(corners, -1, axis=1) - corners, x.T[:, None] - corners
    clockwise = corner_jacobians(mesh)[0, cell] < 0
    return np.min(np.where(clockwise, -1, 1) * (ax * by - ay * bx) / np.hypot(ax, ay), axis=0)


def _check_inside(x: Array, inside: Mask) -> None:
    if not inside.all():
        raise LoadOutsideBody(f"a load acts at {x[~inside][0]}, where there is no element: move it onto the body")


def nodal_forces(basis: CellBasis, x: Array, forces: Array, locate: Locate = locate_in_lattice) -> Array:
    """Load vector (N,) of forces (k, 2) at positions x (k, 2), through the basis evaluated where `locate` finds them.

    Raises LoadOutsideBody for a position in no element.
    """
    cell, reference = locate(basis, x)
    f = np.zeros(basis.N)
    for i in range(basis.Nbfun):
        N = basis.elem.gbasis(basis.mapping, reference[:, :, None], i, tind=cell)[0][:, :, 0]
        f += np.bincount(basis.element_dofs[i, cell], np.sum(N.T * forces, axis=1), basis.N)
    return f
