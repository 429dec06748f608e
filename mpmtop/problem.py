"""The optimisation problem of Eq. (8) for a discretised scene: design -> filter -> SIMP -> equilibrium -> objective."""

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mpmtop.design import DensityFilter, density_filter
from mpmtop.equilibrium import Equilibrium, Model, equilibrium
from mpmtop.material import simp
from mpmtop.objectives import Objective, objective
from mpmtop.points import MaterialPoints
from mpmtop.scene import Array


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Objective and constraints g <= 0 (1,) of one design, with its physical densities and its state."""

    objective: float
    constraints: Array
    rho: Array
    state: Equilibrium

    @property
    def u(self) -> Array:
        """Nodal displacements (2a,)."""
        return self.state.u


@dataclass(frozen=True, eq=False)
class DesignProblem:
    """Minimise the scene's objective subject to sum V_p rho_p <= V* sum V_p over one design variable for each point.

    The filter measures distances on the design grid: `design_grid`, or the model's points where they have not been
    moved off it.
    """

    model: Model
    design_grid: MaterialPoints | None = None

    def __post_init__(self) -> None:
        if self.design_grid is not None and len(self.design_grid.x) != len(self.model.points.x):
            raise ValueError(
                f"design grid of {len(self.design_grid.x)} points for a model of {len(self.model.points.x)}: "
                "give one for each, in the same order"
            )

    @cached_property
    def filter(self) -> DensityFilter:
        """The density filter of the scene's radius."""
        points = self.model.points if self.design_grid is None else self.design_grid
        return density_filter(points, self.model.scene.filter_radius)

    @cached_property
    def objective(self) -> Objective:
        """The objective of the scene."""
        return objective(self.model.scene)

    @cached_property
    def x0(self) -> Array:
        """The paper's start: the volume fraction everywhere."""
        return np.full(len(self.model.points.volume), self.model.scene.volume_fraction)

    @cached_property
    def lower(self) -> Array:
        """rho_min everywhere."""
        return np.full_like(self.x0, self.model.scene.rho_min)

    @cached_property
    def upper(self) -> Array:
        """One everywhere."""
        return np.ones_like(self.x0)

    @cached_property
    def _volume_weight(self) -> Array:
        volume = self.model.points.volume
        return volume / (self.model.scene.volume_fraction * volume.sum())

    @property
    def fingerprint(self) -> str:
        """Hash of all numbers that an iterate depends on: a checkpoint fits a problem of the same ones only."""
        model, scene = self.model, self.model.scene
        law = (scene.material.young, scene.penal, scene.contrast, scene.volume_fraction, scene.rho_min)
        digest = hashlib.sha256(repr((scene.objective, *map(float, law))).encode())
        operators = (model.stiffness.data_map, self.filter.matrix, model.transfer.B)
        arrays = (model.points.volume, model.D, model.f_ext, model.stiffness.dof)
        for array in (*arrays, *(part for m in operators for part in (m.data, m.indices, m.indptr))):
            digest.update(array.tobytes())
        return digest.hexdigest()

    def analyse(self, rho: Array) -> Evaluation:
        """Evaluate physical densities rho (p,) in [0, 1], of whatever origin: one solve."""
        scene = self.model.scene
        if np.shape(rho) != self.x0.shape:
            raise ValueError(f"densities of shape {np.shape(rho)} for {len(self.x0)} points: give one for each point")
        if not np.all((rho >= -1e-9) & (rho <= 1 + 1e-9)):  # a filter's rounding passes; NaN does not
            raise ValueError("densities outside 0 to 1: give physical densities")
        rho = np.clip(rho, 0, 1)
        rho.flags.writeable = False  # the gradient is taken from it later
        moduli = scene.material.young * simp(rho, scene.penal, scene.contrast)[0]
        state = equilibrium(self.model, moduli)
        constraints = np.array([self._volume_weight @ rho - 1])
        return Evaluation(self.objective.value(self.model, state, rho), constraints, rho, state)

    def evaluate(self, design: Array) -> Evaluation:
        """Value only: one solve."""
        return self.analyse(self.filter(design))

    def gradient(self, evaluation: Evaluation) -> tuple[Array, Array]:
        """dJ/ddesign (p,) and dg/ddesign (1, p) of an evaluation, with its factorisation."""
        d_rho = self.density_gradient(evaluation)
        return self.filter.adjoint(d_rho), self.filter.adjoint(self._volume_weight)[None]

    def density_gradient(self, evaluation: Evaluation) -> Array:
        """dJ/drho (p,), by the physical densities."""
        scene = self.model.scene
        by_rho, by_moduli = self.objective.gradient(self.model, evaluation.state, evaluation.rho)
        return by_rho + by_moduli * scene.material.young * simp(evaluation.rho, scene.penal, scene.contrast)[1]


def plan(problem: DesignProblem) -> str:
    """What an analysis of the problem computes and what it skips, and why: one line each, to print."""
    model = problem.model
    total, active = int(np.prod(model.grid.nodes)), len(model.transfer.nodes)
    held = 2 * active - len(model.stiffness.dof)
    touched = np.count_nonzero(model.transfer.touched, axis=1)
    p = len(touched)
    lines = [
        f"nodes: {active} of {total} get degrees of freedom; no point touches the others",
        f"unknowns: {len(model.stiffness.dof)}; {held} degrees of freedom are held and never assembled",
        f"stencil ({model.shape_function.__name__}): {np.mean(touched):.2f} nodes for a point on average; "
        f"{np.count_nonzero(touched <= 4)} of {p} points need no more than the 4 of their own cell",
        f"stiffness: {model.stiffness.data_map.shape[0]} entries of the lower triangle, one sparse product each",
        f"solver: {type(model.solver).__name__}, one factorisation for a design",
        "Newton: one step, the scene is linear; the tangent of a further one would be the same",
        "adjoint solve: one, with the factorisation of the state"
        if problem.objective.solves
        else "adjoint solve: skipped, compliance is self-adjoint",
        "stresses: at every point" if problem.objective.solves else "stresses: skipped, the objective needs none",
        f"filter: {problem.filter.matrix.nnz} weights, built once",
    ]
    return "\n".join(lines)
