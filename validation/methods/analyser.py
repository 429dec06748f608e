"""The methods that are compared, behind one face: build the problem, optimise, analyse a design of any origin."""

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, Protocol, Self

import numpy as np
from scipy.spatial import KDTree

from mpmtop import problem
from mpmtop.arrays import Array, Index
from mpmtop.criteria import PNormStress, StressMeasure
from mpmtop.crossing import Crossing
from mpmtop.material import von_mises
from mpmtop.model import discretise
from mpmtop.optimizers import GCMMA, Iterate, Problem, UpdateRule, optimize
from mpmtop.points import MaterialPoints, seed
from mpmtop.scene import Scene
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3, gimp, tent
from reference_fem import elasticity, simp
from reference_fem.reanalyse import thresholded
from validation.bodies.scenes import SPACING, H

SHAPE_FUNCTIONS: dict[str, ShapeFunction] = {
    "standard": tent,
    "GIMP": gimp,
    "quadratic B-spline": bspline2,
    "cubic B-spline": bspline3,
}
"""Shape functions by their names in reports."""

JOBS = 1 if "PYTEST_XDIST_WORKER" in os.environ else 2
"""Processes for long runs that do not depend on each other, unless pytest-xdist has already divided the work."""

MOVE = 0.3
"""The paper's move limit."""
PAPER_RULE = GCMMA(move=MOVE)
ROUNDING_RISE = 1e-9
"""A relative rise of the objective within what GCMMA's acceptance test allows for rounding is none."""


@dataclass(frozen=True, eq=False)
class DensityField:
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

    def black_and_white(self) -> "DensityField":
        """The design cut within its own volume: the densest points 1, the others 0."""
        return replace(self, rho=thresholded(self.rho, self.half_length.prod(axis=1), exceed=0.0))

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
    """A method applied to a scene: its problem and its points.

    `solid_von_mises` gives the stress (p,) that solid material would have under the strain of an evaluation, by the
    measure of the scene's objective.
    """

    name: str
    scene: Scene
    problem: DensityProblem
    x: Array
    half_length: Array
    solid_von_mises: Callable[[Any], Array]

    def compliance(self, design: DensityField) -> float:
        """Compliance of a design on these points, whoever made it."""
        return float(self.problem.analyse(design.at(self.x)).objective)

    def design(self, rho: Array) -> DensityField:
        """A field on this method's points, physical densities in general."""
        return DensityField(self.x, self.half_length, rho)


def stress_objective(scene: Scene) -> PNormStress:
    """The scene's objective, which must be of stress."""
    if not isinstance(scene.objective, PNormStress):
        raise TypeError(f"{scene.name}: its objective is no p-norm of stress")
    return scene.objective


def stress_measure(scene: Scene) -> StressMeasure:
    """Which von Mises stress the scene's objective is of; that with sigma_zz if it is of none."""
    return scene.objective.measure if isinstance(scene.objective, PNormStress) else "von_mises"


def no_stress(evaluation: Any) -> Array:
    """In place of a stress that no study asks for: NaN (p,), not stated."""
    return np.full(len(evaluation.rho), np.nan)


def material_points(
    shape_function: ShapeFunction,
    name: str,
    crossing: Crossing | None = None,
    *,
    points: MaterialPoints | None = None,
    filter_passive: bool = False,
) -> Callable[[Scene], Analyser]:
    """The material point method on cells of size h: `points`, or else 2 x 2 per cell, moved by `crossing`.

    Designs live on the points' positions before the move, where each owns a rectangle of the body.
    """

    def build(scene: Scene) -> Analyser:
        grid = points or seed(scene.body.domain, (SPACING, SPACING))
        moved = crossing(grid, scene.body.domain) if crossing else grid
        model = discretise(scene.body, H, points=moved, shape_function=shape_function)

        def stress(evaluation: problem.Evaluation) -> Array:
            solid = np.full(len(evaluation.rho), model.elastic.young)
            return von_mises(model.stress(solid, evaluation.state.strain), model.elastic, stress_measure(scene))

        design = problem.DesignProblem(model, scene.design, scene.objective, grid, filter_passive)
        return Analyser(name, scene, design, grid.x, grid.half_length, stress)

    return build


def finite_elements(scene: Scene) -> Analyser:
    """Bilinear finite elements, one for each material point of the other methods; stress at their centres."""
    fem = simp.design_problem(scene, SPACING)
    model = fem.model

    def stress(evaluation: simp.Evaluation) -> Array:
        solid = np.full(len(evaluation.rho), model.elastic.young)
        return elasticity.von_mises(elasticity.stress(model, evaluation.u, solid), stress_measure(scene))[:, 0]

    return Analyser("FEM", scene, fem, model.centres, np.full_like(model.centres, SPACING / 2), stress)


METHODS: dict[str, Callable[[Scene], Analyser]] = {
    "standard": material_points(tent, "standard"),
    "GIMP": material_points(gimp, "GIMP"),
    "FEM": finite_elements,
}


@dataclass(frozen=True, eq=False)
class Optimisation:
    """Numbers of a finished optimisation, for iterates 0 to k, and the designs of those kept.

    `objective`, `volume` (fraction) and `solves` (cumulative) are (k + 1,); `designs` holds those kept and the last.
    """

    objective: Array
    volume: Array
    solves: Index
    designs: dict[int, DensityField]
    converged: bool

    @classmethod
    def of(
        cls, analyser: Analyser, rule: UpdateRule = PAPER_RULE, *, keep: tuple[int, ...] = (), iterations: int = 300
    ) -> Self:
        """Run the paper's loop: its stopping rule, `iterations` at most."""
        return cls.collect(optimize(analyser.problem, rule, max_iterations=iterations), analyser, keep)

    @classmethod
    def collect(cls, iterates: Iterable[Iterate[Any]], analyser: Analyser, keep: tuple[int, ...] = ()) -> Self:
        """Consume the iterates of an optimisation of the analyser's problem."""
        rows, designs = [], {}
        for iterate in iterates:
            rows.append((iterate.objective, iterate.constraints[0], iterate.solves))
            if iterate.iteration in keep:
                designs[iterate.iteration] = analyser.design(iterate.evaluation.rho)
        designs[iterate.iteration] = analyser.design(iterate.evaluation.rho)
        objective, constraint, solves = np.array(rows).T
        volume = analyser.scene.design.volume_fraction * (1 + constraint)
        return cls(objective, volume, solves.astype(np.intp), designs, iterate.converged)

    @property
    def iterations(self) -> int:
        """Number of updates made."""
        return len(self.objective) - 1

    @property
    def final(self) -> float:
        """Objective of the last design."""
        return float(self.objective[-1])

    @property
    def design(self) -> DensityField:
        """The last design."""
        return self.designs[self.iterations]

    @property
    def rise(self) -> Array:
        """Relative change of the objective in every iteration, (k,): positive where it rose."""
        return np.diff(self.objective) / self.objective[1:]
