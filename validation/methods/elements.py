"""`reference_fem`'s elements behind the methods' protocol: one for each point, its stress that of the centre."""

from dataclasses import dataclass, field
from importlib.metadata import version

import numpy as np
from scipy.spatial import KDTree
from skfem import CellBasis, LinearForm
from skfem.helpers import dot

import mpmtop
from mpmtop.arrays import Array, Index
from reference_fem import elasticity
from reference_fem.adjoint import unit_work
from reference_fem.elasticity import FemModel
from validation.methods.protocol import Answer, Capability, Case

ON_LATTICE: frozenset[Capability] = frozenset(
    {
        *("analysis", "gradient", "moduli by point", "body forces", "loads at positions", "tractions"),
        *("prescribed displacements", "plane stress", "materials by region", "any outline"),
    }
)
"""All but points anywhere: each element is the rectangle of a point, and they fill the body."""


@dataclass(frozen=True)
class ElementMethod:
    """Bilinear (order 1) or biquadratic (2) quadrilaterals."""

    name: str = "FEM"
    order: int = 1
    version: str = f"reference_fem {mpmtop.__version__}, scikit-fem {version('scikit-fem')}"
    capabilities: frozenset[Capability] = field(default=ON_LATTICE)

    def analyse(self, case: Case) -> Answer:
        """At the elements' centres; see `Analyses`."""
        model, f, u, element = self._solved(case)
        moduli = _in_order(case.moduli, element)
        stress = elasticity.stress(model, u, moduli)[element, 0, :3]
        return Answer(_at_centres(model, u)[element], stress, float(f @ u))

    def gradient(self, case: Case) -> Array:
        """-u_e . k_e u_e (e,); see `Analyses`."""
        model, _, u, element = self._solved(case)
        return -unit_work(model, u, u)[element]

    def _solved(self, case: Case) -> tuple[FemModel, Array, Array, Index]:
        """Model, load vector f (N,), displacements u (N,), and the element (p,) of each point."""
        size = 2 * case.points.half_length[0]
        model = elasticity.discretise(case.body, (float(size[0]), float(size[1])), self.order)
        element = KDTree(model.centres).query(case.points.x)[1]
        moduli = _in_order(case.moduli, element)
        form = LinearForm(lambda v, w: dot(w.b, v))
        f = model.f_ext
        if case.forces is not None:  # at the centre, the only point of the model's basis
            f = f + form.assemble(model.basis, b=(_in_order(case.forces, element) / model.area[:, None]).T[:, :, None])
        if case.body_force is not None:
            fine = CellBasis(model.basis.mesh, model.basis.elem, intorder=2 * self.order, dofs=model.basis.dofs)
            constant = np.broadcast_to(_in_order(case.body_force, element).T[:, :, None], (2, *fine.dx.shape))
            f = f + form.assemble(fine, b=constant)
        u = np.zeros(model.basis.N)
        for a, dofs in enumerate(model.basis.split_indices()):
            u[dofs] = case.displaced(model.basis.doflocs[:, dofs].T)[:, a]
        u[model.free] = 0
        dofs = model.basis.element_dofs
        local = np.einsum("eij,je->ie", moduli[:, None, None] * model.matrices[model.shape], u[dofs])
        lifted = f - np.bincount(dofs.ravel(), local.ravel(), model.basis.N)
        u[model.free] = elasticity.inverse_stiffness(model, moduli)(lifted)[model.free]
        return model, f, u, element


def _in_order(values: Array, element: Index) -> Array:
    """Values by point (p, ...) in the order of the elements."""
    ordered = np.empty_like(values)
    ordered[element] = values
    return ordered


def _at_centres(model: FemModel, u: Array) -> Array:
    """Displacements (e, 2) at the elements' centres."""
    at: Array = np.asarray(model.basis.interpolate(u))[:, :, 0].T
    return at
