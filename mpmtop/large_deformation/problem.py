"""The design problem of load steps: design -> filter -> SIMP -> trajectory -> objective, for `mpmtop.optimizers`."""

import hashlib
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from mpmtop.arrays import Array
from mpmtop.criteria import AtMost, Compliance
from mpmtop.design import Design, physical_densities
from mpmtop.errors import InvalidScene, LoadOutsideBody, NotConverged, PointOutsideGrid, UnsupportedBody
from mpmtop.fingerprint import digits, words
from mpmtop.large_deformation.at_points import fields_of_steps as fields_of_steps  # known to `fields` from here on
from mpmtop.large_deformation.model import Model, in_case
from mpmtop.large_deformation.objectives import EndCompliance, PathObjective, check_objective, gradient
from mpmtop.large_deformation.steps import Trajectory, trajectory
from mpmtop.material import simp
from mpmtop.points import MaterialPoints
from mpmtop.scene import LoadCase, case_bodies, check_together
from mpmtop.variables import DesignVariables


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Objective and constraints g <= 0 (1,) of one design, with its physical densities (p,) and its trajectory in each
    load case.

    `filtered` (p,) are the densities before a projection, None where they come from no design.
    """

    objective: float
    constraints: Array
    rho: Array
    paths: tuple[Trajectory, ...]
    filtered: Array | None = None

    @property
    def path(self) -> Trajectory:
        """The trajectory, in the first load case."""
        return self.paths[0]

    @property
    def state(self) -> Trajectory:
        """What `mpmtop.plot` and `mpmtop.export` show: the trajectory, in the first load case."""
        return self.path


@dataclass(frozen=True, eq=False)
class LoadStepProblem(DesignVariables):
    """Minimise `objective` subject to sum V_p rho_p <= V* sum V_p over one variable of the `design` for each point.

    With load `cases` the objective is the sum of the cases' values, each times its weight: a trajectory and an adjoint
    for each. Filter and passive regions are those of the undeformed body, or of `design_grid` where the model's points
    have been moved off it; the filter passes over passive points as if they were absent, or with `filter_passive`
    averages them with the others. The number of load steps is the model's in every evaluation: where Newton's method
    needs the load in parts, the weights stay, and with them the problem. Raises InvalidScene, EmptyDomain or
    LoadOutsideBody where passive regions leave no design, no feasible one, or a load without material, and for criteria
    of small strain: load steps have objectives of their own, and no `constraints` beside the volume's.
    """

    model: Model
    design: Design
    objective: PathObjective = field(default_factory=EndCompliance)
    design_grid: MaterialPoints | None = None
    filter_passive: bool = False
    constraints: tuple[AtMost, ...] = ()
    cases: tuple[LoadCase, ...] = ()

    def __post_init__(self) -> None:
        check_objective(self.objective)
        if self.constraints:
            raise InvalidScene(
                "constraints beside the volume fraction are of small strain: in large deformation leave out "
                "`constraints`, and weigh what they limit in an objective of your own"
            )
        check_together(self.model.body, self.design, Compliance(), cases=self.cases)
        if self.design_grid is not None and len(self.design_grid.x) != len(self.model.points.x):
            raise ValueError(
                f"design grid of {len(self.design_grid.x)} points for a model of {len(self.model.points.x)}: "
                "give one for each, in the same order"
            )
        self.check_feasible()
        if any(np.any(model.force[self.space.void]) for model in self.models):
            raise LoadOutsideBody("passive void would carry a part of a load: move the load, or shrink passive_void")

    @cached_property
    def models(self) -> tuple[Model, ...]:
        """The model in each load case."""
        if not self.cases:
            return (self.model,)
        return tuple(in_case(self.model, body) for body in case_bodies(self.model.body, self.cases))

    @property
    def weights(self) -> tuple[float, ...]:
        """Those of the cases in the objective."""
        return tuple(case.weight for case in self.cases) or (1.0,)

    @property
    def grid_points(self) -> MaterialPoints:
        """The design grid, or the model's points, where they start."""
        return self.model.points if self.design_grid is None else self.design_grid

    @property
    def point_volume(self) -> Array:
        """Volumes (p,) of the points, where they start."""
        return self.model.points.volume

    @property
    def fingerprint(self) -> str:
        """Hash of all numbers that an iterate depends on: a checkpoint fits a problem of the same ones only.

        None of them comes of a BLAS or a Fourier transform, and none has its last bits, see `digits`.
        """
        model, design, space = self.model, self.design, self.space
        how = (model.frame, model.domains, model.law, model.steps, model.grid)
        law = (model.young, model.alpha, design.penal, design.contrast, design.volume_fraction, design.rho_min)
        averaged = None if space.all_active else self.filter_passive
        asked = (self.objective, *how, design.projection, design.symmetry, *map(float, law), design.filter_radius)
        digest = hashlib.sha256(
            repr((model.shape_function.__name__, *map(words, asked), averaged, self.weights)).encode()
        )
        points = model.points
        for whole in (*(each.unknown for each in self.models), space.solid, space.void):
            digest.update(np.ascontiguousarray(whole, np.int64).tobytes())
        in_cases = [part for each in self.models for part in (each.force, each.sign)]
        for computed in (points.x, points.volume, points.half_length, self.grid_points.x, *in_cases):
            digest.update(digits(computed).astype(np.int64).tobytes())
        return digest.hexdigest()

    def analyse(self, rho: Array) -> Evaluation:
        """Evaluate physical densities rho (p,) in [0, 1], of whatever origin: a trajectory for each case."""
        return self._analyse(rho, None)

    def _analyse(self, rho: Array, filtered: Array | None) -> Evaluation:
        rho = physical_densities(rho, len(self.model.points.volume), "point")
        moduli = self.model.young * simp(rho, self.design.penal, self.design.contrast)[0]
        paths = tuple(self._path(case, moduli) for case in range(len(self.models)))
        each = [self.objective.value(model, path, rho) for model, path in zip(self.models, paths, strict=True)]
        J = sum(weight * value for weight, value in zip(self.weights, each, strict=True))
        return Evaluation(J, np.array([self.volume_weight @ rho - 1]), rho, paths, filtered)

    def _path(self, case: int, moduli: Array) -> Trajectory:
        try:
            return trajectory(self.models[case], moduli)
        except (LoadOutsideBody, NotConverged, PointOutsideGrid, UnsupportedBody) as error:
            if not self.cases:
                raise
            raise type(error)(f"load case {case}: {error}") from error

    def evaluate(self, design: Array) -> Evaluation:
        """Value only, of a design (a,): a trajectory for each case."""
        filtered = self.filter(design)
        return self._analyse(self.densities(filtered), filtered)

    def gradient(self, evaluation: Evaluation) -> tuple[Array, Array]:
        """dJ/ddesign (a,) and dg/ddesign (1, a) of an evaluation: a sweep back through the steps of each case."""
        rho = evaluation.rho
        d_simp = self.model.young * simp(rho, self.design.penal, self.design.contrast)[1]
        dJ = np.zeros_like(rho)
        for model, path, weight in zip(self.models, evaluation.paths, self.weights, strict=True):
            by_rho, by_moduli = gradient(self.objective, model, path, rho)
            dJ += weight * (by_rho + by_moduli * d_simp)
        return self.pull_back(evaluation.filtered, dJ), self.volume_gradient(evaluation.filtered)
