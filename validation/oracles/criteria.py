"""All criteria of a problem of material points in all of its load cases, by dense algebra, and their derivatives by
complex steps: through symmetry, filter, projection, SIMP, K, the solution and each criterion, with no adjoint.

All equations are those of `dense` and of this file; of the problem only what is stated is read.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from mpmtop.arrays import Array, Index
from mpmtop.criteria import AtMost, Compliance, Criterion, Displacement, PNormStress, Response, Volume, Worst
from mpmtop.design import Projection
from mpmtop.problem import DesignProblem
from mpmtop.scene import case_bodies
from validation.oracles.complex_step import STEP, filter_matrix
from validation.oracles.dense import Equations, equations_of, held, nodal_force
from validation.oracles.extended import assembled

Numbers = Any  # real or complex arrays


def stepped_criteria(problem: DesignProblem, x: Array, variables: Index) -> tuple[Array, Array]:
    """Objectives and constraints (k+m,) of a design x (n,), and their derivatives (k+m, v) by the `variables` (v,)."""
    W, offset = filter_matrix(problem)
    W = W @ spread(problem)
    values = [judged(problem, W @ x + offset)]
    values += [judged(problem, W @ (x + 1j * STEP * (np.arange(len(x)) == k)) + offset) for k in variables]
    return values[0].real, np.array(values[1:]).imag.T / STEP


def spread(problem: DesignProblem) -> Array:
    """(a, n): which variable each active point has, by looking for its images one by one."""
    points, design = problem.design_grid or problem.model.points, problem.design
    x, a = points.x[problem.space.active], len(problem.space.active)
    first = np.arange(a)
    for _ in range(len(design.symmetry) + 1):
        for mirror in design.symmetry:
            normal = np.array(mirror.normal) / np.linalg.norm(mirror.normal)
            image = x - 2 * ((x - mirror.point) @ normal)[:, None] * normal
            seen = np.argmin(np.linalg.norm(image[:, None] - x, axis=-1), axis=1)
            first = np.minimum(first, first[seen])
    return np.equal.outer(first, np.unique(first)).astype(float)


def projected(projection: Projection | None, r: Numbers, volume: Array) -> Numbers:
    """Densities of filtered ones, complex or not; the threshold that keeps the volume by one Newton step into the
    complex plane from the real one, which is exact to first order."""
    if projection is None:
        return r
    beta = projection.beta

    def step(r: Numbers, eta: Any) -> Numbers:
        low = np.tanh(beta * eta)
        return (low + np.tanh(beta * (r - eta))) / (low + np.tanh(beta * (1 - eta)))

    eta: Any = projection.threshold
    if projection.preserve_volume:
        eta = brentq(lambda e: volume @ (step(r.real, e) - r.real), 0, 1, xtol=1e-15)
        slope = (volume @ step(r.real, eta + 1j * STEP)).imag / STEP
        eta = eta - volume @ (step(r, eta) - r) / slope
    return step(r, eta)


def judged(problem: DesignProblem, filtered: Numbers) -> Numbers:
    """Objectives and constraints (k+m,) of filtered densities (p,)."""
    design, model = problem.design, problem.model
    rho = projected(design.projection, filtered, model.points.volume)
    moduli = model.body.material.young * (design.contrast + rho**design.penal * (1 - design.contrast))
    bodies = case_bodies(model.body, problem.cases)
    states = []
    for body in bodies:
        equations = equations_of(model)
        f = nodal_force(body.loads, model.grid, model.points.x, model.points.volume, equations.N).astype(float)
        free = np.flatnonzero(~held(body, model.grid, equations.nodes))
        equations = replace(equations, free=free)
        u = np.zeros(len(f), complex)
        u[free] = np.linalg.solve(assembled(equations, moduli), f[free])
        states.append((equations, f, u))

    def value(criterion: Criterion, case: int) -> Any:
        return of_state(problem, criterion, *states[case], rho)

    weights = [case.weight for case in problem.cases] or [1.0]
    of = problem.objective.criterion if isinstance(problem.objective, Worst) else problem.objective
    by_case = [weight * value(of, k) for k, weight in enumerate(weights)]
    found = by_case if isinstance(problem.objective, Worst) else [sum(by_case)]
    if isinstance(of, Volume):
        found = [value(of, 0)]
    if problem.limits_volume:
        found.append(value(Volume(), 0) / design.volume_fraction - 1)
    for stated in problem.constraints:
        cases = range(len(bodies)) if stated.case is None else [stated.case]
        cases = [0] if isinstance(stated.criterion, Volume) else cases
        scale = abs(stated.bound) if stated.scale is None else stated.scale
        sign = 1 if type(stated) is AtMost else -1
        found += [sign * (value(stated.criterion, k) - stated.bound) / scale for k in cases]
    return np.array(found)


def of_state(
    problem: DesignProblem, criterion: Criterion, equations: Equations, f: Array, u: Numbers, rho: Numbers
) -> Any:
    """J of one state."""
    points, material = problem.model.points, problem.model.body.material
    volume = points.volume
    strain = (equations.B.astype(float) @ u).reshape(-1, 3)
    stress = material.young * (strain @ equations.D.astype(float))
    match criterion:
        case Compliance():
            return f @ u
        case Volume():
            return volume @ rho / volume[~problem.space.void].sum()
        case Displacement():
            N = equations.N.astype(float)
            return nodal_force((criterion.unit_load,), problem.model.grid, points.x, volume, N) @ u
        case PNormStress(p, q, measure, weight):
            xx, yy, xy = stress.T
            thick = material.plane == "strain" and measure == "von_mises"
            zz = material.poisson * (xx + yy) if thick else 0 * xx
            s = rho**q * np.sqrt(xx**2 + yy**2 + zz**2 - xx * yy - yy * zz - zz * xx + 3 * xy**2)
            a = volume / volume.sum() if weight == "volume" else np.ones_like(volume)
            return (a @ s**p) ** (1 / p)
    moved = equations.N.astype(float) @ u.reshape(-1, 2)
    return criterion.value(Response(points.x, volume, rho, moved, strain, stress))
