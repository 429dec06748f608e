"""Supports and loads of a scene on a finite element mesh."""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from skfem import CellBasis

from mpmtop.scene import Array, LoadOutsideBody, Mask, Scene, UnsupportedBody
from reference_fem.mesh import GEOMETRY_TOLERANCE, element_centres, element_sides


def held_dofs(scene: Scene, basis: CellBasis, tol: float) -> Mask:
    """Which of the dofs (N,) the supports hold. Raises UnsupportedBody if they leave a part of the body free."""
    components = basis.split_indices()
    x = basis.doflocs.T
    held = np.zeros(basis.N, bool)
    for support in scene.supports:
        inside = support.region.contains(x, tol)
        if not inside.any():
            raise UnsupportedBody(f"a support of {scene.name!r} holds no node: move or enlarge it to reach the mesh")
        for dofs, fixed in zip(components, support.fixed, strict=True):
            held[dofs] |= fixed & inside[dofs]
    _check_rigid_motions(basis, held)
    return held


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
    loose = np.count_nonzero(np.linalg.matrix_rank(gram, hermitian=True) < 3)
    if loose:
        raise UnsupportedBody(
            f"{loose} of {parts} connected part(s) of the body can move rigidly: hold both components, at two nodes or "
            "more in all, of each part"
        )


def nodal_forces(basis: CellBasis, x: Array, forces: Array) -> Array:
    """Load vector (N,) of forces (k, 2) at positions x (k, 2) of lattice quads, through the basis evaluated there.

    A position on an edge or a corner may be taken in any element that touches it: the basis is continuous. Raises
    LoadOutsideBody for a position in no element.
    """
    sides = element_sides(basis.mesh)
    distance, cell = cKDTree(element_centres(basis.mesh) / sides.min(axis=0)).query(x / sides.min(axis=0), p=np.inf)
    if np.any(distance > 0.5 + GEOMETRY_TOLERANCE):
        raise LoadOutsideBody(
            f"a load acts at {x[np.argmax(distance)]}, where there is no element: move it onto the body"
        )
    corner, along, _, across = np.moveaxis(basis.mesh.p[:, basis.mesh.t[:, cell]], 0, -1)  # each (k, 2)
    axes = np.stack([along - corner, across - corner], axis=-1)  # scikit-fem's first axis need not be x
    reference = np.linalg.solve(axes, (x - corner)[:, :, None])[:, :, 0]
    f = np.zeros(basis.N)
    for i in range(basis.Nbfun):
        N = basis.elem.gbasis(basis.mapping, reference.T[:, :, None], i, tind=cell)[0][:, :, 0]
        f += np.bincount(basis.element_dofs[i, cell], np.sum(N.T * forces, axis=1), basis.N)
    return f
