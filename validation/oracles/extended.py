"""Equilibrium in extended precision: a reference that shares neither equations nor solver with mpmtop.

K of `validation.oracles.dense` in full, factored densely in double precision after scaling by its diagonal, and u
refined with residuals in extended precision until it changes no more. For bodies of some hundred unknowns.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.linalg.lapack import dpocon

from mpmtop.arrays import Array
from mpmtop.model import Model
from validation.oracles.dense import EXTENDED, Equations, equations_of

SINGULAR = 1e15
"""Condition number of the scaled K beyond which double precision does not tell it from a singular matrix."""


class Undetermined(ArithmeticError):
    """The stiffness is singular to double precision: there is no answer to refer to."""


class Extended(NamedTuple):
    """The body's equations, displacements u (2a,), the solver of its K for the free unknowns, and the condition number
    of K scaled by its diagonal."""

    equations: Equations
    u: Array
    solve: Callable[[Array], Array]
    condition: float


def extended(model: Model, moduli: Array) -> Extended:
    """The reference. Raises Undetermined."""
    equations = equations_of(model)
    K = assembled(equations, moduli)
    number, factor, root = factored(K)
    if number > SINGULAR:
        raise Undetermined(f"the stiffness is singular to double precision: condition number {number:.0e}")
    B = np.ascontiguousarray(equations.B[:, equations.free])
    stiff = (equations.volume * moduli)[:, None]

    def residual_of(b: Array, u: Array) -> Array:
        residual: Array = b - B.T @ (stiff * ((B @ u).reshape(-1, 3) @ equations.D)).ravel()
        if len(equations.modulus):
            full = np.zeros(len(equations.f_ext), EXTENDED)
            full[equations.free] = u
            jumps = np.repeat(equations.modulus @ moduli, 2)[:, None] * (equations.jump @ full.reshape(-1, 2))
            residual -= (equations.jump.T @ jumps).ravel()[equations.free]
        return residual

    def solve(b: Array) -> Array:
        u: Array = np.zeros(len(equations.free), EXTENDED)
        residual, last = np.asarray(b, EXTENDED), np.inf
        while True:
            step = cho_solve(factor, (residual / root).astype(float)) / root
            change = float(np.linalg.norm(step * root))
            if change == 0 or not change < 0.5 * last:
                return u
            u += step
            residual, last = residual_of(b, u), change

    u: Array = np.zeros(len(equations.f_ext), EXTENDED)
    u[equations.free] = solve(equations.f_ext[equations.free])
    return Extended(equations, u, solve, number)


def pseudo_compliance(model: Model, moduli: Array) -> float:
    """f . K^+ f, with mechanisms left out: eigenvalues of the scaled K below 1e-12."""
    equations = equations_of(model)
    K, f = assembled(equations, moduli), equations.f_ext[equations.free].astype(float)
    root = np.sqrt(np.diag(K))
    return float((f / root) @ np.linalg.pinv(K / root / root[:, None], rcond=1e-12, hermitian=True) @ (f / root))


def full_stiffness(model: Model, moduli: Array) -> Array:
    """K (m, m) of the free degrees of freedom."""
    return assembled(equations_of(model), moduli)


def assembled(equations: Equations, moduli: Array) -> Array:
    """sum_p E_p V_p B_p^T D B_p and the ghost penalty, for the free unknowns, (m, m)."""
    B = equations.B[:, equations.free].astype(float)
    DB = (equations.volume * moduli)[:, None, None] * (equations.D.astype(float) @ B.reshape(len(moduli), 3, -1))
    K: Array = B.T @ DB.reshape(len(B), -1)
    if len(equations.modulus):
        ties = equations.jump.T @ (np.repeat(equations.modulus @ moduli, 2)[:, None] * equations.jump)
        K += np.kron(ties, np.eye(2))[np.ix_(equations.free, equations.free)]
    return K


def condition(model: Model, moduli: Array) -> float:
    """Condition number, in the 1-norm, of K scaled by its diagonal; infinite where it is singular."""
    return factored(full_stiffness(model, moduli))[0]


def plain_condition(model: Model, moduli: Array) -> float:
    """Condition number, in the 1-norm, of K as it is; its digits are those of the scaled K's factor."""
    K = full_stiffness(model, moduli)
    _, (factor, _), root = factored(K)
    return estimated(K, factor * root)


def estimated(K: Array, factor: Array) -> float:
    """LAPACK's estimate of the condition number in the 1-norm from the upper Cholesky factor."""
    inverse, _ = dpocon(factor, float(np.abs(K).sum(axis=0).max()))
    return 1 / inverse if inverse > 0 else np.inf


def factored(K: Array) -> tuple[float, tuple[Array, bool], Array]:
    """Condition number of K scaled by its diagonal, the scaled matrix's Cholesky factor, and the diagonal's root (m,).

    The number is infinite, and the factor of no use, where K is singular.
    """
    if np.min(np.diag(K)) <= 0:
        return np.inf, (K, False), np.ones(len(K))
    root = np.sqrt(np.diag(K))
    scaled = K / root / root[:, None]
    try:
        factor = cho_factor(scaled)
    except LinAlgError:
        return np.inf, (K, False), root
    return estimated(scaled, factor[0]), factor, root
