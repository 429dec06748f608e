"""Models of moved points; displacements and strains of finite elements at given positions."""

import numpy as np

from mpmtop.arrays import Array
from reference_fem.boundary import Locate
from reference_fem.elasticity import FemModel


def displacement_at(model: FemModel, u: Array, x: Array) -> Array:
    """Displacements (k, 2) at nodes x (k, 2)."""
    found = []
    for dofs in model.basis.split_indices():
        distance = np.hypot(*(model.basis.doflocs[:, dofs][:, None] - x.T[:, :, None]))
        found.append(u[dofs[distance.argmin(axis=1)]])
    return np.stack(found, axis=1)


def strain_at(model: FemModel, u: Array, x: Array, locate: Locate) -> Array:
    """Strains (k, 3), Voigt, at x (k, 2)."""
    basis = model.basis
    cell, reference = locate(basis, x)
    grad = np.zeros((2, 2, len(x)))
    for i in range(basis.Nbfun):
        function = basis.elem.gbasis(basis.mapping, reference[:, :, None], i, tind=cell)[0]
        grad += function.grad[..., 0] * u[basis.element_dofs[i, cell]]
    return np.stack([grad[0, 0], grad[1, 1], grad[0, 1] + grad[1, 0]], axis=1)
