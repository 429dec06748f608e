"""L-brackets by the choices that the paper leaves open: measure of stress, filter radius, update rule."""

from typing import Any, NamedTuple

import numpy as np
from joblib import Parallel, delayed

from mpmtop.criteria import PNormStress, StressMeasure
from mpmtop.crossing import Crossing, Periodic
from mpmtop.optimizers import GCMMA, SingleStepGCMMA, UpdateRule
from validation.bodies.scenes import CORNER, SPACING, l_bracket
from validation.methods.analyser import (
    JOBS,
    MOVE,
    SHAPE_FUNCTIONS,
    Analyser,
    DensityField,
    Optimisation,
    material_points,
)

CROSSING = Periodic(4)
"""Calibrated on the cantilever's tip."""
MEASURES: tuple[StressMeasure, ...] = ("von_mises", "von_mises_in_plane")
RADII = (2.0, 2.2, 2.4)
"""Filter radii in point spacings, stated before any run: the study's own, and up to the 2 to 2.5 that bring the second
cantilever near to 83.57."""
NAMES = ("standard", "GIMP")
CONSERVATIVE = GCMMA(move=MOVE, warm_start=True)
SINGLE_STEP = SingleStepGCMMA(move=MOVE)
STOPS = (200, 400)
"""Iterations at which a run may have been stopped; the paper says “more than 201”."""
SOLID = 0.5
"""Density of a design's outline."""


class Case(NamedTuple):
    """A bracket and how it is optimised; `radius` in point spacings."""

    name: str
    crossing: Crossing | None
    measure: StressMeasure
    radius: float
    rule: UpdateRule = CONSERVATIVE
    iterations: int = 500


def build(case: Case) -> Analyser:
    """The bracket by a method of material points."""
    scene = l_bracket(case.radius * SPACING, objective=objective(case.measure))
    return material_points(SHAPE_FUNCTIONS[case.name], case.name, case.crossing)(scene)


def optimise(case: Case) -> Optimisation:
    """One run, with the designs at the `STOPS`."""
    return Optimisation.of(build(case), case.rule, keep=STOPS, iterations=case.iterations)


def optimised(cases: list[Case]) -> dict[Case, Optimisation]:
    """Every case."""
    return dict(zip(cases, Parallel(n_jobs=JOBS)(delayed(optimise)(case) for case in cases), strict=True))


def clearance(design: DensityField) -> float:
    """Distance from the re-entrant corner to the nearest point of at least half density [h]."""
    material = design.x[design.rho >= SOLID]
    return float(np.min(np.linalg.norm(material - CORNER, axis=1)))


def objective(measure: StressMeasure) -> PNormStress:
    """The paper's p-norm of one of the `MEASURES`."""
    return PNormStress(12.0, 0.5, measure)


def solid(case: Case) -> Any:
    """Analysis of the solid bracket."""
    analyser = build(case)
    return analyser.problem.analyse(np.ones(len(analyser.x)))


def largest(case: Case, run: Optimisation | None = None) -> float:
    """Largest relaxed von Mises stress of a run's design, or of the solid."""
    analyser = build(case)
    rho = np.ones(len(analyser.x)) if run is None else run.design.rho
    return float(np.max(np.sqrt(rho) * analyser.solid_von_mises(analyser.problem.analyse(rho))))
