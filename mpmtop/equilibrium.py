"""Equilibrium: R(u) = f_ext - f_int(u) = 0 (Eqs. 3 and 4), and its adjoint, solved with one factorisation and checked.

Residual and tangent are what all is made of. Small-strain elasticity is linear: f_int = K(E) u, one step of Newton's
method from u = 0 is exact, and the tangent K(E), factored once, is the adjoint's, too.
"""

import warnings
from dataclasses import dataclass
from typing import NamedTuple
from weakref import WeakSet

import numpy as np

from mpmtop.arrays import Array
from mpmtop.diagnose import energy_warning
from mpmtop.errors import InvalidScene, NotConverged
from mpmtop.mechanism import mechanism_named, place
from mpmtop.model import Model
from mpmtop.solvers import Solve

ADJOINT = 1e-6
"""Error of a gradient, relative, that rounding may leave where void carries the load: it misleads no optimiser."""

_ANALYSED: WeakSet[Model] = WeakSet()
"""Models that have been warned of what only an analysis shows: once each."""


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """Displacements u (2a,) [length] and strains (p, 3) in equilibrium with `f_ext` (2a,), and the factorisation that
    found them, ready for an adjoint to the same tolerance."""

    moduli: Array
    f_ext: Array
    u: Array
    strain: Array
    solve: Solve
    tol: float
    solves: int
    residual: float  # |R| / |f_ext| over the free degrees of freedom


def equilibrium(
    model: Model,
    moduli: Array,
    *,
    f_ext: Array | None = None,
    tol: float | None = None,
    max_solves: int = 3,
    factored: Solve | None = None,
) -> Equilibrium:
    """u with |R| <= tol |f_ext|, R = f_ext - f_int(u) over the free degrees of freedom, for Young's moduli (p,).

    `f_ext` (2a,) replaces the nodal forces of the body's loads, for a body force or whatever else no load says;
    `factored` is the `tangent` for these moduli, where another load has it already. One
    solve is enough but for rounding; any further one is a step of iterative refinement with the same factorisation, see
    `checked_solve`, also for `tol` and what it raises. Raises UnsupportedBody if K is singular, naming the node and the
    island it belongs to, and InvalidScene without any load. A model's first analysis warns of a NearMechanism if the
    points see a small part of the strain energy only.
    """
    if not np.all(np.isfinite(moduli)) or np.min(moduli) < 0:
        raise ValueError("point moduli must be finite and not negative: check the densities")
    if f_ext is None:
        if not model.body.loads and not model.body.is_displaced:
            raise InvalidScene("the body has no load: add one, or give the nodal forces `f_ext`")
        if model.forces.weight is not None:
            raise InvalidScene("weight is by density, and none is given: give the forces `f_ext=model.force(rho)`")
        f_ext = model.f_ext
    tol = model.solver.tolerance if tol is None else tol
    solve = tangent(model, moduli, tol) if factored is None else factored
    found = _displaced(model, moduli, solve, f_ext, tol, max_solves)
    if model not in _ANALYSED:
        _ANALYSED.add(model)
        unseen = energy_warning(model.grid, model.points, model.transfer, found.u, found.strain, moduli)
        if unseen is not None:
            warnings.warn(unseen, stacklevel=2)
    return Equilibrium(moduli, f_ext, found.u, found.strain, solve, tol, found.solves, found.residual)


def _displaced(model: Model, moduli: Array, solve: Solve, f_ext: Array, tol: float, max_solves: int) -> "Solution":
    """u = g + w of prescribed displacements g and K w = f_ext - K g, w zero where held."""
    g = model.prescribed
    if g is None:
        return checked_solve(model, moduli, solve, f_ext, tol=tol, max_solves=max_solves)
    lifted = f_ext - model.resistance(moduli, g)
    w = checked_solve(model, moduli, solve, lifted, tol=tol, max_solves=max_solves)
    return w._replace(u=g + w.u, strain=model.transfer.strain(g) + w.strain)


def tangent(model: Model, moduli: Array, tol: float) -> Solve:
    """K^-1 of K = -dR/du over the free degrees of freedom, factored; for an iterative solver, to `tol`."""
    data, solver = model.stiffness.data(moduli), type(model.solver).__name__
    with mechanism_named(model, moduli):
        try:
            solve = model.solver.factor(data, tol)
        except TypeError as error:
            raise InvalidScene(f"{solver}.factor failed ({error}): let it take (data, tolerance)") from error
    if not callable(solve):
        raise InvalidScene(
            f"{solver}.factor gave a {type(solve).__name__}: return a function that solves K x = b for b (m,)"
        )
    return solve


def _answer(solve: Solve, b: Array) -> Array:
    """x of K x = b (m,); InvalidScene if a solver's answer is none of its shape."""
    x = solve(b)
    if np.shape(x) != b.shape:
        raise InvalidScene(f"the solver answered {np.shape(x)} to b {b.shape}: let it return x of the same shape")
    return x


def residual(model: Model, moduli: Array, u: Array, load: Array, strain: Array | None = None) -> Array:
    """R = load - f_int(u) (m,) over the free degrees of freedom; `strain` (p, 3) if it is known."""
    return (load - model.resistance(moduli, u, strain))[model.stiffness.dof]


class Solution(NamedTuple):
    """u (2a,), zero where held, its strains (p, 3), the solves it took and |R| / |load| over the free unknowns."""

    u: Array
    strain: Array
    solves: int
    residual: float


class Derivative(NamedTuple):
    """dJ of an objective J = work f_ext . u + j(u, rho) at a state: dj/drho (p,) at fixed u and dj/du (2a,).

    None stands for zero. `scale` is the size of sum_p E_p dj/dE_p = -u . dj/du where that is known and no symmetry
    makes it zero, as it is j itself for a j of degree one in u; see `checked_solve`.
    """

    rho: Array | None = None
    u: Array | None = None
    work: float = 0.0
    scale: float | None = None


class Adjoint(NamedTuple):
    """lambda = work u + mu with K lambda = dJ/du: the state itself stands for its own load, mu is solved for."""

    work: float
    mu: Solution | None


def adjoint(model: Model, state: Equilibrium, by: Derivative) -> Adjoint:
    """The adjoint of the state, from L = J + lambda . R: dL/du = 0.

    The work of the loads is self-adjoint, K u = f_ext. What else depends on u takes one checked solve, with the
    factorisation of the state.
    """
    if by.u is None:
        return Adjoint(by.work, None)
    mu = checked_solve(model, state.moduli, state.solve, by.u, state=state.u, scale=by.scale, tol=state.tol)
    return Adjoint(by.work, mu)


def moduli_gradient(model: Model, state: Equilibrium, found: Adjoint) -> Array:
    """dJ/dE_p = lambda . dR/dE_p = -V_p eps_p(lambda) . D eps_p(u) - the ghost penalty's work, (p,).

    That is Eq. (16), or Eqs. (17) to (20), before the chain rule through SIMP.
    """
    by_moduli = np.zeros_like(state.moduli)
    if found.work != 0:
        by_moduli = -found.work * model.work(state.u, state.strain, state.u, state.strain)
    if found.mu is not None:
        by_moduli = by_moduli - model.work(found.mu.u, found.mu.strain, state.u, state.strain)
    return by_moduli


def load_gradient(model: Model, state: Equilibrium, found: Adjoint) -> Array | None:
    """d(work f_ext . u)/drho at fixed u and lambda . df_ext/drho, (p,), of the loads that follow the density; None if
    none does."""
    by = 2 * found.work * state.u if found.mu is None else 2 * found.work * state.u + found.mu.u
    return model.force_work(by)


@np.errstate(over="ignore", invalid="ignore")  # what leaves the range is refused below, by name
def checked_solve(
    model: Model,
    moduli: Array,
    solve: Solve,
    load: Array,
    *,
    state: Array | None = None,
    scale: float | None = None,
    tol: float | None = None,
    max_solves: int = 3,
) -> Solution:
    """K u = load (2a,) with the factorisation `solve` of K(moduli), and a check of the result: R = load - K u.

    Accepted is |R| <= tol |load| with |R . v| <= tol load . u, v = u; if not, u is refined by solving for R. For an
    adjoint v is the `state` (2a,) it belongs to: the gradient is a product of the two, and an adjoint may miss a soft
    part of the body that decides it, however small |R| is. |R . v| is then measured by `scale`, the size of
    sum_p E_p dJ/dE_p = -load . v, which is J itself for a J of degree one in u; unless given, by the product of both
    energy norms, which bounds it and does not vanish where the load is orthogonal to the state, as it may be by
    symmetry, or where J passes through zero. `tol` is the solver's own tolerance unless given, 1e-9 of a direct one.

    Where void carries load, |K| |u| exceeds |load| so far that rounding alone leaves |R| above that, with load . u
    right to all digits that matter. So the last solve may miss it if the error in the energy norm is small: its square,
    R . K^-1 R, must not exceed tol load . u, with |R . u| added, as both enter load . u; an adjoint may leave ADJOINT
    of the `scale`.

    Raises NotConverged, naming where u is least certain, UnsupportedBody where an iterative solver meets a mechanism,
    and ValueError where load . u leaves the range of double precision.
    """
    tol = model.solver.tolerance if tol is None else tol
    free = model.stiffness.dof
    u = np.zeros_like(load)
    R = load[free]
    if not np.any(R):
        return Solution(u, model.transfer.strain(u), 0, 0.0)
    size = np.linalg.norm(R)
    stored = 0.0 if state is None or scale is not None else abs(float(state @ model.resistance(moduli, state)))
    for count in range(1, max_solves + 1):
        with mechanism_named(model, moduli):
            u[free] += _answer(solve, R)
        strain = model.transfer.strain(u)
        R = residual(model, moduli, u, load, strain)
        energy = float(load @ u)
        if not energy > 0 or energy == np.inf:
            raise _unusable(model, moduli, u[free], energy)
        relative = float(np.linalg.norm(R) / size)
        v = u if state is None else state
        whole = energy if state is None else float(np.sqrt(energy) * np.sqrt(stored)) if scale is None else abs(scale)
        missed = _part(abs(float(R @ v[free])), whole)
        if relative <= tol and missed <= tol:
            return Solution(u, strain, count, relative)
    with mechanism_named(model, moduli):
        correction = solve(R)
    error = abs(float(R @ correction)) / energy + (missed if state is None else 0.0)
    if error <= tol and (state is None or missed <= max(tol, ADJOINT)):
        return Solution(u, strain, max_solves, relative)
    raise NotConverged(
        f"residual {relative:.1e} |load|, {error:.1e} of the energy, after {max_solves} solves (tolerance "
        f"{tol:.0e}): the stiffness is nearly singular at {place(model, moduli, int(np.argmax(np.abs(correction))))}; "
        "raise E_min / E0 (`contrast`) or support the body better"
    )


def _part(part: float, whole: float) -> float:
    """part / whole of numbers that are not negative; nothing is no part of nothing."""
    return part / whole if whole > 0 else (np.inf if part > 0 else 0.0)


def _unusable(model: Model, moduli: Array, u: Array, energy: float) -> Exception:
    """Why load . u = `energy` is not the work of a solution u (m,)."""
    if energy in (0, np.inf):
        return ValueError(f"load . u = {energy:g}: choose units nearer to the force and the modulus")
    return NotConverged(
        f"load . u = {energy:g}, where K is positive: the stiffness is nearly singular at "
        f"{place(model, moduli, int(np.argmax(np.abs(u))))}; raise E_min / E0 (`contrast`) or support the body better"
    )
