"""The methods that are compared, behind one face: build the problem, optimise, analyse a design of any origin."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, Self

import numpy as np
from scipy.spatial import KDTree

from mpmtop import problem
from mpmtop.equilibrium import discretise
from mpmtop.gcmma import GCMMA, Problem, UpdateRule
from mpmtop.material import von_mises
from mpmtop.optimize import Iterate, optimize
from mpmtop.scene import Array, Scene
from mpmtop.shape_functions import ShapeFunction, gimp, tent
from reference_fem import elasticity, simp
from validation.scenes import SPACING, H

MOVE = 0.3
"""The paper's move limit."""


@dataclass(frozen=True, eq=False)
class Design:
    """Physical densities rho (p,) at positions x (p, 2) that own rectangles of half-length (p, 2)."""

    x: Array
    half_length: Array
    rho: Array

    def at(self, x: Array) -> Array:
        """Densities in the order of the positions x (p, 2), which must be the design's own."""
        distance, nearest = KDTree(self.x).query(x)
        if len(x) != len(self.x) or distance.max() > 1e-6 * self.half_length.min():
            raise ValueError("the design lives on other points: analyse it with `reference_fem.reanalyse`")
        return self.rho[nearest]

    @property
    def grayness(self) -> float:
        """Measure of discreteness, 4 mean(rho (1 - rho)) over the volume: 0 black and white, 1 all grey.

        Source: Sigmund (2007), Struct. Multidisc. Optim. 33:401.
        """
        return float(np.average(4 * self.rho * (1 - self.rho), weights=self.half_length.prod(axis=1)))


class DensityProblem(Problem[Any], Protocol):
    """An optimisation problem that also analyses physical densities (p,) directly."""

    def analyse(self, rho: Array) -> Any: ...


@dataclass(frozen=True, eq=False)
class Analyser:
    """A method applied to a scene: its problem, its points, and the von Mises stress (p,) of an evaluation."""

    name: str
    problem: DensityProblem
    x: Array
    half_length: Array
    von_mises: Callable[[Any], Array]

    def compliance(self, design: Design) -> float:
        """Compliance of a design on these points, whoever made it."""
        return float(self.problem.analyse(design.at(self.x)).objective)

    def design(self, rho: Array) -> Design:
        """A field on this method's points, physical densities in general."""
        return Design(self.x, self.half_length, rho)


def material_points(shape_function: ShapeFunction, name: str) -> Callable[[Scene], Analyser]:
    """The material point method, 2 x 2 points per cell of size h."""

    def build(scene: Scene) -> Analyser:
        model = discretise(scene, H, 2, shape_function)

        def stress(evaluation: problem.Evaluation) -> Array:
            state = evaluation.state
            return von_mises(model.stress(state.moduli, state.strain), scene.material)

        return Analyser(name, problem.DesignProblem(model), model.points.x, model.points.half_length, stress)

    return build


def finite_elements(scene: Scene) -> Analyser:
    """Bilinear finite elements, one for each material point of the other methods; stress at their centres."""
    fem = simp.compliance_problem(scene, SPACING)
    model = fem.model

    def stress(evaluation: simp.Evaluation) -> Array:
        young = simp.simp(evaluation.rho, scene)[0]
        return elasticity.von_mises(elasticity.stress(model, evaluation.u, young))[:, 0]

    return Analyser("FEM", fem, model.centres, np.full_like(model.centres, SPACING / 2), stress)


METHODS: dict[str, Callable[[Scene], Analyser]] = {
    "standard": material_points(tent, "standard"),
    "GIMP": material_points(gimp, "GIMP"),
    "FEM": finite_elements,
}


@dataclass(frozen=True, eq=False)
class Optimisation:
    """A finished optimisation: all iterates' numbers, and the designs of those kept."""

    analyser: Analyser
    iterates: list[Iterate[Any]]

    @classmethod
    def of(cls, analyser: Analyser, rule: UpdateRule | None = None) -> Self:
        """The paper's loop: GCMMA with its move limit (or another rule), its stopping rule, 300 iterations at most."""
        return cls(analyser, list(optimize(analyser.problem, rule or GCMMA(move=MOVE), max_iterations=300)))

    @property
    def last(self) -> Iterate[Any]:
        """The final iterate."""
        return self.iterates[-1]

    @cached_property
    def objective(self) -> Array:
        """Objective of every iterate, (k + 1,)."""
        return np.array([iterate.objective for iterate in self.iterates])

    @cached_property
    def volume(self) -> Array:
        """Volume fraction of every iterate, (k + 1,)."""
        fraction = self.analyser.problem.x0[0]
        return fraction * (1 + np.array([iterate.constraints[0] for iterate in self.iterates]))

    def design(self, iteration: int = -1) -> Design:
        """Design of an iterate."""
        return self.analyser.design(self.iterates[iteration].evaluation.rho)
