"""Layout and fields of load steps, for pictures and files: the body at rest, and what has become of it at the end."""

import numpy as np

from mpmtop.arrays import Array
from mpmtop.fields import Fields, Layout, fields, layout, rectangles, tensor
from mpmtop.large_deformation.law import jacobian, kirchhoff, out_of_plane, stress
from mpmtop.large_deformation.model import Model
from mpmtop.large_deformation.step import operators, start
from mpmtop.large_deformation.steps import Trajectory


@layout.register
def layout_of_steps(model: Model) -> Layout:
    """Rectangles of the points where they start, lines of the box, and all of its nodes."""
    points, grid = model.points, model.grid
    return Layout(
        x=points.x,
        half_length=points.half_length,
        volume=points.volume,
        corners=rectangles(points.x, points.half_length),
        lines=grid.segments,
        nodes=grid.node_positions(),
        held=(model.unknown < 0).reshape(-1, 2),
        load=operators(model, start(model)).N.T @ model.force,
    )


@fields.register
def fields_of_steps(model: Model, state: Trajectory, rho: Array) -> Fields:
    """Fields at full load, on the body at rest: a corner moves by u + (F - 1) (corner - x).

    Stress is Cauchy's, strain Hencky's, ln(F F^T) / 2. Nodes of the "total" frame keep their displacements, those of a
    reset grid move anew in every step. Reactions are those of the last step, without the background's.
    """
    where, end, last = layout_of_steps(model), state.states[-1], state.increments[-1]
    F, moved = end.F, state.displacement()
    ops = operators(model, state.states[-2])
    P = state.moduli[:, None, None] * stress(model.law, last.F)
    force = ops.to_nodes(model.points.volume[:, None, None] * P) - ops.N.T @ model.force
    cauchy = kirchhoff(P, F) / jacobian(F)[:, None, None]
    zz = state.moduli * out_of_plane(model.law, F) / jacobian(F)
    squared, n = np.linalg.eigh(F @ F.swapaxes(1, 2))
    strain = (n * (np.log(squared) / 2)[:, None, :]) @ n.swapaxes(1, 2)
    arm = where.corners - where.x[:, None]
    return Fields(
        layout=where,
        density=rho,
        young=state.moduli,
        displacement=moved,
        corner_displacement=moved[:, None] + arm @ (F - np.eye(2)).swapaxes(1, 2),
        strain=tensor(_plane(strain), np.zeros(len(rho))),
        stress=tensor(_plane(cauchy), zz),
        nodal_displacement=np.sum([each.u for each in state.increments], axis=0) if model.frame == "total" else None,
        reaction=np.where(where.held, force, 0.0),
    )


def _plane(of: Array) -> Array:
    """(p, 3), (xx, yy, xy), of symmetric (p, 2, 2)."""
    return np.stack([of[:, 0, 0], of[:, 1, 1], of[:, 0, 1]], axis=1)
