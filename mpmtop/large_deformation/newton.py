"""Equilibrium at the end of a load step: Newton's method on the reset grid, with the weights of the step's start.

From the second Newton step on the stress of the tangent's geometric part is not that of the displacements,
S(F + dF), but its linearisation, S* = S + dS/dF dF: mixed integration points. Where a body bends, the displacements of
one Newton step stretch it to second order before they turn it, and stresses of that stretch make the next tangent
useless; the linearised ones have none. R, and so what is found, is unchanged, and both agree as Newton converges.
Source: Magisano, Leonetti and Garcea (2017), Comput. Methods Appl. Mech. Engrg 313:496.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mpmtop.arrays import Array
from mpmtop.errors import NotConverged
from mpmtop.large_deformation.law import Energy, cofactor, first_stress, jacobian, moduli
from mpmtop.large_deformation.model import Model
from mpmtop.large_deformation.step import Operators, State, operators
from mpmtop.solvers import SingularMatrix

TOLERANCE = 1e-11
"""Of |R| against the applied forces and reactions. Newton is quadratic there: the next step would be at rounding."""
ROUNDING = 10 * np.finfo(float).eps
"""Part of the sum of the points' forces by size, with E for a stress, that may be left in R: it cannot be made smaller.
Loads below 1e-9 of E are found with fewer digits for it."""
MAX_NEWTON = 10
"""Newton steps. From the start of a load step 3 to 6 are usual; what takes more has been seen to end on another branch
than the one that the load leads along."""
MAX_DESCENT = 40
"""Newton steps where each must lower the energy: slower and safer."""
KEPT = 0.1
"""Part of det F that a point keeps in one Newton step; the laws end at det F = 0."""
MAX_SHORTENED = 3
"""Halvings of full Newton steps, in all of one run. Of 500 runs on the way to designs those that found an answer took
three at most; those that took more went on to MAX_NEWTON, and failed."""
MAX_SHORTENED_DESCENT = 12
"""Halvings of one step that must lower the energy, before it counts as failed."""
MAX_HALVINGS = 4
"""Of the load between two levels, before the step counts as failed."""


@dataclass(frozen=True, eq=False)
class Increment:
    """Nodal increments u (nodes, 2) and F (p, 2, 2) at the end of a step; |R| by applied forces and reactions of every
    Newton step; and the parts that the load had to be cut into."""

    u: Array
    F: Array
    residuals: tuple[float, ...]
    parts: int


@dataclass(frozen=True, eq=False)
class Trial:
    """What q (m,) gives: F (p, 2, 2), at unit modulus the energy and stress P (p, 2, 2), R (m,) and |R| by applied
    forces and reactions; whether |R| is `accepted`, as within the tolerance or what rounding may leave, or is even
    `small`: within the tolerance."""

    q: Array
    F: Array
    energy: Energy
    P: Array
    R: Array
    residual: float
    accepted: bool
    small: bool


class Failure(Exception):
    """Newton's method gave up, for the reason in the message; a smaller part of the load may do."""


@dataclass(frozen=True, eq=False)
class Problem:
    """R(q) = 0 of one step at one load level."""

    model: Model
    ops: Operators
    F_old: Array
    moduli: Array
    level: float
    tol: float

    @cached_property
    def weight(self) -> Array:
        """V0 E (p,)."""
        return self.model.points.volume * self.moduli

    @cached_property
    def external(self) -> Array:
        """Applied forces (nodes, 2)."""
        return self.level * (self.ops.N.T @ self.model.force)

    @np.errstate(over="ignore", invalid="ignore")  # what leaves the range is refused at the end
    def trial(self, q: Array) -> Trial | None:
        """What q gives; None where a point is inverted or a number leaves the range."""
        ops = self.ops
        F = self.F_old + ops.gradient(ops.nodal(q))
        J = jacobian(F).real
        if not np.all((J > 0) & np.isfinite(J)):
            return None
        energy = self.model.law.energy(F)
        P = first_stress(energy, F)
        weighted = self.weight[:, None, None] * P
        internal = ops.to_nodes(weighted)
        R = ops.reduced(internal - self.external) + ops.assembly.soft @ q
        held = ops.assembly.held.reshape(internal.shape)
        applied = float(np.linalg.norm(np.where(held, internal, self.external)))
        # entries of F near 1 leave eps E in the stresses, however small these are
        by_size = np.linalg.norm(weighted, axis=(1, 2)) + np.abs(self.weight)
        rounding = ROUNDING * float(np.linalg.norm(ops.sizes_t @ by_size))
        size = float(np.linalg.norm(R))
        if not np.isfinite(size):
            return None
        small, accepted = size <= self.tol * applied, size <= max(self.tol * applied, rounding)
        return Trial(q, F, energy, P, R, size / max(applied, np.finfo(float).tiny), accepted, small)

    @np.errstate(over="ignore", invalid="ignore")  # no step to such an energy is taken
    def energy(self, trial: Trial) -> float:
        """Energy whose gradient is R."""
        stored = self.weight @ trial.energy.W
        work = np.sum(self.external * self.ops.nodal(trial.q))
        return float((stored - work + trial.q @ (self.ops.assembly.soft @ trial.q) / 2).real)

    def tangent(self, A: Array) -> Array:
        """Lower triangle of dR/dq, symmetric, for moduli A (p, 4, 4) at unit modulus."""
        p, n = self.ops.weights.N.shape
        # rows (a, k) and columns (b, l) of A -> sum_kl g_ik A_akbl g_jl in order i, a, b, j
        inner = (A * self.weight[:, None, None]).reshape(p, 2, 2, 2, 2).transpose(0, 2, 1, 3, 4).reshape(p, 2, 8)
        local = (self.ops.g @ inner).reshape(p, 4 * n, 2) @ self.ops.g.swapaxes(1, 2)
        return self.ops.assembly.lower(self.ops.stencils.sums @ local.reshape(p, -1))


def newton(problem: Problem, q: Array, *, descent: bool, polish: int) -> tuple[Trial, list[float]]:
    """Newton's method from q, its steps shortened until no point inverts, and with `descent` until each lowers the
    energy, whose own tangent is taken then; `polish` more steps after the last one. Also |R| of all steps. Raises
    Failure.

    What rounding may leave is an estimate from above: a trial that is accepted for it gets one step more.
    """
    trial = problem.trial(q)
    if trial is None:
        raise Failure("a point is inverted at its start")
    residuals = [trial.residual]
    limit = MAX_DESCENT if descent else MAX_NEWTON
    linear, halvings, left = None, 0, None
    for k in range(limit + 2 + polish):
        if left is None and trial.accepted and k > 0:  # a small load is none
            left = polish + (not trial.small)
        if left == 0:
            return trial, residuals
        if left is not None:
            left -= 1
        elif k >= limit:
            break
        A = moduli(trial.energy, trial.F)
        S = None if descent else _second(trial)
        if S is not None and linear is not None:
            A.reshape(-1, 2, 2, 2, 2)[:, (0, 1), :, (0, 1)] += linear - S
        try:
            dq = problem.ops.assembly.factor(problem.tangent(A))(-trial.R)
        except SingularMatrix as error:
            raise Failure(f"the tangent is singular at {_node(problem, error.unknown)}") from error
        lower = descent and left is None
        most = MAX_SHORTENED_DESCENT if descent else MAX_SHORTENED - halvings
        new, halved = _shortened(problem, trial, dq, most, descent=lower)
        halvings += halved
        if S is not None:
            linear = S + _change(trial.F, A, new.F - trial.F, S if linear is None else linear)
        trial = new
        residuals.append(trial.residual)
    raise Failure(f"the residual is {trial.residual:.1e} of the forces after {len(residuals) - 1} Newton steps")


def _second(trial: Trial) -> Array:
    """Second Piola-Kirchhoff stress S = F^-1 P (p, 2, 2) at unit modulus."""
    return _solved(trial.F, trial.P)


def _solved(F: Array, b: Array) -> Array:
    """F^-1 b (p, 2, 2)."""
    return cofactor(F).swapaxes(1, 2) @ b / jacobian(F)[:, None, None]


def _change(F: Array, A: Array, dF: Array, S: Array) -> Array:
    """dS (p, 2, 2) of a change dF by moduli A (p, 4, 4), the stress S in their geometric part: A dF = F dS + dF S."""
    return _solved(F, (A @ dF.reshape(-1, 4, 1)).reshape(dF.shape) - dF @ S)


def _shortened(problem: Problem, trial: Trial, dq: Array, most: int, *, descent: bool) -> tuple[Trial, int]:
    """The trial at the end of the longest step along dq, halved as often as it takes and `most` times at most; and how
    often that is."""
    J_old = jacobian(trial.F).real
    energy, slope = 0.0, 0.0
    if descent:
        energy, slope = problem.energy(trial), float((trial.R @ dq).real)
        if slope > 0:
            dq, slope = -dq, -slope
    worst = 0
    for halvings in range(most + 1):
        part = 0.5**halvings
        new = problem.trial(trial.q + part * dq)
        if new is not None:
            J = jacobian(new.F).real
            worst = int(np.argmin(J / J_old))
            # 1e-4: the usual part of the slope; rounding of the energy where nothing is left to gain
            lower = not descent or problem.energy(new) <= energy + 1e-4 * part * slope + 1e-14 * abs(energy)
            if J[worst] >= KEPT * J_old[worst] and lower:
                return new, halvings
    x = problem.model.points.x[worst]
    what = "no step along it lowers the energy" if descent else "a point inverts"
    raise Failure(f"{what}, near the point that was at ({x[0]:.4g}, {x[1]:.4g})")


def _node(problem: Problem, unknown: int) -> str:
    dof = int(problem.ops.assembly.to_unknowns[[unknown]].indices[0])
    x, y = problem.model.grid.node_positions(np.array([dof // 2]))[0]
    return f"displacement {'xy'[dof % 2]} of the node at ({x:.4g}, {y:.4g})"


def increment(
    model: Model,
    state: State,
    moduli: Array,
    levels: tuple[float, float],
    *,
    tol: float = TOLERANCE,
    polish: int = 0,
) -> tuple[Increment, Operators]:
    """Equilibrium at the second of the load `levels` from `state`, which is near that of the first.

    Full Newton steps first; if they fail, steps that lower the energy; if these fail, too, the load is applied in 2, 4,
    ... parts, one after the other with the weights of the step's start, so that what is found is the same: how often
    the load was cut is no part of the discretisation. Raises NotConverged.
    """
    ops = operators(model, state)
    reason = ""
    for halvings in range(MAX_HALVINGS + 1):
        parts = 2**halvings
        q = np.zeros(ops.assembly.pattern.m, state.F.dtype)
        try:
            residuals: list[float] = []
            for part in range(1, parts + 1):
                level = levels[0] + (levels[1] - levels[0]) * part / parts
                problem = Problem(model, ops, state.F, moduli, level, tol)
                trial, found = _either(problem, q, polish if part == parts else 0)
                q = trial.q
                residuals += found
            return Increment(ops.nodal(q), trial.F, tuple(residuals), parts), ops
        except Failure as failure:
            reason = str(failure)
    raise NotConverged(
        f"{reason}, with the load in {2**MAX_HALVINGS} parts: take more steps, a smaller load, a stiffer design or a "
        "larger background alpha"
    )


def _either(problem: Problem, q: Array, polish: int) -> tuple[Trial, list[float]]:
    try:
        return newton(problem, q, descent=False, polish=polish)
    except Failure:
        return newton(problem, q, descent=True, polish=polish)
