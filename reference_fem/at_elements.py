"""Layout and fields of a finite element model, for pictures and files."""

from dataclasses import replace

import numpy as np

from mpmtop.arrays import Array
from mpmtop.fields import Fields, Layout, fields, layout, tensor
from reference_fem.elasticity import FemModel, State, strain_operator, stress


@layout.register
def layout_of_elements(model: FemModel) -> Layout:
    """The elements, their sides, and the places of the degrees of freedom: corners, and midpoints of order 2."""
    basis, mesh = model.basis, model.basis.mesh
    corners = np.moveaxis(mesh.p[:, mesh.t], 0, -1).swapaxes(0, 1)  # (e, 4, 2)
    held = np.ones(basis.N, bool)
    held[model.free] = False
    components = basis.split_indices()
    return Layout(
        x=model.centres,
        half_length=np.ptp(corners, axis=1) / 2,
        volume=model.area,
        corners=corners,
        lines=np.moveaxis(mesh.p[:, mesh.facets], 0, -1).swapaxes(0, 1),
        nodes=basis.doflocs[:, components[0]].T,
        held=np.stack([held[dofs] for dofs in components], axis=1),
        load=np.stack([model.f_ext[dofs] for dofs in components], axis=1),
    )


@fields.register
def fields_at_elements(model: FemModel, state: State, rho: Array) -> Fields:
    """Fields at the elements' centres, and displacements of their corners."""
    basis, u = model.basis, state.u
    load = model.force(rho)
    where = replace(layout_of_elements(model), load=np.stack([load[dofs] for dofs in basis.split_indices()], axis=1))
    nu, strained = model.elastic.poisson, model.elastic.plane == "strain"
    strain = (strain_operator(model) @ u).reshape(-1, 3) * [1, 1, 0.5]
    trace = strain[:, 0] + strain[:, 1]
    element = basis.element_dofs.T
    force = state.moduli[:, None] * np.einsum("eab,eb->ea", model.matrices[model.shape], u[element])
    reaction = np.bincount(element.ravel(), force.ravel(), basis.N) - load
    ties = model.ties
    tied = np.zeros(basis.N, bool)
    tied[np.concatenate([ties.spring.indices, ties.hold.indices, ties.pull.indices])] = True
    reaction[model.free] = np.where(tied, reaction, 0.0)[model.free]
    components = basis.split_indices()
    corner = u[basis.nodal_dofs[:, basis.mesh.t]]  # (2, 4, e)
    return Fields(
        layout=where,
        density=rho,
        young=state.moduli,
        displacement=np.asarray(basis.interpolate(u))[:, :, 0].T,
        corner_displacement=corner.transpose(2, 1, 0),
        strain=tensor(strain, np.zeros_like(trace) if strained else -nu / (1 - nu) * trace),
        stress=stress(model, u, state.moduli)[:, 0],
        nodal_displacement=np.stack([u[dofs] for dofs in components], axis=1),
        reaction=np.stack([reaction[dofs] for dofs in components], axis=1),
    )
