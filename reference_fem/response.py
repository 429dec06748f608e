"""What a criterion of one's own sees of a finite element solution: positions, displacement, strain, stress."""

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array
from mpmtop.body import Elastic
from reference_fem.elasticity import FemModel, basis_at, lame
from reference_fem.mesh import ELEMENT_CENTRE


def displacement_operator(model: FemModel, reference: Array = ELEMENT_CENTRE) -> sp.csr_matrix:
    """N (2 e q, N): N u is the displacement (e, q, 2) at reference positions (2, q) of every element."""
    basis = basis_at(model, reference)
    values = np.stack([np.moveaxis(np.asarray(function[0]), 0, -1) for function in basis.basis])  # (d, e, q, 2)
    rows = np.broadcast_to(np.arange(values[0].size).reshape(values.shape[1:]), values.shape)
    columns = np.broadcast_to(basis.element_dofs[:, :, None, None], values.shape)
    return sp.csr_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape=(values[0].size, basis.N))


def positions_in(model: FemModel, reference: Array = ELEMENT_CENTRE) -> Array:
    """Where the reference positions (2, q) of every element are, (e q, 2)."""
    return np.asarray(basis_at(model, reference).global_coordinates()).reshape(2, -1).T


def solid_tangent(constants: Elastic) -> Array:
    """C (1, 3, 3), or (e, 3, 3) of several materials, with sigma = C eps, (xx, yy, xy) of (xx, yy, 2 xy), of solid
    material."""
    lam, mu = np.broadcast_arrays(*(constants.young * constant for constant in lame(constants)))
    none = np.zeros_like(mu)
    rows = np.array([[lam + 2 * mu, lam, none], [lam, lam + 2 * mu, none], [none, none, mu]])
    return rows.reshape(3, 3, -1).transpose(2, 0, 1)
