"""Density-based optimisation on a finite element model: design, SIMP, objective and gradient."""

import hashlib
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from skfem import MeshQuad

from mpmtop.arrays import Array, Mask
from mpmtop.body import Elastic, Material
from mpmtop.criteria import (
    AtMost,
    Compliance,
    Criterion,
    Displacement,
    Worst,
    finite_gradient,
    remark,
)
from mpmtop.design import Design, physical_densities
from mpmtop.errors import InvalidScene, LoadOutsideBody
from mpmtop.loads import carriers
from mpmtop.scene import LoadCase, Scene, check_together
from reference_fem import at_elements as at_elements
from reference_fem.adjoint import adjoint, load_gradient, moduli_gradient, unit_work
from reference_fem.cases import Sum, case_models, constraint_sums, objective_sums, states
from reference_fem.elasticity import (
    FemModel,
    State,
    discretise,
)
from reference_fem.mesh import GEOMETRY_TOLERANCE, shortest_side
from reference_fem.objectives import STRESS_POSITIONS, Objective, StressPosition, objective, unit_force
from reference_fem.outline import even_lines
from reference_fem.variables import DesignVariables

Filtered = Literal["density", "sensitivity"]
SENSITIVITY_FLOOR = 1e-3  # density by which the averaged sensitivity is divided, at least: of the published codes
VOLUME_ROUNDING = 1e-12  # of the volume: sums of areas


@dataclass(frozen=True, eq=False)
class Evaluation:
    """One analysed design: objectives (k,), constraints g (m,) <= 0, densities rho (e,), and the state in each case.

    The objective is the largest of the objectives. `filtered` (e,) are the densities before a projection, None where
    the densities come from no design.
    """

    objectives: Array
    constraints: Array
    rho: Array
    states: tuple[State, ...]
    filtered: Array | None = None

    @property
    def objective(self) -> float:
        """J."""
        return float(np.max(self.objectives))

    @property
    def state(self) -> State:
        """The state, in the first load case."""
        return self.states[0]

    @property
    def u(self) -> Array:
        """Displacements (N,), in the first load case."""
        return self.state.u


@dataclass(frozen=True, eq=False)
class DesignProblem(DesignVariables):
    """Minimise `objective` over the `design` (n,) at a volume of at most `volume_fraction` of the body, and under
    `constraints`, in one load case or several `cases`; see `Scene`.

    rho = P(H design + fixed), E = E(rho) by SIMP, K(E) u = f, g = sum(area rho) / (volume_fraction sum(area)) - 1 <= 0;
    P is the design's projection, if it has one.
    A stress objective takes stresses at the element centres or the Gauss points.

    Elements in passive regions have density 1 or 0 and leave the design: a variables for e elements. Solid
    ones count in the first sum, void ones in neither. The filter takes passive elements as absent, or averages them
    with the others (`filter_passive`). Raises InvalidScene, EmptyDomain or LoadOutsideBody where passive regions
    leave no feasible design, none at all, or a load without material.

    The "sensitivity" filter (Sigmund 1997) takes the design for the densities, rho = design, and averages the
    derivative instead: df0_j = sum_i H_ji x_i dJ/drho_i / max(1e-3, x_j), the derivative of no function.
    """

    model: FemModel
    design: Design
    objective: Criterion | Worst = field(default_factory=Compliance)
    stress_at: StressPosition = "centre"
    filter_passive: bool = False
    filtered: Filtered = "density"
    constraints: tuple[AtMost, ...] = ()
    cases: tuple[LoadCase, ...] = ()

    def __post_init__(self) -> None:
        check_together(self.model.body, self.design, self.objective, self.constraints, self.cases)
        if self.filtered not in get_args(Filtered):
            raise InvalidScene(f"filtered {self.filtered!r}: say one of {', '.join(get_args(Filtered))}")
        if self.filtered == "sensitivity" and self.filter_passive:
            raise InvalidScene("filter_passive averages densities, the sensitivity filter does not: drop one of them")
        if self.filtered == "sensitivity" and (self.design.projection or self.design.symmetry or self.constraints):
            raise InvalidScene(
                "the sensitivity filter knows the volume constraint alone: with a projection, symmetry or constraints "
                "take the density filter"
            )
        if self.stress_at not in STRESS_POSITIONS:
            raise InvalidScene(f"stress at {self.stress_at!r}: say one of {', '.join(STRESS_POSITIONS)}")
        least = self.volume(self.densities(self.H @ self.lower + self.space.fixed))
        if least > 1 + VOLUME_ROUNDING:
            fraction = self.design.volume_fraction
            raise InvalidScene(
                f"passive solid, with rho_min elsewhere, is {least * fraction:.4f} of the volume and volume_fraction "
                f"{fraction}: raise it, or shrink passive_solid"
            )
        for model in self.models:
            _check_loads(model, self.space.void)
        _ = self.sums  # what cannot be made is said now

    @cached_property
    def models(self) -> tuple[FemModel, ...]:
        """The model in each load case."""
        return case_models(self.model, self.cases)

    @cached_property
    def functional(self) -> Objective:
        """Value and derivatives of what the objective is made of."""
        return self._functional(self.objective.criterion if isinstance(self.objective, Worst) else self.objective)

    def _functional(self, criterion: Criterion) -> Objective:
        return objective(criterion, self.model, self.stress_at, self.volume_share)

    @cached_property
    def sums(self) -> tuple[tuple[Sum, ...], tuple[Sum, ...]]:
        """Objectives, and constraints beside that of the volume fraction."""
        objectives = objective_sums(self.objective, self.functional, self.cases)
        return objectives, constraint_sums(self.constraints, self._functional, len(self.models))

    @property
    def limits_volume(self) -> bool:
        """Whether the volume fraction is a constraint, the first one; not one that no design exceeds, beside others."""
        return self.design.volume_fraction < 1 or not self.constraints

    @property
    def fingerprint(self) -> str:
        """Hash of all numbers that an iterate depends on: a checkpoint fits a problem of the same ones only.

        None of them is a sum that a BLAS may order as it likes: they are the same on every machine.
        """
        model, space, material, design = self.model, self.space, self.model.elastic, self.design
        constants = [np.ravel(constant) for constant in (material.young, material.poisson)]
        numbers = (
            *(*(constant[0] for constant in constants), design.penal, design.contrast),
            *(design.volume_fraction, design.rho_min),
        )
        said = (
            told(self.objective),
            *map(told, self.constraints),
            told(design.projection),
            told(design.symmetry),
            *(float(case.weight) for case in self.cases),
            material.plane,
            model.basis.Nbfun,
            self.stress_at,
            self.filtered,
            *map(float, numbers),
        )
        digest = hashlib.sha256(repr(said).encode())
        corners = model.basis.mesh.p[:, model.basis.mesh.t]
        rows = (row for case in self.models for row in (case.ties.spring, case.ties.hold, case.ties.pull))
        ties = (row for row in rows if row.shape[0] > 0)
        sparse = (self.H, *(case.weight for case in self.models if case.weight is not None), *ties)
        weights = (part for matrix in sparse for part in (matrix.data, matrix.indices, matrix.indptr))
        in_cases = (array for case in self.models for array in (np.sort(case.free), case.f_ext))
        given = (case.prescribed for case in self.models if case.prescribed is not None)
        asked = (unit_force(model, each) for each in self._displacements)
        by_element = [constant for constant in constants if len(constant) > 1]
        for array in (corners, *by_element, *in_cases, *given, *asked, space.solid, space.void, space.fixed, *weights):
            digest.update(array.tobytes())
        return digest.hexdigest()

    @property
    def _displacements(self) -> list[Displacement]:
        return [each.criterion for sums in self.sums for each in sums if isinstance(each.criterion, Displacement)]

    def remarks(self, evaluation: Evaluation) -> list[UserWarning]:
        """The warnings that displacements of a final design call for: NothingMoves of the one that is sought, but in
        several load cases, and PlaceInVoid. A solve for each, no factorisation."""
        said = []
        for sums, sought in zip(self.sums, (not self.cases, False), strict=True):
            for each in sums:
                if isinstance(each.criterion, Displacement):
                    said += [self._remark(each.criterion, evaluation, part.case, sought) for part in each.parts]
        return [warning for warning in said if warning is not None]

    def _remark(self, stated: Displacement, evaluation: Evaluation, case: int, sought: bool) -> UserWarning | None:
        model, state, unit = self.models[case], evaluation.states[case], unit_force(self.model, stated)

        def energy() -> Array:
            v = state.solve(unit)
            return state.moduli * unit_work(model, v, v)

        return remark(stated, unit, state.u, energy, state.moduli / model.elastic.young, sought=sought)

    def evaluate(self, x: Array) -> Evaluation:
        """Objective and constraints of the design x (n,): no derivative, one factorisation for all cases on the same
        supports."""
        if self.filtered == "density":
            filtered = self.H @ x + self.space.fixed
            return self._analyse(self.densities(filtered), filtered)
        rho = self.space.solid.astype(float)
        rho[self.space.active] = x
        return self.analyse(rho)

    def analyse(self, rho: Array) -> Evaluation:
        """Objective and constraints of physical densities rho (e,) in [0, 1], of any origin, passive ones included."""
        return self._analyse(rho, None)

    def _analyse(self, rho: Array, filtered: Array | None) -> Evaluation:
        rho = physical_densities(rho, len(self.model.area), "element")
        found = states(self.models, simp(rho, self.model.elastic, self.design)[0], rho)
        objectives, others = ([each.value(self.models, found, rho) for each in sums] for sums in self.sums)
        volume = [self.volume(rho) - 1] if self.limits_volume else []
        return Evaluation(np.array(objectives), np.array([*volume, *others]), rho, found, filtered)

    def gradient(self, evaluation: Evaluation) -> tuple[Array, Array]:
        """Derivatives by the design: df0 = H^T dJ/drho (n,), (k, n) of k objectives, and dg (m, n); no further
        factorisation.

        Raises InvalidScene where a p-norm of q p < 1 has none: a design of zeros over the reach of the filter.
        """
        if self.filtered == "sensitivity":
            return self._averaged(evaluation)
        objectives, others = (
            [
                finite_gradient(self.pull_back(evaluation.filtered, self._by_density(each, evaluation)), each.criterion)
                for each in sums
            ]
            for sums in self.sums
        )
        dg = [self.volume_gradient(evaluation.filtered)] if self.limits_volume else []
        return objectives[0] if len(objectives) == 1 else np.stack(objectives), np.vstack([*dg, *others])

    def _averaged(self, evaluation: Evaluation) -> tuple[Array, Array]:
        active = self.space.active
        x, d_rho = evaluation.rho[active], self.density_gradient(evaluation)
        by_density = finite_gradient(d_rho[active], self.sums[0][0].criterion)
        averaged = self.H[active] @ (x * by_density) / np.maximum(SENSITIVITY_FLOOR, x)
        return averaged, self.model.area[active][None] / self.volume_bound

    def density_gradient(self, evaluation: Evaluation) -> Array:
        """dJ/drho (e,) by the physical densities: explicit part - dE/drho lambda_e . k_e u_e; one solve for stress.

        From above at a density of zero, where a p-norm's may be infinite. Of several objectives, that of the largest.
        """
        return self._by_density(self.sums[0][int(np.argmax(evaluation.objectives))], evaluation)

    def _by_density(self, of: Sum, evaluation: Evaluation) -> Array:
        rho = evaluation.rho
        slope = simp(rho, self.model.elastic, self.design)[1]
        total = np.zeros_like(rho)
        for factor, functional, case in of.parts:
            model, state = self.models[case], evaluation.states[case]
            by = functional.derivative(model, rho, state.u)
            explicit = 0.0 if by.rho is None else by.rho
            if by.u is not None or by.work != 0:
                found = adjoint(state, by)
                by_load = load_gradient(model, state, by, found)
                explicit = explicit if by_load is None else explicit + by_load
                explicit = explicit + slope * moduli_gradient(model, state, found)
            total = total + factor * explicit
        return total


def _check_loads(model: FemModel, void: Mask) -> None:
    """Raise LoadOutsideBody if an element of passive void (e,) would carry a part of a load."""
    mesh, domain = model.basis.mesh, model.body.domain
    tol = GEOMETRY_TOLERANCE * shortest_side(mesh)
    for load in model.body.loads:
        if np.any(void[carriers(load, model.centres, model.area, tol, domain, even_lines(mesh))]):
            raise LoadOutsideBody(f"passive void would carry a part of {load}: move it, or lower its `points`")


def design_problem(
    scene: Scene,
    size: float | tuple[float, float] | None = None,
    order: int = 1,
    stress_at: StressPosition = "centre",
    *,
    mesh: MeshQuad | None = None,
    filter_passive: bool = False,
    filtered: Filtered = "density",
) -> DesignProblem:
    """The scene's problem on elements of side `size`, or on a `mesh`, with one density for each element.

    They are bilinear (order 1) or biquadratic (2). A stress objective takes stresses at the element centres, one for
    each density as for each material point, or at the Gauss points, averaged in the p-norm; every element counts once,
    whatever its size. Raises as `discretise` and `DesignProblem`.
    """
    model = discretise(scene.body, size, order, mesh=mesh)
    return DesignProblem(
        model, scene.design, scene.objective, stress_at, filter_passive, filtered, scene.constraints, scene.cases
    )


def told(stated: Any) -> str:
    """What is stated, in words that are the same in every session: of what is no number, word, tuple or dataclass, a
    function or an object of its own class, the class alone."""
    if is_dataclass(stated):
        return f"{type(stated).__name__}({', '.join(told(getattr(stated, part.name)) for part in fields(stated))})"
    if isinstance(stated, tuple):
        return f"({', '.join(map(told, stated))})"
    if isinstance(stated, int | float | np.number):
        return repr(float(stated))
    return stated if isinstance(stated, str) else type(stated).__name__


def simp(rho: Array, material: Material | Elastic, design: Design) -> tuple[Array, Array]:
    """Modified SIMP, Eq. (10): E = E0 (contrast + rho^penal (1 - contrast)) and dE/drho, both (e,), for rho (e,)."""
    solid = material.young * (1 - design.contrast)
    young = material.young * design.contrast + solid * rho**design.penal
    return young, solid * design.penal * rho ** (design.penal - 1)
