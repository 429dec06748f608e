"""Each method on the scene: its design problem, on points or elements that own the same rectangles of the body."""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpmtop.comparison.asked import FEM, GIMP, MPM, NONE, SPLINE, Asked
from mpmtop.comparison.crossed import as_seeded
from mpmtop.crossing import named
from mpmtop.diagnose import ModelWarning
from mpmtop.errors import InvalidScene, LoadOutsideBody, PointOutsideGrid, UnsupportedBody
from mpmtop.large_deformation import model as large
from mpmtop.large_deformation.problem import LoadStepProblem
from mpmtop.model import discretise
from mpmtop.planning import plan
from mpmtop.points import MaterialPoints, seed
from mpmtop.problem import DesignProblem
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3, gimp, tent
from reference_fem import simp
from reference_fem.large_deformation import LogarithmicLaw, large_model
from reference_fem.large_design import LargeDesignProblem, WeightedCompliance

SHAPE_FUNCTIONS: dict[str, ShapeFunction] = {MPM: tent, GIMP: gimp, SPLINE: bspline2, "bspline3": bspline3}
LEVELS = (1 / 3, 2 / 3, 1.0)
"""Load levels by which elements in large deformation get to the whole load: they lead Newton's method and decide
nothing."""
CANNOT = (InvalidScene, LoadOutsideBody, UnsupportedBody, PointOutsideGrid)
"""A method cannot be asked for this scene."""
SAME = 1e-12
"""Of the largest gradient: what rounding leaves between two ways to say the same function."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A method's design problem, its model, the rectangles that its densities own, as points, and what misleads."""

    problem: Any
    model: Any
    design_points: MaterialPoints
    unknowns: int
    findings: tuple[str, ...] = ()

    @property
    def plan(self) -> str:
        """What an analysis computes and what it skips; "" where nothing is planned."""
        return plan(self.problem) if isinstance(self.problem, DesignProblem) else ""


def prepare(asked: Asked, method: str, crossing: str = NONE) -> Prepared:
    """The method's problem; raises one of `CANNOT`, with what to change."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)  # on the page, among the findings
        if method == FEM:
            return _elements(asked)
        shape_function = SHAPE_FUNCTIONS[method]
        return _in_load_steps(asked, shape_function) if asked.load_steps else _points(asked, shape_function, crossing)


def _elements(asked: Asked) -> Prepared:
    problem = simp.design_problem(asked.scene, asked.spacing)
    model = problem.model
    at = MaterialPoints(model.centres, model.area, np.tile(np.array(asked.spacing) / 2, (len(model.area), 1)))
    if asked.load_steps is None:
        return Prepared(problem, model, at, len(model.free))
    return Prepared(in_large_deformation(problem), model, at, len(model.free))


def in_large_deformation(problem: simp.DesignProblem) -> LargeDesignProblem:
    """The problem of the same elements at full load, in load steps."""
    law = LogarithmicLaw(problem.model.body.material.poisson)
    objective = WeightedCompliance((0.0,) * (len(LEVELS) - 1) + (1.0,))
    return LargeDesignProblem(problem, large_model(problem.model, law), LEVELS, objective)


def _points(asked: Asked, shape_function: ShapeFunction, crossing: str) -> Prepared:
    scene = asked.scene
    ghost = asked.ghost if shape_function in (tent, gimp) else 0.0
    seeded = seed(scene.body.domain, asked.spacing)
    if crossing == NONE:
        model = discretise(scene.body, asked.h, asked.ppc, shape_function, ghost=ghost)
    else:
        moved = named(crossing)(seeded, scene.body.domain, asked.h[0], float(scene.body.domain.bounds[0][0]))
        scene = as_seeded(scene, seeded.x, moved.x)
        model = discretise(scene.body, asked.h, shape_function=shape_function, points=moved, ghost=ghost)
    problem = DesignProblem(
        model, scene.design, scene.objective, seeded, constraints=scene.constraints, cases=scene.cases
    )
    found = tuple(f"{type(finding).__name__}: {finding}" for finding in model.findings)
    return Prepared(problem, model, seeded, len(model.stiffness.dof), found)


def _in_load_steps(asked: Asked, shape_function: ShapeFunction) -> Prepared:
    assert asked.load_steps is not None
    model = large.discretise(asked.scene.body, asked.h, asked.ppc, shape_function, steps=asked.load_steps)
    return Prepared(LoadStepProblem(model, asked.scene.design), model, model.points, model.unknowns)


def one_method(a: Prepared, b: Prepared) -> bool:
    """Whether two methods of material points are the same equations: GIMP is the tent's where no domain leaves its
    cell."""
    if not (isinstance(a.problem, DesignProblem) and isinstance(b.problem, DesignProblem)):
        return False
    first, second = a.model.transfer, b.model.transfer
    if not np.array_equal(first.nodes, second.nodes):
        return False
    largest = abs(first.B).max()
    alike = abs(first.B - second.B).max() <= SAME * largest
    return bool(alike and np.allclose(a.model.f_ext, b.model.f_ext, rtol=0, atol=SAME * abs(a.model.f_ext).max()))
