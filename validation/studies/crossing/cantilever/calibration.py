"""Families of moved points, each calibrated on one number of the paper."""

from typing import NamedTuple

import numpy as np

from mpmtop.crossing import Crossing
from validation.bodies.scenes import cantilever
from validation.methods.analyser import SHAPE_FUNCTIONS, material_points

RTOL_OPTIMUM = 2e-3
"""As for the cantilever without crossing: a hundred iterations amplify another processor's rounding to a few 1e-4."""

REPRODUCTION = "periodic(n, 0.26)"
"""The family whose stress field has the paper's periodic overshoots; its runs are shown in full."""
NAMES = ("standard", "GIMP")


class Calibration(NamedTuple):
    """The member of a family nearest to the paper's +13.8 %, and the rise of the tip displacement by method."""

    crossing: Crossing
    rise: dict[str, float]


def tip(name: str, crossing: Crossing | None = None) -> float:
    """Tip displacement of the solid, equal to its compliance under the unit force."""
    analyser = material_points(SHAPE_FUNCTIONS[name], name, crossing)(cantilever())
    return float(analyser.problem.analyse(np.ones(len(analyser.x))).objective)
