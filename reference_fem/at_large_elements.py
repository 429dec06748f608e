"""Layout and fields of elements in large deformation, for pictures and files: at rest, and what has become of them."""

from dataclasses import dataclass, replace

import numpy as np

from mpmtop.arrays import Array
from mpmtop.fields import Fields, Layout, fields, layout, tensor
from reference_fem.at_elements import layout_of_elements
from reference_fem.large_deformation import LargeModel


@dataclass(frozen=True, eq=False)
class LargeState:
    """Displacements u (N,) under the part `level` of the load, with moduli and nonlinear fractions (e,)."""

    u: Array
    moduli: Array
    nonlinear: Array
    level: float = 1.0


@layout.register
def layout_of_large_elements(model: LargeModel) -> Layout:
    """The elements at rest, under the whole load."""
    return layout_of_elements(model.fem)


@fields.register
def fields_of_large_elements(model: LargeModel, state: LargeState, rho: Array) -> Fields:
    """Fields on the body at rest, in the mean over each element.

    Stress is Cauchy's, P F^T / J, and strain Hencky's, ln(F F^T) / 2, of F = 1 + g grad u; what is linear, of the
    fraction 1 - g, has the stress and strain of small deformation.
    """
    fem, basis, u = model.fem, model.basis, state.u
    H, g = model.grad(u), state.nonlinear[:, None]
    F = g[..., None, None] * H + np.eye(2)
    J, Ft = np.linalg.det(F), F.swapaxes(-2, -1)
    cauchy = model.respond(u, state.nonlinear)[0] @ Ft / J[..., None, None]
    nu = model.law.poisson
    zz = nu / ((1 + nu) * (1 - 2 * nu)) * (g * np.log(J) + (1 - g**2) * np.trace(H, axis1=-2, axis2=-1)) / J
    squared, n = np.linalg.eigh(F @ Ft)
    strain = (n * (np.log(squared) / 2)[..., None, :]) @ n.swapaxes(-2, -1) + (1 - g)[..., None, None] * H
    share = basis.dx / basis.dx.sum(axis=1, keepdims=True)
    stress = state.moduli[:, None] * np.einsum("eq,eqc->ec", share, np.concatenate([_plane(cauchy), zz[..., None]], -1))
    components = basis.split_indices()
    load = state.level * fem.f_ext
    held = np.ones(basis.N, bool)
    held[fem.free] = False
    reaction = np.where(held, model.residual(state.moduli, u, state.nonlinear) - load, 0.0)
    return Fields(
        layout=replace(layout_of_elements(fem), load=np.stack([load[dofs] for dofs in components], axis=1)),
        density=rho,
        young=state.moduli,
        displacement=np.einsum("eq,ceq->ec", share, np.asarray(basis.interpolate(u))),
        corner_displacement=u[basis.nodal_dofs[:, basis.mesh.t]].transpose(2, 1, 0),
        strain=tensor(np.einsum("eq,eqc->ec", share, _plane(strain)), np.zeros(len(rho))),
        stress=stress,
        nodal_displacement=np.stack([u[dofs] for dofs in components], axis=1),
        reaction=np.stack([reaction[dofs] for dofs in components], axis=1),
    )


def _plane(of: Array) -> Array:
    """(e, q, 3), (xx, yy, xy), of the symmetric part of (e, q, 2, 2)."""
    return np.stack([of[..., 0, 0], of[..., 1, 1], (of[..., 0, 1] + of[..., 1, 0]) / 2], axis=-1)
