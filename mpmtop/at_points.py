"""Layout and fields of a body of material points, for pictures and files."""

from dataclasses import replace

import numpy as np

from mpmtop.arrays import Array
from mpmtop.equilibrium import Equilibrium
from mpmtop.fields import Fields, Layout, fields, layout, rectangles, tensor
from mpmtop.model import Model


@layout.register
def layout_of_points(model: Model) -> Layout:
    """Rectangles of the points, lines of the grid, and the nodes that points touch."""
    points, grid, nodes = model.points, model.grid, model.transfer.nodes
    held = np.ones(2 * len(nodes), bool)
    held[model.stiffness.dof] = False
    return Layout(
        x=points.x,
        half_length=points.half_length,
        volume=points.volume,
        corners=rectangles(points.x, points.half_length),
        lines=grid.segments,
        nodes=grid.node_positions(nodes),
        held=held.reshape(-1, 2),
        load=model.f_ext.reshape(-1, 2),
    )


@fields.register
def fields_at_points(model: Model, state: Equilibrium, rho: Array) -> Fields:
    """Fields at the points; a corner moves by u + grad u . (corner - x), the affine motion of its rectangle.

    sigma_zz = nu (sigma_xx + sigma_yy) in plane strain, eps_zz = -nu / (1 - nu) (eps_xx + eps_yy) in plane stress.
    """
    where = replace(layout_of_points(model), load=state.f_ext.reshape(-1, 2))
    nu, strained = model.elastic.poisson, model.elastic.plane == "strain"
    stress = model.stress(state.moduli, state.strain)
    tensor_strain = state.strain * [1, 1, 0.5]
    trace = tensor_strain[:, 0] + tensor_strain[:, 1]
    at, nodal = model.transfer, state.u.reshape(-1, 2)
    moved = at.interpolate(state.u)
    grad = np.einsum("pna,pnb->pab", np.where(at.touched[..., None], nodal[at.stencil], 0.0), at.grad_N)
    arm = where.corners - where.x[:, None]
    force = (model.internal_force(stress) + model.ghost.force(state.moduli, state.u) - state.f_ext).reshape(-1, 2)
    ties = model.ties
    tied = np.zeros(2 * len(at.nodes), bool)
    tied[np.concatenate([ties.spring.indices, ties.hold.indices, ties.pull.indices])] = True
    return Fields(
        layout=where,
        density=rho,
        young=state.moduli,
        displacement=moved,
        corner_displacement=moved[:, None] + np.einsum("pab,pcb->pca", grad, arm),
        strain=tensor(tensor_strain, np.zeros_like(trace) if strained else -nu / (1 - nu) * trace),
        stress=tensor(stress, nu * (stress[:, 0] + stress[:, 1]) * strained),
        nodal_displacement=nodal,
        reaction=np.where(where.held | tied.reshape(-1, 2), force, 0.0),
    )
