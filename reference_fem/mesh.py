"""Meshes of quads, those of a lattice above all, and the displacement bases on them (scikit-fem)."""

import numpy as np
from skfem import CellBasis, ElementQuad1, ElementQuad2, ElementVector, MeshQuad

from mpmtop.arrays import Array
from mpmtop.errors import EmptyDomain, InvalidScene
from mpmtop.region import Region, divisions

GEOMETRY_TOLERANCE = 1e-9  # of the element size: far above rounding, far below any feature
ELEMENT_CENTRE = np.array([[0.5], [0.5]])  # reference coordinates (2, 1)


def lattice(bounds: tuple[Array, Array], size: Array) -> MeshQuad:
    """Quads of side `size` (2,) tiling a box from its lower to its upper corner, numbered along y first."""
    (lower, upper), count = bounds, divisions("element size", bounds, size)
    x, y = (np.linspace(lower[a], upper[a], count[a] + 1) for a in range(2))
    return MeshQuad.init_tensor(x, y)


def element_centres(mesh: MeshQuad) -> Array:
    """Centres (e, 2) of the elements."""
    return mesh.p[:, mesh.t].mean(axis=1).T


def element_sides(mesh: MeshQuad) -> Array:
    """Sides (e, 2) of the axis-aligned elements along x and y."""
    return (mesh.p[:, mesh.t[2]] - mesh.p[:, mesh.t[0]]).T


def element_areas(mesh: MeshQuad) -> Array:
    """Areas (e,) of the elements, which have straight sides: half the product of the diagonals."""
    (ax, ay), (bx, by) = (mesh.p[:, mesh.t[i + 2]] - mesh.p[:, mesh.t[i]] for i in (0, 1))
    return np.abs(ax * by - ay * bx) / 2


def shortest_side(mesh: MeshQuad) -> float:
    """Length of the shortest of all sides of all elements."""
    corners = mesh.p[:, mesh.t]
    return float(np.hypot(*(np.roll(corners, -1, axis=1) - corners)).min())


def corner_jacobians(mesh: MeshQuad) -> Array:
    """Determinant of the bilinear map at the corners (4, e): of one sign in an element that is convex.

    It is linear along each axis, so that it then keeps this sign throughout, positive if the corners run
    counterclockwise.
    """
    corners = mesh.p[:, mesh.t]
    (ax, ay), (bx, by) = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    return ax * by - ay * bx


def domain_lattice(domain: Region, size: Array) -> MeshQuad:
    """Lattice quads of side `size` (2,) whose centre is in the domain; EmptyDomain if there is none."""
    mesh = lattice(domain.bounds, size)
    keep = domain.contains(element_centres(mesh))
    if not keep.any():
        raise EmptyDomain(f"no element of size {size} has its centre in the domain: use smaller ones")
    return mesh.restrict(np.flatnonzero(keep))


def check_mesh(domain: Region, mesh: MeshQuad) -> None:
    """Raise InvalidScene if the mesh is not of straight-sided quads, or these are not convex or lie outside the domain
    by more than a chord may."""
    if type(mesh) is not MeshQuad:
        raise InvalidScene(f"mesh of {type(mesh).__name__}: give straight-sided quads, skfem.MeshQuad")
    jacobians, centres = corner_jacobians(mesh), element_centres(mesh)
    folded = jacobians.min(axis=0) * jacobians.max(axis=0) <= 0
    if folded.any():
        raise InvalidScene(
            f"{np.count_nonzero(folded)} of {len(folded)} quads of the mesh are not convex, the first at "
            f"{centres[folded][0]}: move their nodes"
        )
    outside = ~domain.contains(centres, shortest_side(mesh))  # chords cut into a curved edge
    if outside.any():
        raise InvalidScene(
            f"{np.count_nonzero(outside)} of {len(outside)} quads of the mesh lie outside the domain, "
            f"the first at {centres[outside][0]}: mesh the domain, or change it"
        )


def vector_basis(mesh: MeshQuad, order: int) -> CellBasis:
    """Displacement basis, bilinear (order 1) or biquadratic (2), evaluated at the element centres only."""
    if order not in (1, 2):
        raise InvalidScene(f"element order {order}: say 1 (bilinear) or 2 (biquadratic)")
    element = ElementVector((ElementQuad1, ElementQuad2)[order - 1]())
    return CellBasis(mesh, element, quadrature=(ELEMENT_CENTRE, np.ones(1)))
