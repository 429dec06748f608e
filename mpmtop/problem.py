"""The optimisation problem of Eq. (8) on a model: design -> filter -> SIMP -> equilibrium -> objective."""

import hashlib
from dataclasses import astuple, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array
from mpmtop.criteria import Compliance, PNormStress, finite_gradient
from mpmtop.design import Design, physical_densities
from mpmtop.equilibrium import Equilibrium, adjoint, equilibrium, moduli_gradient
from mpmtop.errors import LoadOutsideBody
from mpmtop.material import simp
from mpmtop.model import Model, discretise
from mpmtop.objectives import Objective, objective
from mpmtop.points import MaterialPoints
from mpmtop.scene import Scene, check_together
from mpmtop.shape_functions import ShapeFunction, tent
from mpmtop.solvers import MAX_ITERATIONS, MultigridCG
from mpmtop.stiffness import CellMap
from mpmtop.variables import DesignVariables


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
class DesignProblem(DesignVariables):
    """Minimise `objective` subject to sum V_p rho_p <= V* sum V_p over one variable of the `design` for each point.

    An iterative solver is held to its own tolerance, or to the objective's where that is tighter.

    The filter measures distances on the design grid: `design_grid`, or the model's points where they have not been
    moved off it. There, too, points are in the design's passive regions or not. Those that are have density 1 or 0 and
    leave the design vector: a variables are left for p points. Passive solid counts in the first sum; the second one is
    over all points that are not passive void. The filter passes over passive points as if they were absent, or with
    `filter_passive` averages their densities with the others. Raises InvalidScene, EmptyDomain or LoadOutsideBody where
    passive regions leave no design, no feasible one, or a load without material.
    """

    model: Model
    design: Design
    objective: Compliance | PNormStress = field(default_factory=Compliance)
    design_grid: MaterialPoints | None = None
    filter_passive: bool = False

    def __post_init__(self) -> None:
        check_together(self.model.body, self.design, self.objective)
        if self.design_grid is not None and len(self.design_grid.x) != len(self.model.points.x):
            raise ValueError(
                f"design grid of {len(self.design_grid.x)} points for a model of {len(self.model.points.x)}: "
                "give one for each, in the same order"
            )
        if not self.space.all_active:
            self._check_passive()

    def _check_passive(self) -> None:
        self.check_feasible()
        void, points = np.flatnonzero(self.space.void), self.model.points
        for load in self.model.body.loads:
            if np.any(np.isin(load.act(points.x, points.volume, 1e-9 * min(self.model.grid.h)).points, void)):
                raise LoadOutsideBody(f"passive void would carry a part of {load}: move it, or lower its `points`")

    @property
    def grid_points(self) -> MaterialPoints:
        """The design grid, or the model's points."""
        return self.model.points if self.design_grid is None else self.design_grid

    @property
    def point_volume(self) -> Array:
        """Volumes (p,) of the model's points."""
        return self.model.points.volume

    @cached_property
    def functional(self) -> Objective:
        """Value and derivatives of the objective."""
        return objective(self.objective)

    @property
    def fingerprint(self) -> str:
        """Hash of all numbers that an iterate depends on: a checkpoint fits a problem of the same ones only.

        They are taken before any BLAS or Fourier transform, and to 24 binary digits, see `_digits`: what depends on the
        processor is not among them.
        """
        model, design, grid_points, space = self.model, self.design, self.grid_points, self.space
        law = (model.body.material.young, design.penal, design.contrast, design.volume_fraction, design.rho_min)
        sought = (word if isinstance(word, str) else float(word) for word in astuple(self.objective))
        said = (type(self.objective).__name__, *sought, *map(float, law), float(design.filter_radius))
        passive = None if space.all_active else self.filter_passive
        digest = hashlib.sha256(repr((*said, passive)).encode())
        transfer, ghost = model.transfer, model.ghost
        touched = transfer.touched
        sparse = ghost.jump, ghost.modulus
        whole = (
            *(touched.sum(axis=1), transfer.stencil[touched], np.sort(model.stiffness.dof), space.solid, space.void),
            *(index for matrix in sparse for index in (matrix.indices, matrix.indptr)),
        )
        computed = (
            *(model.points.volume, transfer.grad_N[touched], model.D, model.f_ext),
            *(model.grid.cell_coordinates(grid_points.x), grid_points.volume),
            *(() if transfer.b_bar is None else (transfer.b_bar[touched],)),
            *(matrix.data for matrix in sparse),
        )
        for array in (*whole, *map(_digits, computed)):
            digest.update(np.ascontiguousarray(array, np.int64).tobytes())
        return digest.hexdigest()

    def analyse(self, rho: Array) -> Evaluation:
        """Evaluate physical densities rho (p,) in [0, 1], of whatever origin, at passive points, too: one solve."""
        rho = physical_densities(rho, len(self.model.points.volume), "point")
        moduli = self.model.body.material.young * simp(rho, self.design.penal, self.design.contrast)[0]
        state = equilibrium(self.model, moduli, tol=min(self.model.solver.tolerance, self.functional.tolerance))
        constraints = np.array([self.volume_weight @ rho - 1])
        return Evaluation(self.functional.value(self.model, state, rho), constraints, rho, state)

    def evaluate(self, design: Array) -> Evaluation:
        """Value only, of a design (a,): one solve."""
        return self.analyse(self.filter(design))

    def gradient(self, evaluation: Evaluation) -> tuple[Array, Array]:
        """dJ/ddesign (a,) and dg/ddesign (1, a) of an evaluation, with its factorisation.

        Raises InvalidScene where a p-norm of q p < 1 has none: a design of zeros over the reach of the filter.
        """
        d_rho = self.density_gradient(evaluation)
        return finite_gradient(self.filter.adjoint(d_rho), self.objective), self.volume_gradient

    def density_gradient(self, evaluation: Evaluation) -> Array:
        """dJ/drho (p,), by the physical densities; from above at zero, where a p-norm's may be infinite."""
        model, state, rho = self.model, evaluation.state, evaluation.rho
        by = self.functional.derivative(model, state, rho)
        by_moduli = moduli_gradient(model, state, adjoint(model, state, by))
        slope = simp(rho, self.design.penal, self.design.contrast)[1]
        by_rho = by_moduli * model.body.material.young * slope
        return by_rho if by.rho is None else by.rho + by_rho


def _digits(numbers: Array) -> Array:
    """Integers that tell numbers apart to 2^-24 of the largest one, and that one's exponent; not their last bits.

    The exponent is that of a number larger by 1e-9, so that a power of two and a bit less have the same.
    """
    largest = float(np.max(np.abs(numbers), initial=0.0))
    exponent = int(np.frexp(largest * (1 + 1e-9))[1])
    return np.append(np.rint(np.ldexp(numbers.ravel(), 24 - exponent)), exponent)


def design_problem(
    scene: Scene,
    h: float | tuple[float, float] | None = None,
    ppc: int | tuple[int, int] | None = None,
    shape_function: ShapeFunction = tent,
    *,
    design_grid: MaterialPoints | None = None,
    filter_passive: bool = False,
    **how: Any,
) -> DesignProblem:
    """The scene's problem on cells of size h with ppc points per cell and direction; `how` as for `discretise`."""
    model = discretise(scene.body, h, ppc, shape_function, **how)
    return DesignProblem(model, scene.design, scene.objective, design_grid, filter_passive)


def plan(problem: DesignProblem) -> str:
    """What an analysis of the problem computes and what it skips, and why: one line each, to print."""
    model = problem.model
    total, active = int(np.prod(model.grid.nodes)), len(model.transfer.nodes)
    held = 2 * active - len(model.stiffness.dof)
    touched = np.count_nonzero(model.transfer.touched, axis=1)
    p = len(touched)
    space = problem.space
    passive = f"{np.count_nonzero(space.solid)} are passive solid, {np.count_nonzero(space.void)} passive void"
    lines = [
        f"design variables: {len(space.active)} of {p} points; {'none is passive' if space.all_active else passive}",
        f"nodes: {active} of {total} get degrees of freedom; no point touches the others",
        f"unknowns: {len(model.stiffness.dof)}; {held} degrees of freedom are held and never assembled",
        f"stencil ({model.shape_function.__name__}): {np.mean(touched):.2f} nodes for a point on average; "
        f"{np.count_nonzero(touched <= 4)} of {p} points need no more than the 4 of their own cell",
        f"dilatation: {'of each point' if model.transfer.b_bar is None else 'averaged over each cell (B-bar)'}",
        f"ghost faces: {_ghost_plan(model)}",
        f"stiffness: {len(model.stiffness.row)} entries of the lower triangle, {_stiffness_plan(model)}",
        f"solver: {_solver_plan(model)}",
        "solves: one for a design, and one more for each step of iterative refinement where rounding calls for it",
        "adjoint solve: one, with the factorisation of the state"
        if problem.functional.of_stress
        else "adjoint solve: skipped, compliance is self-adjoint",
        "stresses: at every point" if problem.functional.of_stress else "stresses: skipped, the objective needs none",
        f"filter: {_filter_plan(problem)}",
        *(f"warning, {type(finding).__name__}: {finding}" for finding in model.findings),
    ]
    return "\n".join(lines)


def _ghost_plan(model: Model) -> str:
    ghost = model.ghost
    faces = ghost.modulus.shape[0]
    if ghost.gamma == 0:
        return "skipped, the ghost penalty is off"
    if faces == 0:
        return f"skipped, none of the {ghost.between} between two cells of the body has a cut cell beside it"
    return f"{faces} of {ghost.between} between two cells of the body have a cut cell beside them"


def _solver_plan(model: Model) -> str:
    if isinstance(model.solver, MultigridCG):
        return f"MultigridCG, one hierarchy for a design; sparse Cholesky where {MAX_ITERATIONS} iterations do not do"
    return f"{type(model.solver).__name__}, one factorisation for a design"


def _stiffness_plan(model: Model) -> str:
    part = model.stiffness.maps[0]
    if isinstance(part, CellMap):
        return f"by {len(part.place)} cells and {len(part.local)} distinct matrices of points"
    return "one sparse product each"


def _filter_plan(problem: DesignProblem) -> str:
    matrix = problem.filter.matrix
    return f"{matrix.nnz} weights, built once" if sp.issparse(matrix) else "a convolution over the lattice of points"
