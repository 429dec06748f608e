"""Exact discrete adjoint of the load steps, backwards from the last one.

With bars for dJ/d(.), and lambda the nodal adjoint of a step, Lambda_p = sum_i lambda_i x g_pi:

    K lambda = sum_p F_bar_p g_pi + N_i x_bar_p                          (K the step's tangent, symmetric)
    F^ = F_bar - V0 E A : Lambda                                         (A = dP/dF at the step's end)
    g_bar_pi = F^^T u_i - V0 E P^T lambda_i,    N_bar_pi = x_bar . u_i + t f_p . lambda_i
    dJ/dE_p -= V0 P : Lambda                                             (P at unit modulus)

and at the step's start, in the updated frame, F_bar = F^ + what g = F^T grad N and the stretched domains depend on F
by, x_bar += what N and grad N depend on x by: the second derivatives of the weights. An adjoint that leaves these out
is that of another scheme. The adjoint is linear in J: it starts from zero, and each step adds the objective's own part.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mpmtop.arrays import Array
from mpmtop.errors import UnsupportedBody
from mpmtop.large_deformation.kinematics import Weights, pull_back, stretched_pull_back
from mpmtop.large_deformation.law import tangent
from mpmtop.large_deformation.model import Model
from mpmtop.large_deformation.newton import Problem
from mpmtop.large_deformation.step import State, operators
from mpmtop.large_deformation.steps import Trajectory
from mpmtop.solvers import SingularMatrix


class Seed(NamedTuple):
    """What an objective depends on a state by: its derivatives by x (p, 2) and F (p, 2, 2); None for none."""

    x: Array | None = None
    F: Array | None = None


def moduli_gradient(model: Model, path: Trajectory, seed: Callable[[int], Seed]) -> Array:
    """dJ/dE (p,) at the trajectory, of the objective with the given seeds at the end of steps 1 to `model.steps`.

    Raises UnsupportedBody, with the step, where a tangent is singular: the objective has no derivative there.
    """
    last = path.states[-1]
    x_bar, F_bar = np.zeros_like(last.x), np.zeros_like(last.F)
    by_moduli = np.zeros_like(path.moduli)
    for n in range(model.steps, 0, -1):
        own = seed(n)
        x_bar = x_bar if own.x is None else x_bar + own.x
        F_bar = F_bar if own.F is None else F_bar + own.F
        if n == model.steps or np.any(x_bar) or np.any(F_bar):
            x_bar, F_bar, part = _step_back(model, path, n, x_bar, F_bar)
            by_moduli += part
    return by_moduli


def _step_back(model: Model, path: Trajectory, n: int, x_bar: Array, F_bar: Array) -> tuple[Array, Array, Array]:
    """x_bar and F_bar at the start of step n, of those at its end, and dJ/dE (p,) within the step."""
    state, found, level = path.states[n - 1], path.increments[n - 1], model.levels[n - 1]
    ops = operators(model, state, second=model.frame == "updated")
    problem = Problem(model, ops, state.F, path.moduli, level, 0.0)
    P, A = tangent(model.law, found.F)
    right = ops.reduced(ops.to_nodes(F_bar) + ops.N.T @ x_bar)
    try:
        adjoint = ops.nodal(ops.assembly.factor(problem.tangent(A))(right))
    except SingularMatrix as error:
        raise UnsupportedBody(
            f"load step {n} of {model.steps}: its tangent is singular, there is no gradient"
        ) from error

    volume = model.points.volume
    Lambda = ops.gradient(adjoint)
    weight = volume * path.moduli
    F_hat = F_bar - (weight[:, None] * (A @ Lambda.reshape(-1, 4, 1))[..., 0]).reshape(F_bar.shape)
    part = -volume * np.sum(P * Lambda, axis=(1, 2))
    if model.frame == "total":
        return x_bar, F_hat, part
    u, lam = found.u[ops.weights.node], adjoint[ops.weights.node]  # (p, n, 2)
    g_bar = u @ F_hat - lam @ (weight[:, None, None] * P)
    N_bar = np.einsum("pia,pa->pi", u, x_bar) + level * np.einsum("pia,pa->pi", lam, model.force)
    by_x, by_F = _by_weights(model, state, ops.weights, N_bar, g_bar)
    return x_bar + by_x, F_hat + by_F, part


def _by_weights(model: Model, state: State, weights: Weights, N_bar: Array, g_bar: Array) -> tuple[Array, Array]:
    """Derivatives by x (p, 2) and F (p, 2, 2) at the start of a step, through N and g = F^T grad N."""
    by_F = np.einsum("pik,pij->pkj", weights.grad_N, g_bar)
    by_x, by_length = pull_back(weights, N_bar, g_bar @ state.F.swapaxes(1, 2))
    if model.domains == "stretched":
        by_F = by_F + stretched_pull_back(model.points.half_length, state.F, state.clipped, by_length)
    return by_x, by_F
