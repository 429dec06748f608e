"""One load step: Newton's method on the reset grid, with the weights of the step's start."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array, Index, Mask
from mpmtop.errors import NotConverged, UnsupportedBody
from mpmtop.large_deformation.assembly import Assembly, assembly, factorised, scatter
from mpmtop.large_deformation.kinematics import Weights, stretched, weights
from mpmtop.large_deformation.law import jacobian, stress, tangent
from mpmtop.large_deformation.model import Model
from mpmtop.solvers.pattern import SingularMatrix, Solve

TOLERANCE = 1e-11
"""Of |R| against the applied forces and reactions. Newton is quadratic there: the next step would be at rounding."""
ROUNDING = 10 * np.finfo(float).eps
"""Part of the sum of the points' forces by size, with E for a stress, that may be left in R: it cannot be made smaller.
Loads below 1e-9 of E are found with fewer digits for it."""
MAX_NEWTON = 10
"""Newton steps. From the start of a load step 4 to 9 are usual, in bending the first ones stretch the body; what takes
more has been seen to end on another branch than the one that the load leads along."""
MAX_DESCENT = 40
"""Newton steps where each must lower the energy: slower and safer."""
KEPT = 0.1
"""Part of det F that a point keeps in one Newton step; the laws end at det F = 0."""
SHORTEST = 1 / 64
"""Of a Newton step, before it counts as failed."""
MAX_HALVINGS = 4
"""Of the load between two levels, before the step counts as failed."""


@dataclass(frozen=True, eq=False)
class State:
    """Positions x (p, 2), deformation gradients F (p, 2, 2), half-lengths (p, 2) and which were `clipped` (p, 2)."""

    x: Array
    F: Array
    half_length: Array
    clipped: Mask


@dataclass(frozen=True, eq=False)
class Operators:
    """What a step is made of: weights, g (p, n, 2), the unknown and sign of each degree of freedom, the background's
    stiffness (m, m) on the m unknowns in use, and the assembly."""

    weights: Weights
    g: Array
    unknown: Index
    sign: Array
    soft: sp.csr_array
    assembly: Assembly

    def nodal(self, q: Array) -> Array:
        """Vectors (nodes, 2) of the unknowns q (m,)."""
        full = self.sign * np.append(q, 0)[self.unknown]  # -1 takes the zero
        return full.reshape(-1, 2)

    def reduced(self, force: Array) -> Array:
        """Forces (m,) on the unknowns, of forces (2 nodes,)."""
        some = self.unknown >= 0
        return scatter(self.unknown[some], (self.sign * force)[some], self.soft.shape[0])

    def gradient(self, nodal: Array) -> Array:
        """sum_i u_i x g_i (p, 2, 2) of nodal vectors (nodes, 2)."""
        return nodal[self.weights.node].swapaxes(1, 2) @ self.g

    def at_points(self, nodal: Array) -> Array:
        """sum_i N_i u_i (p, 2) of nodal vectors (nodes, 2)."""
        return np.einsum("pi,pia->pa", self.weights.N, nodal[self.weights.node])

    def to_nodes(self, by_F: Array, at_points: Array | None = None) -> Array:
        """sum_p by_F_p g_i + N_i at_p (2 nodes,): the transpose of the two above; by_F (p, 2, 2), at_points (p, 2)."""
        value = self.g @ by_F.swapaxes(1, 2)
        if at_points is not None:
            value = value + self.weights.N[:, :, None] * at_points[:, None]
        return scatter(2 * self.weights.node[:, :, None] + np.arange(2), value, len(self.unknown))


@dataclass(frozen=True, eq=False)
class Increment:
    """Nodal increments u (nodes, 2) and F (p, 2, 2) at the end of a step; |R| by applied forces and reactions of every
    Newton step; and the parts that the load had to be cut into."""

    u: Array
    F: Array
    residuals: tuple[float, ...]
    parts: int


def start(model: Model, dtype: type = float) -> State:
    """The undeformed state."""
    points = model.points
    F = np.zeros((len(points.x), 2, 2), dtype) + np.eye(2)
    return moved(model, State(points.x.astype(dtype), F, points.half_length, np.zeros(points.x.shape, bool)), 0, F)


def moved(model: Model, state: State, by: Array | float, F: Array) -> State:
    """The state after its points moved `by` (p, 2) and have the deformation gradients F."""
    if model.domains == "fixed":
        return State(state.x + by, F, state.half_length, state.clipped)
    return State(state.x + by, F, *stretched(model.points.half_length, F, model.grid.h))


def operators(model: Model, state: State, *, second: bool = False) -> Operators:
    """Operators of the step that starts from `state`; with second derivatives of the weights where an adjoint asks."""
    total = model.frame == "total"
    x, length = (model.points.x, model.points.half_length) if total else (state.x, state.half_length)
    w = weights(model.grid, x, length, model.shape_function, second=second)
    g = w.grad_N if total else w.grad_N @ state.F
    touched = np.unique(w.node[w.touched])
    mine = model.unknown[(2 * touched[:, None] + np.arange(2)).ravel()]
    active = np.zeros(model.unknowns, bool)
    active[mine[mine >= 0]] = True
    if not np.any(active):
        raise UnsupportedBody("every node that the points touch is held: let the supports hold a part of the body only")
    place = np.append(np.where(active, np.cumsum(active) - 1, -1), -1)
    m = np.count_nonzero(active)
    soft = sp.csr_array((m, m)) if model.background is None else model.background.condensed(active)
    unknown = place[model.unknown]
    return Operators(w, g, unknown, model.sign, soft, assembly(model.grid, w, unknown, model.sign, soft))


@dataclass(frozen=True, eq=False)
class Trial:
    """What q (m,) gives: F (p, 2, 2), R (m,) and |R| by applied forces and reactions; whether |R| is small enough."""

    q: Array
    F: Array
    R: Array
    residual: float
    accepted: bool


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

    @np.errstate(over="ignore", invalid="ignore")  # what leaves the range is refused at the end
    def trial(self, q: Array) -> Trial | None:
        """What q gives; None where a point is inverted or a number leaves the range."""
        ops, volume = self.ops, self.model.points.volume
        F = self.F_old + ops.gradient(ops.nodal(q))
        J = jacobian(F).real
        if not np.all((J > 0) & np.isfinite(J)):
            return None
        P = (volume * self.moduli)[:, None, None] * stress(self.model.law, F)
        internal = ops.to_nodes(P)
        external = self.level * ops.to_nodes(np.zeros_like(P), self.model.force)
        R = ops.reduced(internal - external) + ops.soft @ q
        held = ops.unknown < 0
        applied = float(np.linalg.norm(np.where(held, internal, external)))
        # entries of F near 1 leave eps E in the stresses, however small these are
        by_size = np.linalg.norm(P, axis=(1, 2)) + volume * np.abs(self.moduli)
        rounding = scatter(ops.weights.node, by_size[:, None] * np.linalg.norm(ops.g, axis=2), len(held))
        size = float(np.linalg.norm(R))
        if not np.isfinite(size):
            return None
        accepted = bool(size <= max(self.tol * applied, ROUNDING * float(np.linalg.norm(rounding))))
        return Trial(q, F, R, size / max(applied, np.finfo(float).tiny), accepted)

    @np.errstate(over="ignore", invalid="ignore")  # no step to such an energy is taken
    def energy(self, trial: Trial) -> float:
        """Energy whose gradient is R."""
        ops, model = self.ops, self.model
        stored = (model.points.volume * self.moduli) @ model.law.energy(trial.F).W
        work = self.level * np.sum(model.force * ops.at_points(ops.nodal(trial.q)))
        return float((stored - work + trial.q @ (ops.soft @ trial.q) / 2).real)

    def solve(self, F: Array) -> Solve:
        """Solve with the tangent at F; SingularMatrix where it has none."""
        return factorised(self.tangent(F))

    def tangent(self, F: Array) -> sp.csc_array:
        """dR/dq (m, m), symmetric."""
        A = tangent(self.model.law, F)[1] * (self.model.points.volume * self.moduli)[:, None, None]
        p, n = self.ops.weights.N.shape
        # rows (a, k) and columns (b, l) of A -> sum_kl g_ik A_akbl g_jl in order i, a, b, j
        inner = A.reshape(p, 2, 2, 2, 2).transpose(0, 2, 1, 3, 4).reshape(p, 2, 8)
        local = (self.ops.g @ inner).reshape(p, 4 * n, 2) @ self.ops.g.swapaxes(1, 2)
        return self.ops.assembly.tangent(local)


def newton(problem: Problem, q: Array, *, descent: bool, polish: int) -> tuple[Trial, list[float]]:
    """Newton's method from q, its steps shortened until no point inverts, and with `descent` until each lowers the
    energy; `polish` more steps after the last one. Also |R| of all steps. Raises Failure."""
    trial = problem.trial(q)
    if trial is None:
        raise Failure("a point is inverted at its start")
    residuals = [trial.residual]
    limit = MAX_DESCENT if descent else MAX_NEWTON
    for k in range(limit + 1 + polish):
        if trial.accepted and k > 0:  # a small load is none
            polish -= 1
            if polish < 0:
                return trial, residuals
        if k >= limit and not trial.accepted:
            break
        try:
            dq = problem.solve(trial.F)(-trial.R)
        except SingularMatrix as error:
            raise Failure(f"the tangent is singular at {_node(problem, error.unknown)}") from error
        trial = _shortened(problem, trial, dq, descent=descent and not trial.accepted)
        residuals.append(trial.residual)
    raise Failure(f"the residual is {trial.residual:.1e} of the forces after {len(residuals) - 1} Newton steps")


def _shortened(problem: Problem, trial: Trial, dq: Array, *, descent: bool) -> Trial:
    """The trial at the end of the longest step along dq, halved as often as it takes."""
    J_old = jacobian(trial.F).real
    energy, slope = 0.0, 0.0
    if descent:
        energy, slope = problem.energy(trial), float((trial.R @ dq).real)
        if slope > 0:
            dq, slope = -dq, -slope
    part, worst = 1.0, 0
    while part >= SHORTEST**2 if descent else part >= SHORTEST:
        new = problem.trial(trial.q + part * dq)
        if new is not None:
            J = jacobian(new.F).real
            worst = int(np.argmin(J / J_old))
            # 1e-4: the usual part of the slope; rounding of the energy where nothing is left to gain
            lower = not descent or problem.energy(new) <= energy + 1e-4 * part * slope + 1e-14 * abs(energy)
            if J[worst] >= KEPT * J_old[worst] and lower:
                return new
        part /= 2
    x = problem.model.points.x[worst]
    what = "no step along it lowers the energy" if descent else "a point inverts"
    raise Failure(f"{what}, near the point that was at ({x[0]:.4g}, {x[1]:.4g})")


def _node(problem: Problem, unknown: int) -> str:
    dof = int(np.flatnonzero(problem.ops.unknown == unknown)[0])
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
        q = np.zeros(ops.soft.shape[0], state.F.dtype)
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
