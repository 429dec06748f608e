"""Scatter: what one arrangement of the cantilever's points makes of displacement, stress and gradient."""

from typing import NamedTuple

import numpy as np

from mpmtop.arrays import Array
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.crossing import Crossing
from mpmtop.model import discretise
from mpmtop.points import MaterialPoints, seed
from mpmtop.problem import DesignProblem
from reference_fem import simp
from validation.bodies.scenes import SPACING, H, cantilever
from validation.methods.analyser import SHAPE_FUNCTIONS, DensityField

DENSITY = 0.4
"""The uniform density."""
COUNTED = 1e-3
"""Entries of a gradient below this part of the reference's largest have no sign worth counting."""


class Scattered(NamedTuple):
    """What one arrangement gives at uniform density: tip displacement, p-norm stress, and gradients beside FEM's.

    Angles [deg] between the gradients by the points' densities, and the share of the p-norm's whose sign differs.
    """

    tip: float
    p_norm: float
    tip_angle: float
    p_norm_angle: float
    flipped: float


def scattered(name: str, crossing: Crossing, reference: tuple[Array, Array]) -> Scattered:
    """One entry of the sweep, both objectives from one factorisation. A function of a module, for joblib.

    `reference` are FEM's gradients (p,) of compliance and p-norm, in the order of the seeded points.
    """
    scene = cantilever()
    points = crossing(seed(scene.body.domain, (SPACING, SPACING)), scene.body.domain)
    model = discretise(scene.body, H, points=points, shape_function=SHAPE_FUNCTIONS[name])
    soft = DesignProblem(model, scene.design)
    stressed = DesignProblem(model, scene.design, PNormStress())
    evaluation = soft.analyse(np.full(len(points.x), DENSITY))
    by_compliance, by_p_norm = soft.density_gradient(evaluation), stressed.density_gradient(evaluation)
    counted = np.abs(reference[1]) > COUNTED * np.abs(reference[1]).max()
    return Scattered(
        evaluation.objective,
        stressed.functional.value(model, evaluation.state, evaluation.rho),
        angle(by_compliance, reference[0]),
        angle(by_p_norm, reference[1]),
        float(np.mean(np.sign(by_p_norm[counted]) != np.sign(reference[1][counted]))),
    )


def angle(a: Array, b: Array) -> float:
    """Angle between two vectors [deg]."""
    return float(np.degrees(np.arccos(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)))))


def fem_gradients(points: MaterialPoints) -> tuple[Array, Array]:
    """Gradients (p,) of compliance and p-norm by the densities of as many bilinear elements, in the points' order."""
    gradients = []
    for objective in (Compliance(), PNormStress()):
        fem = simp.design_problem(cantilever(objective=objective), SPACING)
        gradient = fem.density_gradient(fem.analyse(np.full(len(points.x), DENSITY)))
        gradients.append(
            DensityField(fem.model.centres, np.full_like(fem.model.centres, SPACING / 2), gradient).at(points.x)
        )
    return gradients[0], gradients[1]
