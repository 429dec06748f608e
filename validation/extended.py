"""Equilibrium in extended precision: a reference that shares neither assembly nor solver with mpmtop.

K from B in full, factored densely in double precision after scaling by its diagonal, and u refined with residuals in
extended precision until it changes no more. For bodies of some hundred unknowns.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.linalg.lapack import dpocon

from mpmtop.equilibrium import Equilibrium, Model
from mpmtop.scene import Array

EXTENDED: Any = np.longdouble
SINGULAR = 1e15
"""Condition number of the scaled K beyond which double precision does not tell it from a singular matrix."""


class Undetermined(ArithmeticError):
    """The stiffness is singular to double precision: there is no answer to refer to."""


class Extended(NamedTuple):
    """State of extended precision, the model with full operators to go with it, and the condition number of K scaled by
    its diagonal."""

    model: Model
    state: Equilibrium
    condition: float


def extended(model: Model, moduli: Array) -> Extended:
    """The reference. Raises Undetermined."""
    free = model.stiffness.dof
    K = full_stiffness(model, moduli)
    root = np.sqrt(np.diag(K))
    try:
        cholesky = cho_factor(K / root / root[:, None])
    except (LinAlgError, RuntimeWarning) as error:
        raise Undetermined("the stiffness is singular to double precision") from error
    if (number := _condition(K, cholesky[0])) > SINGULAR:
        raise Undetermined(f"the stiffness is singular to double precision: condition number {number:.0e}")
    B = strain_operator(model).astype(EXTENDED)
    stiff = (model.points.volume * moduli)[:, None]

    def residual_of(b: Array, u: Array) -> Array:
        inner = B.T @ (stiff * ((B @ u[free]).reshape(-1, 3) @ model.D)).ravel()
        return b - inner - (model.ghost.force(moduli, u)[free] if has_faces(model) else 0)

    def solve(b: Array) -> Array:
        u: Array = np.zeros(len(model.f_ext), EXTENDED)
        residual, last = np.asarray(b, EXTENDED), np.inf
        while True:
            step = cho_solve(cholesky, (residual / root).astype(float)) / root
            change = float(np.linalg.norm(step * root))
            if change == 0 or not change < 0.5 * last:
                return u[free]
            u[free] += step
            residual, last = residual_of(b, u), change

    u: Array = np.zeros(len(model.f_ext), EXTENDED)
    u[free] = solve(model.f_ext[free])
    full = with_full_operators(model)
    return Extended(full, Equilibrium(moduli, u, full.transfer.strain(u), solve, 0, 0.0), number)


def with_full_operators(model: Model) -> Model:
    """The model with N, B and the ghost penalty's operators as full matrices: on small bodies a sparse product takes
    longer to prepare than a full one to compute."""
    transfer, ghost = model.transfer, model.ghost
    N, B = transfer.N_matrix.toarray().astype(EXTENDED), transfer.B.toarray().astype(EXTENDED)
    jump, modulus = ghost.jump.toarray(), ghost.modulus.toarray()
    return replace(model, transfer=replace(transfer, N_matrix=N, B=B), ghost=replace(ghost, jump=jump, modulus=modulus))


def strain_operator(model: Model) -> Array:
    """B (3p, m) of the free degrees of freedom, in full."""
    return model.transfer.B.toarray()[:, model.stiffness.dof]


def has_faces(model: Model) -> bool:
    """Whether a ghost penalty takes part."""
    return model.ghost.modulus.shape[0] > 0


def pseudo_compliance(model: Model, moduli: Array) -> float:
    """f . K^+ f, with mechanisms left out: eigenvalues of the scaled K below 1e-12."""
    K, f = full_stiffness(model, moduli), model.f_ext[model.stiffness.dof]
    root = np.sqrt(np.diag(K))
    return float((f / root) @ np.linalg.pinv(K / root / root[:, None], rcond=1e-12, hermitian=True) @ (f / root))


def full_stiffness(model: Model, moduli: Array) -> Array:
    """K (m, m) of the free degrees of freedom: sum_p E_p V_p B_p^T D B_p and the ghost penalty, assembled from B."""
    free, p = model.stiffness.dof, len(moduli)
    B = strain_operator(model)
    DB = (model.points.volume * moduli)[:, None, None] * (model.D @ B.reshape(p, 3, -1))
    K = B.T @ DB.reshape(3 * p, -1)
    ghost = model.ghost
    if has_faces(model):
        jump = ghost.jump.toarray()
        K += np.kron(jump.T @ (np.repeat(ghost.modulus @ moduli, 2)[:, None] * jump), np.eye(2))[np.ix_(free, free)]
    return K


def condition(model: Model, moduli: Array) -> float:
    """Condition number, in the 1-norm, of K scaled by its diagonal; infinite where it is singular."""
    K = full_stiffness(model, moduli)
    if np.min(np.diag(K)) <= 0:
        return np.inf
    root = np.sqrt(np.diag(K))
    try:
        return _condition(K, cho_factor(K / root / root[:, None])[0])
    except LinAlgError:
        return np.inf


def _condition(K: Array, cholesky: Array) -> float:
    root = np.sqrt(np.diag(K))
    inverse, _ = dpocon(cholesky, float(np.abs(K / root / root[:, None]).sum(axis=0).max()))
    return 1 / inverse if inverse > 0 else np.inf
