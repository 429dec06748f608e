"""The bracket with points moved by a family, its runs, and stress of it by the method itself."""

import numpy as np

from mpmtop.arrays import Array
from mpmtop.crossing import Crossing, Periodic
from mpmtop.points import seed
from validation.bodies.scenes import SPACING, l_bracket
from validation.methods.analyser import (
    SHAPE_FUNCTIONS,
    Analyser,
    Optimisation,
    material_points,
    stress_objective,
)
from validation.methods.optima import WARM

CROSSING = Periodic(4)
"""The cantilever study's calibration."""
CROSSED = ("standard", "GIMP")
"""Methods that optimise with crossing, beside standard without."""
RTOL_OPTIMUM = 0.03
"""As without crossing: rounding is amplified over 250 iterations of an objective with many near-optima."""
RTOL_ANALYSIS = 1e-8
"""One analysis of a given design, condition number 1e6."""


def build(name: str, crossing: Crossing | None) -> Analyser:
    return material_points(SHAPE_FUNCTIONS[name], name, crossing)(l_bracket())


def optimise(name: str) -> Optimisation:
    """One run with crossing, by the rule of the bracket without; a function of the module, for joblib."""
    return Optimisation.of(build(name, CROSSING), WARM, iterations=500)


def solid_von_mises(analyser: Analyser) -> Array:
    """Von Mises stress (p,) of the solid bracket, in the order of the lattice of points."""
    lattice = seed(l_bracket().body.domain, (SPACING, SPACING)).x
    field = analyser.solid_von_mises(analyser.problem.analyse(np.ones(len(analyser.x))))
    return analyser.design(field).at(lattice)


def p_norm(analyser: Analyser) -> float:
    """p-norm of the solid bracket by the method itself."""
    return float(analyser.problem.analyse(np.ones(len(analyser.x))).objective)


def relaxed(analyser: Analyser, rho: Array) -> Array:
    """rho^q vm (p,) by the method itself."""
    q = stress_objective(analyser.scene).q
    return rho**q * analyser.solid_von_mises(analyser.problem.analyse(rho))
