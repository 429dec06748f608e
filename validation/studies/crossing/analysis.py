"""The solid cantilever with moved points in equilibrium, and the same integrated exactly."""

from typing import NamedTuple

import numpy as np

from mpmtop.arrays import Array
from mpmtop.equilibrium import Equilibrium, equilibrium
from mpmtop.model import Model, discretise
from mpmtop.points import MaterialPoints
from mpmtop.scene import Scene
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3, tent
from validation.bodies.crossing import integrated_exactly
from validation.bodies.scenes import H

RTOL_ANALYSIS = 1e-8
"""One analysis: condition number up to 1e5 times rounding 1e-16, with two digits to spare."""
EXACT: dict[str, tuple[ShapeFunction, int, int]] = {
    "standard": (tent, 1, 2),
    "GIMP": (tent, 1, 2),  # what GIMP tends to on ever smaller domains
    "quadratic B-spline": (bspline2, 2, 3),
    "cubic B-spline": (bspline3, 1, 4),
}
"""Functions, and the parts of a cell and the Gauss points in each that integrate their products exactly."""


class Analysis(NamedTuple):
    """A solid body in equilibrium."""

    model: Model
    state: Equilibrium

    @property
    def tip(self) -> float:
        """Tip displacement under the unit force [F/E0]."""
        return float(self.state.f_ext @ self.state.u)


def solid(scene: Scene, points: MaterialPoints, shape_function: ShapeFunction) -> Analysis:
    model = discretise(scene.body, H, points=points, shape_function=shape_function)
    return Analysis(model, equilibrium(model, np.ones(len(points.x))))


def exactly(analysis: Analysis, lower: Array, upper: Array, name: str) -> float:
    """Tip displacement with the stiffness integrated exactly over the body, under the same nodal forces."""
    function, *rule = EXACT[name]
    model, points = analysis.model, integrated_exactly(lower, upper, *rule)
    exact = discretise(model.body, points=points, shape_function=function, grid=model.grid)
    if not np.array_equal(exact.transfer.nodes, model.transfer.nodes):
        raise ValueError("points and body touch other nodes: choose a shift that takes a column over a boundary")
    return Analysis(exact, equilibrium(exact, np.ones(len(points.x)), f_ext=model.f_ext)).tip
