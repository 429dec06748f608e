"""A problem of material points by dense algebra, and its derivatives by complex steps through all of it.

Filter, SIMP, K, solution and objective are evaluated at x + ih, h -> 0, for one variable after the other: there is no
adjoint and no derivative by hand. All equations are those of `dense`; of the problem only data is read.
"""

from typing import Any

import numpy as np

from mpmtop.arrays import Array, Index
from mpmtop.criteria import PNormStress
from mpmtop.problem import DesignProblem
from validation.oracles.dense import Equations, equations_of, of_points
from validation.oracles.extended import assembled

STEP = 1e-30
"""Complex step h: h^2 is lost in the rounding of whatever it is added to."""


def stepped_problem(problem: DesignProblem, x: Array, variables: Index) -> tuple[float, float, Array, Array]:
    """J and g of a design x (a,), and their derivatives (k,) by the `variables` (k,)."""
    equations = equations_of(problem.model)
    W, offset = filter_matrix(problem)
    values = [evaluated(problem, equations, W @ x + offset)]
    values += [
        evaluated(problem, equations, W @ (x + 1j * STEP * (np.arange(len(x)) == k)) + offset) for k in variables
    ]
    J, g = np.array(values).T
    return J[0].real, g[0].real, J[1:].imag / STEP, g[1:].imag / STEP


def filter_matrix(problem: DesignProblem) -> tuple[Array, Array]:
    """W (p, a) and offset (p,) of rho = W x + offset: the average over the cone, by volume, passive points fixed."""
    points = problem.design_grid or problem.model.points
    solid, void = (
        np.zeros(len(points.x), bool) if region is None else region.contains(points.x)
        for region in (problem.design.passive_solid, problem.design.passive_void)
    )
    active = ~(solid | void)
    apart = np.linalg.norm(points.x[:, None] - points.x, axis=-1)
    cone = points.volume * np.maximum(0, problem.design.filter_radius - apart)
    if not problem.filter_passive:
        cone[:, ~active] = 0
    with np.errstate(invalid="ignore"):  # rows of passive points, which are overwritten
        W = np.where(active[:, None], cone / cone.sum(axis=1, keepdims=True), 0.0)
    return W[:, active], np.where(active, W @ solid, solid)


def evaluated(problem: DesignProblem, equations: Equations, rho: Any) -> tuple[Any, Any]:
    """J and g of densities rho (p,), complex or not."""
    design, material, volume = problem.design, problem.model.body.material, equations.volume
    young, poisson = of_points(problem.model.body, problem.model.points.x)
    moduli = young * (design.contrast + rho**design.penal * (1 - design.contrast))
    free, f = equations.free, equations.f_ext.astype(float)
    K = assembled(equations, moduli)
    root = np.sqrt(np.diag(K).real)
    scaled = K / root / root[:, None]
    solved = np.linalg.solve(scaled, f[free] / root)
    solved += np.linalg.solve(scaled, f[free] / root - scaled @ solved)
    u = np.zeros(len(f), complex)
    u[free] = solved / root
    points = problem.design_grid or problem.model.points
    void = design.passive_void.contains(points.x) if design.passive_void is not None else np.zeros(len(volume), bool)
    g = volume @ rho / (design.volume_fraction * volume[~void].sum()) - 1
    if not isinstance(problem.objective, PNormStress):
        return f @ u, g
    strain = (equations.B.astype(float) @ u).reshape(-1, 3)
    xx, yy, xy = young * np.einsum("...a,...ab->...b", strain, equations.D.astype(float)).T
    thick = material.plane == "strain" and problem.objective.measure == "von_mises"
    zz = poisson * (xx + yy) if thick else 0 * xx
    vm = np.sqrt(xx**2 + yy**2 + zz**2 - xx * yy - yy * zz - zz * xx + 3 * xy**2)
    s = rho**problem.objective.q * vm
    largest = np.abs(s).max()
    return largest * np.sum((s / largest) ** problem.objective.p) ** (1 / problem.objective.p), g
