"""Compliance of a fixed optimised field."""

from functools import cache
from typing import Any

import numpy as np

from mpmtop.arrays import Array
from mpmtop.crossing import Crossing
from mpmtop.equilibrium import equilibrium
from mpmtop.loads import RegionLoad
from mpmtop.material import simp
from mpmtop.optimizers import Problem, optimize
from mpmtop.points import seed
from mpmtop.region import Rectangle
from mpmtop.scene import Scene
from mpmtop.shape_functions import ShapeFunction
from reference_fem.reanalyse import Judgement, build_judge
from reference_fem.simp import design_problem
from validation.bodies.crossing import points_model
from validation.bodies.scenes import cantilever, changed
from validation.measures.outcome import Measure, of_elements, of_points
from validation.methods.analyser import PAPER_RULE, DensityField

RADIUS = 1.5
"""Of the density filter [h], in all designs of the study."""


def tip_scene(per_h: float = 1.0) -> Scene:
    """The cantilever of 40h x 20h with 1/per_h as the unit of length; the force is spread over the last 2h x 4h at
    mid-height, the same for every discretisation."""
    patch = RegionLoad(Rectangle((38 * per_h, 8 * per_h), (40 * per_h, 12 * per_h)), (0.0, -1.0))
    domain = Rectangle((0.0, 0.0), (40 * per_h, 20 * per_h))
    return changed(
        cantilever(), name="cantilever, load on a patch", domain=domain, loads=(patch,), filter_radius=RADIUS * per_h
    )


def optimised(problem: Problem[Any], iterations: int = 40) -> Array:
    """Physical densities (p,) after so many iterations of the paper's loop, or when it stops."""
    for iterate in optimize(problem, PAPER_RULE, max_iterations=iterations):
        last = iterate
    return last.evaluation.rho


@cache
def field() -> DensityField:
    """The fixed field: the cantilever after 40 iterations, one density for each of 40 x 20 bilinear elements."""
    problem = design_problem(tip_scene(), 1.0)
    centres = problem.model.centres
    found = DensityField(centres, np.full_like(centres, 0.5), optimised(problem))
    squares = seed(tip_scene().body.domain, (1.0, 1.0))
    return DensityField(squares.x, squares.half_length, found.at(squares.x))


@cache
def field_compliance(split: int, order: int = 2) -> Judgement:
    """The field on split x split elements for each of its squares."""
    design = field()
    return build_judge(tip_scene(), design.x, design.half_length, split, order)(design.rho)


def field_points(n: int, shape_function: ShapeFunction, ppc: int, crossing: Crossing) -> Measure:
    """Compliance of the field on cells of size 2h / n, its squares' densities given to the points seeded in them."""
    scene = tip_scene(n / 2)
    seeded = seed(scene.body.domain, (1 / ppc, 1 / ppc))
    column, row = np.floor(2 * seeded.x / n).astype(int).T
    rho = field().rho[20 * column + row]
    model = points_model(scene.body, shape_function, ppc, crossing)
    state = equilibrium(model, scene.body.material.young * simp(rho, scene.design.penal, scene.design.contrast)[0])
    return lambda: of_points(model, field_error(float(model.f_ext @ state.u)))


def field_elements(n: int, order: int) -> Measure:
    """The same on n x n elements for each square of the field."""
    design = field()
    judge = build_judge(tip_scene(), design.x, design.half_length, n, order)
    compliance = judge(design.rho).compliance
    return lambda: of_elements(judge.model, field_error(compliance))


def field_error(compliance: float) -> dict[str, float]:
    """Relative error of a compliance of the field, by the reference of 3 x 3 biquadratic elements for each square."""
    return {"compliance": abs(compliance / field_compliance(3).compliance - 1)}
