"""Adjoints: what follows from a criterion's derivatives by densities and displacements at a state."""

from typing import NamedTuple

import numpy as np

from mpmtop.arrays import Array
from reference_fem.elasticity import FemModel, State


class Derivative(NamedTuple):
    """dJ of J = work f . u + j(rho, u): dj/drho (e,) at fixed u and dj/du (N,). None stands for zero."""

    rho: Array | None = None
    u: Array | None = None
    work: float = 0.0


def adjoint(state: State, by: Derivative) -> Array:
    """lambda (N,) with K lambda = dJ/du, of L = J + lambda . (f - K u); u itself for the work of the load, K u = f."""
    own = by.work * state.u
    return own if by.u is None else own + state.solve(by.u)


def load_gradient(model: FemModel, state: State, by: Derivative, adjoint: Array) -> Array | None:
    """(work u + lambda) . df/drho (e,) of the loads that follow the density; None if none does."""
    return None if model.weight is None else model.weight.T @ (by.work * state.u + adjoint)


def moduli_gradient(model: FemModel, state: State, adjoint: Array) -> Array:
    """dJ/dE_e = -lambda_e . k_e u_e, (e,)."""
    return -unit_work(model, adjoint, state.u)


def unit_work(model: FemModel, v: Array, u: Array) -> Array:
    """v_e . k_e u_e (e,) at unit modulus: times the moduli it sums to v.K u, and minus it is dJ/dE for an adjoint v."""
    v_e, u_e = (_without_translation(w[model.basis.element_dofs.T]) for w in (v, u))
    if len(model.matrices) == 1:
        force = u_e @ model.matrices[0]  # symmetric
    else:
        force = np.matmul(model.matrices[model.shape], u_e[:, :, None])[:, :, 0]
    work = np.sum(force * v_e, axis=1)
    return work if len(model.ties.alpha) == 0 else work + model.ties.unit_work(v, u, len(work))


def _without_translation(u_e: Array) -> Array:
    """Element displacements (e, d) less their mean: it does no work, yet its rounding would drown small strains."""
    by_node = u_e.reshape(len(u_e), -1, 2)
    return (by_node - by_node.mean(axis=1, keepdims=True)).reshape(u_e.shape)
