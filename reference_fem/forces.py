"""Load vectors of what acts along the outline and by volume; what acts at places is in `boundary.nodal_forces`."""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from skfem import CellBasis

from mpmtop.arrays import Array
from mpmtop.errors import LoadOutsideBody
from mpmtop.loads import Action
from mpmtop.region import Region
from reference_fem.mesh import GEOMETRY_TOLERANCE, shortest_side
from reference_fem.outline import MeshKind, at_outline, outline


class Forces(NamedTuple):
    """Load vector f(rho) = fixed + weight rho, (N,), of densities rho (e,).

    `weight` (N, e) is None where no load follows the density. `size` is the sum of the absolute values of all forces,
    at density one, before any cancel.
    """

    fixed: Array
    weight: sp.csr_matrix | None
    size: float


def distributed(acts: Action, domain: Region, basis: CellBasis, kind: MeshKind) -> Forces:
    """int N t ds along the domain's outline, see `outline.at_outline`, and int N b dV by the Gauss rule of the element
    matrices. Raises LoadOutsideBody where there is no boundary or no element."""
    fixed, weight, size = np.zeros(basis.N), None, 0.0
    for piece in acts.along:
        on = outline(domain, piece.region, basis.mesh, kind)
        if len(on.x) == 0:
            lower, upper = piece.region.bounds
            raise LoadOutsideBody(
                f"no boundary of the domain lies in the region of a load from {lower} to {upper}: move the region"
            )
        force = on.length[:, None] * piece.traction(on.x, on.normal)
        fixed += at_outline(basis, on.x, kind).N.T @ force.ravel()
        size += float(np.abs(force).sum())
    if not acts.throughout:
        return Forces(fixed, weight, size)
    gauss = CellBasis(basis.mesh, basis.elem, intorder=basis.elem.maxdeg, dofs=basis.dofs)
    x = np.asarray(gauss.global_coordinates())  # (2, e, q)
    tol = GEOMETRY_TOLERANCE * shortest_side(basis.mesh)
    for part in acts.throughout:
        force = gauss.dx * part.at(x.reshape(2, -1).T, tol).T.reshape(x.shape)
        local = np.stack([np.sum(np.asarray(function[0]) * force, axis=(0, 2)) for function in gauss.basis])  # (d, e)
        size += float(np.abs(force).sum())
        if part.follows_density:
            element = np.broadcast_to(np.arange(local.shape[1]), local.shape)
            by_density = sp.csr_matrix(
                (local.ravel(), (gauss.element_dofs.ravel(), element.ravel())), shape=(basis.N, local.shape[1])
            )
            weight = by_density if weight is None else weight + by_density
        else:
            fixed += np.bincount(gauss.element_dofs.ravel(), local.ravel(), basis.N)
    return Forces(fixed, weight, size)
