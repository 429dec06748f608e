"""Displacements, strains and forces at given positions of a body, whichever method analysed it."""

from dataclasses import dataclass

import numpy as np

from mpmtop.arrays import Array, Index
from mpmtop.body import Body
from mpmtop.model import Model
from mpmtop.points import MaterialPoints
from mpmtop.transfer import Transfer, transfer
from reference_fem.boundary import Locate
from reference_fem.elasticity import FemModel

INSIDE = 1e-9
"""Positions on the edge of the body are taken this far within it [h]: a cell on the other side holds no point."""


@dataclass(frozen=True, eq=False)
class Probe:
    """Positions (k, 2) in the body of a model where its displacement and strain are wanted, or where forces act."""

    operators: Transfer
    place: Index  # of the operators' nodes among the model's
    k: int

    def displacement(self, u: Array) -> Array:
        """(k, 2), of nodal displacements u (2a,) of the model."""
        return self.operators.interpolate(self._nodal(u))[: self.k]

    def strain(self, u: Array) -> Array:
        """(k, 3), Voigt."""
        return self.operators.strain(self._nodal(u))[: self.k]

    def force(self, forces: Array, a: int) -> Array:
        """Nodal forces (2a,) of forces (k, 2) at the positions, for a model of a nodes."""
        f = np.zeros((a, 2))
        f[self.place] = self.operators.N_matrix[: self.k].T @ forces
        return f.ravel()

    def _nodal(self, u: Array) -> Array:
        return u.reshape(-1, 2)[self.place].ravel()


def probe(model: Model, x: Array, half_length: float = INSIDE / 10) -> Probe:
    """Probe at x (k, 2) within the body, as points with domains of the given half-length [h] would be."""
    # the outermost points are there, too: they tell the B-splines where the body ends
    outermost = np.concatenate([model.points.x.argmin(axis=0), model.points.x.argmax(axis=0)])
    at = np.vstack([x, model.points.x[outermost]])
    probed = MaterialPoints(at, np.ones(len(at)), np.full_like(at, half_length))
    operators = transfer(model.grid, probed, model.shape_function)
    if not np.all(np.isin(operators.nodes, model.transfer.nodes)):
        raise ValueError("a probe lies where no material point of the model reaches")
    return Probe(operators, np.searchsorted(model.transfer.nodes, operators.nodes), len(x))


def within(x: Array, body: Body) -> Array:
    """Positions (k, 2) at least INSIDE from the sides of the domain's box."""
    lower, upper = body.domain.bounds
    return np.clip(x, lower + INSIDE, upper - INSIDE)


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
