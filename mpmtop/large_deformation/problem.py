"""The design problem of load steps: design -> filter -> SIMP -> trajectory -> objective, for `mpmtop.optimizers`."""

import hashlib
from dataclasses import dataclass, field

import numpy as np

from mpmtop.arrays import Array
from mpmtop.design import Design, physical_densities
from mpmtop.errors import LoadOutsideBody
from mpmtop.fingerprint import digits, words
from mpmtop.large_deformation.model import Model
from mpmtop.large_deformation.objectives import EndCompliance, PathObjective, gradient
from mpmtop.large_deformation.steps import Trajectory, trajectory
from mpmtop.material import simp
from mpmtop.points import MaterialPoints
from mpmtop.variables import DesignVariables


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Objective and constraints g <= 0 (1,) of one design, with its physical densities (p,) and its trajectory.

    `filtered` (p,) are the densities before a projection, None where they come from no design.
    """

    objective: float
    constraints: Array
    rho: Array
    path: Trajectory
    filtered: Array | None = None


@dataclass(frozen=True, eq=False)
class LoadStepProblem(DesignVariables):
    """Minimise `objective` subject to sum V_p rho_p <= V* sum V_p over one variable of the `design` for each point.

    Filter and passive regions are those of the undeformed body; the filter passes over passive points as if they were
    absent. The number of load steps is the model's in every evaluation: where Newton's method needs the load in parts,
    the weights stay, and with them the problem. Raises InvalidScene, EmptyDomain or LoadOutsideBody where passive
    regions leave no design, no feasible one, or a load without material.
    """

    model: Model
    design: Design
    objective: PathObjective = field(default_factory=EndCompliance)

    def __post_init__(self) -> None:
        self.check_feasible()
        if np.any(self.model.force[self.space.void]):
            raise LoadOutsideBody("passive void would carry a part of a load: move the load, or shrink passive_void")

    @property
    def grid_points(self) -> MaterialPoints:
        """The model's points, where they start."""
        return self.model.points

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
        asked = (self.objective, *how, design.projection, design.symmetry, *map(float, law), design.filter_radius)
        digest = hashlib.sha256(repr((model.shape_function.__name__, *map(words, asked))).encode())
        points = model.points
        for whole in (model.unknown, space.solid, space.void):
            digest.update(np.ascontiguousarray(whole, np.int64).tobytes())
        for computed in (points.x, points.volume, points.half_length, model.force, model.sign):
            digest.update(digits(computed).astype(np.int64).tobytes())
        return digest.hexdigest()

    def analyse(self, rho: Array) -> Evaluation:
        """Evaluate physical densities rho (p,) in [0, 1], of whatever origin: one trajectory."""
        return self._analyse(rho, None)

    def _analyse(self, rho: Array, filtered: Array | None) -> Evaluation:
        rho = physical_densities(rho, len(self.model.points.volume), "point")
        path = trajectory(self.model, self.model.young * simp(rho, self.design.penal, self.design.contrast)[0])
        constraints = np.array([self.volume_weight @ rho - 1])
        return Evaluation(self.objective.value(self.model, path, rho), constraints, rho, path, filtered)

    def evaluate(self, design: Array) -> Evaluation:
        """Value only, of a design (a,): one trajectory."""
        filtered = self.filter(design)
        return self._analyse(self.densities(filtered), filtered)

    def gradient(self, evaluation: Evaluation) -> tuple[Array, Array]:
        """dJ/ddesign (a,) and dg/ddesign (1, a) of an evaluation: one sweep back through its steps."""
        by_rho, by_moduli = gradient(self.objective, self.model, evaluation.path, evaluation.rho)
        d_simp = self.model.young * simp(evaluation.rho, self.design.penal, self.design.contrast)[1]
        return (
            self.pull_back(evaluation.filtered, by_rho + by_moduli * d_simp),
            self.volume_gradient(evaluation.filtered),
        )
