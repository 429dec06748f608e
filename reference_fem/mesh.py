"""Meshes of equal quads on a lattice and the displacement bases on them (scikit-fem)."""

import numpy as np
from skfem import CellBasis, ElementQuad1, ElementQuad2, ElementVector, MeshQuad

from mpmtop.scene import Array, InvalidScene

GEOMETRY_TOLERANCE = 1e-9  # of the element size: far above rounding, far below any feature
ELEMENT_CENTRE = np.array([[0.5], [0.5]])  # reference coordinates (2, 1)


def lattice(bounds: tuple[Array, Array], size: Array) -> MeshQuad:
    """Quads of side `size` (2,) tiling a box from its lower to its upper corner, numbered along y first."""
    lower, upper = bounds
    if not np.all(size > 0):
        raise InvalidScene(f"element size {size}: give positive lengths")
    count = np.rint((upper - lower) / size).astype(int)
    if np.any(np.abs(count * size - (upper - lower)) > 1e-6 * size):  # a size typed to seven digits still fits
        raise InvalidScene(f"elements of size {size} do not divide a box of {upper - lower}: choose one that does")
    x, y = (np.linspace(lower[a], upper[a], count[a] + 1) for a in range(2))
    return MeshQuad.init_tensor(x, y)


def element_centres(mesh: MeshQuad) -> Array:
    """Centres (e, 2) of the elements."""
    return mesh.p[:, mesh.t].mean(axis=1).T


def element_sides(mesh: MeshQuad) -> Array:
    """Sides (e, 2) of the axis-aligned elements along x and y."""
    return (mesh.p[:, mesh.t[2]] - mesh.p[:, mesh.t[0]]).T


def vector_basis(mesh: MeshQuad, order: int) -> CellBasis:
    """Displacement basis, bilinear (order 1) or biquadratic (2), evaluated at the element centres only."""
    if order not in (1, 2):
        raise InvalidScene(f"element order {order}: say 1 (bilinear) or 2 (biquadratic)")
    element = ElementVector((ElementQuad1, ElementQuad2)[order - 1]())
    return CellBasis(mesh, element, quadrature=(ELEMENT_CENTRE, np.ones(1)))
