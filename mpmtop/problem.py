"""The optimisation problem of Eq. (8) on a model: design -> filter -> SIMP -> equilibrium -> criteria."""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from mpmtop.arrays import Array
from mpmtop.cases import case_models, states
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
from mpmtop.equilibrium import Equilibrium, adjoint, load_gradient, moduli_gradient
from mpmtop.errors import InvalidScene, LoadOutsideBody
from mpmtop.fingerprint import digits, words
from mpmtop.loads import carriers
from mpmtop.material import simp, simp_slope
from mpmtop.model import Model, discretise
from mpmtop.objectives import Objective, objective
from mpmtop.points import MaterialPoints
from mpmtop.scene import LoadCase, Scene, check_together
from mpmtop.shape_functions import ShapeFunction, tent
from mpmtop.variables import DesignVariables


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Objective and constraints g <= 0 (m,) of one design, with its physical densities and its state in each load case.

    The objective is the largest of `objectives` (k,), of which there is one, or one for each case under `Worst`.
    `filtered` (p,) are the densities before a projection, None where the densities come from no design.
    """

    objectives: Array
    constraints: Array
    rho: Array
    states: tuple[Equilibrium, ...]
    filtered: Array | None = None

    @property
    def objective(self) -> float:
        """J."""
        return float(np.max(self.objectives))

    @property
    def state(self) -> Equilibrium:
        """The state, in the first load case."""
        return self.states[0]

    @property
    def u(self) -> Array:
        """Nodal displacements (2a,), in the first load case."""
        return self.state.u


class Term(NamedTuple):
    """A part of an objective or a constraint: factor J(state of a case)."""

    factor: float
    functional: Objective
    case: int


class Sum(NamedTuple):
    """An objective, or a constraint: the sum of its terms less `bound`; `criterion` is what they are of."""

    criterion: Criterion
    terms: tuple[Term, ...]
    bound: float = 0.0


@dataclass(frozen=True, eq=False)
class DesignProblem(DesignVariables):
    """Minimise `objective` subject to sum V_p rho_p <= V* sum V_p and `constraints`, over one variable of the `design`
    for each point, in one load case or several `cases`; see `Scene` for what these are.

    The filter measures distances on the design grid: `design_grid`, or the model's points where they have not been
    moved off it. There, too, points are in the design's passive regions or not. Those that are have density 1 or 0 and
    leave the design vector: a variables are left for p points. Passive solid counts in the first sum; the second one is
    over all points that are not passive void. The filter passes over passive points as if they were absent, or with
    `filter_passive` averages their densities with the others. Raises InvalidScene, EmptyDomain or LoadOutsideBody where
    passive regions leave no design, no feasible one, or a load without material.
    """

    model: Model
    design: Design
    objective: Criterion | Worst = field(default_factory=Compliance)
    design_grid: MaterialPoints | None = None
    filter_passive: bool = False
    constraints: tuple[AtMost, ...] = ()
    cases: tuple[LoadCase, ...] = ()

    def __post_init__(self) -> None:
        check_together(self.model.body, self.design, self.objective, self.constraints, self.cases)
        if not (self.design_grid is None or isinstance(self.design_grid, MaterialPoints)):
            raise InvalidScene(f"design grid {self.design_grid!r}: give `MaterialPoints`, as `seed` makes them")
        if not isinstance(self.filter_passive, bool):
            raise InvalidScene(f"filter_passive {self.filter_passive!r}: say True or False")
        if self.design_grid is not None and len(self.design_grid.x) != len(self.model.points.x):
            raise ValueError(
                f"design grid of {len(self.design_grid.x)} points for a model of {len(self.model.points.x)}: "
                "give one for each, in the same order"
            )
        if not self.space.all_active:
            self._check_passive()
        _ = self.models, self.orbit, [self.model.forces_of((each.unit_load,)) for each in self._displacements]

    def _check_passive(self) -> None:
        self.check_feasible()
        body, points, grid = self.model.body, self.model.points, self.model.grid
        for load in (*body.loads, *(load for case in self.cases for load in case.loads)):
            of = carriers(load, points.x, points.volume, 1e-9 * min(grid.h), body.domain, grid.lines)
            if np.any(self.space.void[of]):
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
    def models(self) -> tuple[Model, ...]:
        """The model in each load case."""
        return case_models(self.model, self.cases)

    @cached_property
    def functional(self) -> Objective:
        """Value and derivatives of what the objective is made of."""
        return self._functional(self.objective.criterion if isinstance(self.objective, Worst) else self.objective)

    def _functional(self, criterion: Criterion) -> Objective:
        return objective(criterion, self.model, self.volume_weight * self.design.volume_fraction)

    @cached_property
    def _objectives(self) -> tuple[Sum, ...]:
        weights = [case.weight for case in self.cases] or [1.0]
        terms = [Term(weight, self.functional, k) for k, weight in enumerate(weights)]
        if isinstance(self.objective, Worst):
            return tuple(Sum(self.objective.criterion, (term,)) for term in terms if term.factor > 0)
        if not self.functional.of_state:
            terms = [Term(1.0, self.functional, 0)]
        return (Sum(self.objective, tuple(term for term in terms if term.factor > 0)),)

    @cached_property
    def _constraints(self) -> tuple[Sum, ...]:
        """All but that of the volume fraction."""
        found = []
        for stated in self.constraints:
            functional = self._functional(stated.criterion)
            in_cases = range(len(self.models) if functional.of_state else 1) if stated.case is None else [stated.case]
            bound = stated.factor * stated.bound
            found += [Sum(stated.criterion, (Term(stated.factor, functional, k),), bound) for k in in_cases]
        return tuple(found)

    @property
    def functionals(self) -> list[Objective]:
        """All that the problem's criteria are made of."""
        return [term.functional for each in (*self._objectives, *self._constraints) for term in each.terms]

    @property
    def tolerance(self) -> float:
        """Of the residual, over the load: the solver's own, or the criteria's where that is tighter."""
        return min(self.model.solver.tolerance, *(functional.tolerance for functional in self.functionals))

    @property
    def others(self) -> int:
        """Number of constraints beside that of the volume fraction."""
        return len(self._constraints)

    @property
    def limits_volume(self) -> bool:
        """Whether the volume fraction is a constraint, the first one; not one that no design exceeds, beside others."""
        return self.design.volume_fraction < 1 or not self.constraints

    @property
    def fingerprint(self) -> str:
        """Hash of all numbers that an iterate depends on: a checkpoint fits a problem of the same ones only.

        They are taken before any BLAS or Fourier transform, and to 24 binary digits, see `digits`: what depends on the
        processor is not among them.
        """
        model, design, grid_points, space = self.model, self.design, self.grid_points, self.space
        young = np.ravel(model.elastic.young)
        law = (float(young[0]), design.penal, design.contrast, design.volume_fraction, design.rho_min)
        passive = None if space.all_active else self.filter_passive
        said = (
            *(
                words(self.objective),
                *map(words, self.constraints),
                words(design.projection),
                words(design.symmetry),
                passive,
            ),
            *(*map(float, law), float(design.filter_radius), *(float(case.weight) for case in self.cases)),
        )
        digest = hashlib.sha256(repr(said).encode())
        transfer, ghost = model.transfer, model.ghost
        touched = transfer.touched
        weights = (case.forces.weight for case in self.models)
        tied = ((case.ties.spring, case.ties.hold, case.ties.pull, case.ties.modulus) for case in self.models)
        ties = (part for parts in tied for part in parts if part.shape[0] > 0)
        sparse = (ghost.jump, ghost.modulus, *(weight for weight in weights if weight is not None), *ties)
        whole = (
            *(
                touched.sum(axis=1),
                transfer.stencil[touched],
                *(np.sort(case.stiffness.dof) for case in self.models),
                space.solid,
                space.void,
            ),
            *(index for matrix in sparse for index in (matrix.indices, matrix.indptr)),
        )
        computed = (
            *(model.points.volume, transfer.grad_N[touched], model.D, model.f_ext),
            *(model.grid.cell_coordinates(grid_points.x), grid_points.volume),
            *(() if transfer.b_bar is None else (transfer.b_bar[touched],)),
            *(() if len(young) == 1 else (young,)),
            *(matrix.data for matrix in sparse),
            *(case.prescribed for case in self.models if case.prescribed is not None),
            *(force for case in self.models[1:] for force in (case.f_ext,)),
            *(model.forces_of((each.unit_load,)).fixed for each in self._displacements),
        )
        for array in (*whole, *map(digits, computed)):
            digest.update(np.ascontiguousarray(array, np.int64).tobytes())
        return digest.hexdigest()

    @property
    def _displacements(self) -> list[Displacement]:
        sought = self.objective.criterion if isinstance(self.objective, Worst) else self.objective
        stated = (sought, *(constraint.criterion for constraint in self.constraints))
        return [criterion for criterion in stated if isinstance(criterion, Displacement)]

    def analyse(self, rho: Array) -> Evaluation:
        """Evaluate physical densities rho (p,) in [0, 1], of whatever origin, at passive points, too."""
        return self._analyse(rho, None)

    def _analyse(self, rho: Array, filtered: Array | None) -> Evaluation:
        rho = physical_densities(rho, len(self.model.points.volume), "point")
        moduli = self.model.elastic.young * simp(rho, self.design.penal, self.design.contrast)[0]
        found = states(self.models, moduli, rho, self.tolerance)
        objectives, others = (
            [self._value(each, found, rho) for each in sums] for sums in (self._objectives, self._constraints)
        )
        volume = [self.volume_weight @ rho - 1] if self.limits_volume else []
        return Evaluation(np.array(objectives), np.array([*volume, *others]), rho, found, filtered)

    def _value(self, of: Sum, found: tuple[Equilibrium, ...], rho: Array) -> float:
        terms = (
            each.factor * each.functional.value(self.models[each.case], found[each.case], rho) for each in of.terms
        )
        return sum(terms, start=0.0) - of.bound

    def remarks(self, evaluation: Evaluation) -> list[UserWarning]:
        """The warnings that displacements of a final design call for: NothingMoves of the one that is sought, but in
        several load cases, and PlaceInVoid. A solve for each, with the factorisations of the evaluation."""
        asked = [(each, not self.cases) for each in self._objectives] + [(each, False) for each in self._constraints]
        said = [
            self._remark(each.criterion, evaluation, term.case, sought)
            for each, sought in asked
            for term in each.terms
            if isinstance(each.criterion, Displacement)
        ]
        return [warning for warning in said if warning is not None]

    def _remark(self, stated: Displacement, evaluation: Evaluation, case: int, sought: bool) -> UserWarning | None:
        model, state = self.models[case], evaluation.states[case]
        unit = model.forces_of((stated.unit_load,)).fixed

        def energy() -> Array:
            v = np.zeros_like(unit)
            v[model.stiffness.dof] = state.solve(unit[model.stiffness.dof])
            strain = model.transfer.strain(v)
            return state.moduli * model.work(v, strain, v, strain)

        return remark(stated, unit, state.u, energy, state.moduli / model.elastic.young, sought=sought)

    def evaluate(self, x: Array) -> Evaluation:
        """Value only, of a design (n,): one factorisation for all cases on the same supports, one solve for each."""
        filtered = self.filter(x)
        return self._analyse(self.densities(filtered), filtered)

    def gradient(self, evaluation: Evaluation) -> tuple[Array, Array]:
        """dJ/dx (n,), or (k, n) of k objectives, and dg/dx (m, n) of an evaluation, with its factorisations.

        Raises InvalidScene where a p-norm of q p < 1 has none: a design of zeros over the reach of the filter.
        """
        objectives, others = (
            [finite_gradient(self._by_design(each, evaluation), each.criterion) for each in sums]
            for sums in (self._objectives, self._constraints)
        )
        volume = [self.volume_gradient(evaluation.filtered)] if self.limits_volume else []
        dg = volume[0] if volume and not others else np.concatenate([*volume, *(other[None] for other in others)])
        return objectives[0] if len(objectives) == 1 else np.stack(objectives), dg

    def _by_design(self, of: Sum, evaluation: Evaluation) -> Array:
        return self.pull_back(evaluation.filtered, self._by_density(of.terms, evaluation))

    def density_gradient(self, evaluation: Evaluation) -> Array:
        """dJ/drho (p,), by the physical densities; from above at zero, where a p-norm's may be infinite. Of several
        objectives, that of the largest."""
        return self._by_density(self._objectives[int(np.argmax(evaluation.objectives))].terms, evaluation)

    def _by_density(self, terms: Iterable[Term], evaluation: Evaluation) -> Array:
        rho = evaluation.rho
        explicit, by_moduli = np.zeros_like(rho), np.zeros_like(rho)
        for factor, functional, case in terms:
            model, state = self.models[case], evaluation.states[case]
            by = functional.derivative(model, state, rho)
            if by.rho is not None:
                explicit = explicit + factor * by.rho
            if functional.of_state:
                found = adjoint(model, state, by)
                by_moduli = by_moduli + factor * moduli_gradient(model, state, found)
                by_load = load_gradient(model, state, found)
                explicit = explicit if by_load is None else explicit + factor * by_load
        slope = simp_slope(rho, self.design.penal, self.design.contrast)
        return explicit + by_moduli * self.model.elastic.young * slope


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
    return DesignProblem(
        model, scene.design, scene.objective, design_grid, filter_passive, scene.constraints, scene.cases
    )
