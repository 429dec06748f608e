"""Designs of one cantilever by every method, and their judge."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import KDTree

from mpmtop.arrays import Array
from mpmtop.body import Body, Support
from mpmtop.criteria import Compliance
from mpmtop.design import Design
from mpmtop.errors import NotConverged
from mpmtop.grid import Grid
from mpmtop.large_deformation.model import discretise
from mpmtop.large_deformation.objectives import EndCompliance, PathCompliance
from mpmtop.large_deformation.problem import LoadStepProblem
from mpmtop.loads import RegionLoad
from mpmtop.model import discretise as discretise_small
from mpmtop.optimizers import GCMMA, optimize
from mpmtop.optimizers.protocols import Problem
from mpmtop.optimizers.start import placed
from mpmtop.points import MaterialPoints, seed
from mpmtop.problem import DesignProblem
from mpmtop.region import Rectangle
from mpmtop.shape_functions import gimp
from reference_fem import elasticity, simp
from reference_fem.large_deformation import LogarithmicLaw, large_model
from reference_fem.large_design import LargeDesignProblem, WeightedCompliance
from validation.bodies.large import GIMP, INF, METHODS, SPLINE, TENT, TOTAL

LENGTH, DEPTH = 80.0, 20.0
LOAD = 0.055
"""Of the modulus and the spacing of the points: the linear design's tip goes down by some 30 % of the length."""
H, STEPS = 2.0, 5
TIP = Rectangle((LENGTH - 2, DEPTH / 2 - 2), (LENGTH, DEPTH / 2 + 2))
BODY = Body(
    Rectangle((0.0, 0.0), (LENGTH, DEPTH)),
    (Support(Rectangle((-INF, -INF), (0.0, INF))),),
    (RegionLoad(TIP, (0.0, -LOAD)),),
)
DESIGN = Design(volume_fraction=0.5, filter_radius=3.0, passive_solid=TIP)
BOX = Grid((-8.0, -84.0), (H, H), (52, 60))
BACKGROUND = 1e-5
JUDGED = (1 / 3, 2 / 3, 1.0)
LINEAR, FEM, PATH = "linear", "FEM", "GIMP, path"
NONLINEAR = (TOTAL, GIMP, TENT, SPLINE, FEM, PATH)
UNIFORM, FROM_LINEAR = STARTS = "uniform", "linear design"


class Run(NamedTuple):
    """Densities (p,) at the points and the method's own objective of the last design that it could analyse; its
    iterations and analyses; how the run ended: an outcome of the optimiser, or the error that stopped it; and the most
    Newton steps of a load step of that design, 0 where there are none."""

    rho: Array
    objective: float
    iterations: int
    solves: int
    end: str
    newton: int = 0


class Judged(NamedTuple):
    """f . u by elements, one for each point, at the `JUDGED` load levels by the level, (3,); of linear
    elasticity; and the tip's displacement by the length at full load."""

    levels: Array
    linear: float
    tip: float


def problem(method: str) -> Problem[Any]:
    """The design problem as a method sees it; all have the same points, or an element in the place of each."""
    if method == LINEAR:
        return DesignProblem(discretise_small(BODY, H, 2, gimp), DESIGN, Compliance())
    if method == FEM:
        return elements(1, JUDGED)  # the levels lead Newton's method and decide nothing
    objective = PathCompliance() if method == PATH else EndCompliance()
    # void is in all of them, and without a background it inverts
    how = METHODS[GIMP if method == PATH else method] | {"alpha": BACKGROUND}
    return LoadStepProblem(discretise(BODY, ppc=2, steps=STEPS, grid=BOX, **how), DESIGN, objective)


def elements(order: int, levels: tuple[float, ...]) -> LargeDesignProblem:
    """The problem by one element for each point, of the end compliance."""
    linear = simp.DesignProblem(elasticity.discretise(BODY, H / 2, order), DESIGN)
    weights = (0.0,) * (len(levels) - 1) + (1.0,)
    law = LogarithmicLaw(BODY.material.poisson)
    return LargeDesignProblem(linear, large_model(linear.model, law), levels, WeightedCompliance(weights))


@cache
def linear_design() -> tuple[Array, Array, Run]:
    """The converged design of linear elasticity: positions (n, 2) and values (n,) of its variables, and the run."""
    of = problem(LINEAR)
    *_, last = optimize(of, GCMMA(), max_iterations=500)
    told = Run(last.evaluation.rho, last.objective, last.iteration, last.solves, last.outcome)
    return placed(of).positions, last.x, told


def optimised(method: str, start: str, iterations: int) -> Run:
    """A method's design after so many iterations from a uniform field or from the linear design."""
    if method == LINEAR:
        return linear_design()[-1]
    positions, x, _ = linear_design()
    begin = None if start == UNIFORM else lambda here: x[KDTree(positions).query(here)[1]]
    last, end = None, ""
    try:
        for last in optimize(problem(method), GCMMA(), start=begin, max_iterations=iterations):
            end = last.outcome
    except NotConverged as error:
        end = str(error)
    if last is None:
        return Run(np.full(len(points().x), np.nan), np.nan, 0, 1, end)
    rho = last.evaluation.rho
    if method == FEM:
        rho = rho[KDTree(judge().model.fem.centres).query(points().x)[1]]
    newton = 0 if method == FEM else max(last.evaluation.path.newton_steps)
    return Run(rho, last.objective, last.iteration, last.solves, end, newton)


def points() -> MaterialPoints:
    """The points of all methods."""
    return seed(BODY.domain, (H / 2, H / 2))


@cache
def judge(order: int = 2) -> LargeDesignProblem:
    """The problem by biquadratic elements, or those of another order."""
    return elements(order, JUDGED)


def judged(rho: Array, order: int = 2) -> Judged:
    """A design (p,) judged."""
    of = judge(order)
    at_elements = rho[KDTree(points().x).query(of.model.fem.centres)[1]]
    at = of.analyse(at_elements)
    f = of.model.fem.f_ext
    work = np.array([f @ u for u in at.u])
    return Judged(work / JUDGED, of.linear.analyse(at_elements).objective, float(work[-1] / LOAD / LENGTH))
