"""Parameters of the optimisation past what is sensible, and inputs that must be refused."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from itertools import pairwise, product
from typing import Any

import numpy as np

from mpmtop.equilibrium import Model, discretise
from mpmtop.gcmma import GCMMA, MMA, OptimalityCriteria, SingleStepGCMMA
from mpmtop.grid import Grid
from mpmtop.optimize import optimize
from mpmtop.points import MaterialPoints
from mpmtop.problem import DesignProblem
from mpmtop.region import Circle, Rectangle
from mpmtop.scene import Compliance, Material, PNormStress, PointLoad, Scene, Support
from validation.stability import Case, Finding, direct, refused, worst
from validation.stability_cases import FUNCTIONS, beam, lattice, model_of
from validation.stability_runs import FEASIBLE

STEP = 1e-6
"""Of central differences: their own error is 1e-12 times the third derivative, at p = 100 up to 1e6 of the first."""
RTOL_DIFFERENCE = 1e-5


@cache
def base(function: str) -> Model:
    """The beam, its points shifted by (0.1, 0.05)."""
    return direct(model_of(function, (0.1, 0.05)))


def problem_of(function: str, **changes: Any) -> DesignProblem:
    """The beam with other parameters of the optimisation, on the same discretisation."""
    return DesignProblem(replace(base(function), scene=beam(**changes)))


def parameters() -> Iterator[Case]:
    """Penalty, p, q, filter radius and volume fraction: gradients; a few iterations; and what is refused."""
    penalties, ps, qs = (1, 1.5, 2, 3, 4, 6, 10), (1, 2, 4, 12, 30, 60, 100), (0, 0.25, 0.5, 1, 2, 3)
    for i, (penal, p, q) in enumerate(product(penalties, ps, qs)):
        function = list(FUNCTIONS)[i % 3]
        yield Case(
            f"penalty, p, q; {function}",
            f"penalty {penal}, p {p}, q {q}",
            "central difference",
            partial(gradient, function, penal=float(penal), p=float(p), q=float(q)),
        )
    for function, penal in product(FUNCTIONS, penalties):
        run = partial(gradient, function, penal=float(penal))
        yield Case(f"penalty, compliance; {function}", f"penalty {penal}", "central difference", run)
    radii, fractions = (1e-9, 0.1, 0.5, 1.5, 1e3), (1e-3, 0.01, 0.1, 0.4, 0.9, 1 - 1e-12, 1.0)
    for i, (radius, fraction, objective) in enumerate(product(radii, fractions, (Compliance(), PNormStress()))):
        function = list(FUNCTIONS)[i % 3]
        yield Case(
            "filter radius and volume fraction",
            f"{function}, radius {radius}, fraction {fraction}, {objective}",
            "feasible, descending",
            partial(descent, function, filter_radius=radius, volume_fraction=fraction, objective=objective),
        )
    for i, make in enumerate(invalid()):
        yield Case("invalid input", f"{i}", "a named error", partial(refused, make))


def gradient(function: str, *, penal: float, p: float | None = None, q: float = 0.5) -> Finding:
    """Directional derivative at a random design, by the adjoint and by a central difference."""
    objective = Compliance() if p is None else PNormStress(p, q)
    problem = problem_of(function, penal=penal, objective=objective)
    rng = np.random.default_rng(7)
    x, d = rng.uniform(0.2, 0.9, len(problem.x0)), rng.uniform(-1, 1, len(problem.x0))
    slope = problem.gradient(problem.evaluate(x))[0] @ d
    after, before = (problem.evaluate(x + way * STEP * d).objective for way in (1, -1))
    return Finding(abs(float((after - before) / (2 * STEP) / slope - 1)) / RTOL_DIFFERENCE)


def descent(function: str, **changes: Any) -> Finding:
    """Five steps of GCMMA: from a feasible design the objective must not rise, nor the volume leave its bound."""
    problem = problem_of(function, **changes)
    iterates = list(optimize(problem, GCMMA(), max_iterations=5))
    rises = [b.objective / a.objective - 1 for a, b in pairwise(iterates)]
    return Finding(worst(worst(*(i.constraints[0] for i in iterates)) / FEASIBLE, worst(*rises) / 1e-8))


def invalid() -> Iterator[Callable[[], object]]:
    """Inputs outside their ranges."""
    nan, inf = np.nan, np.inf
    ranges: dict[str, tuple[float, ...]] = {
        "volume_fraction": (0.0, -0.1, 1.1, 1e-4, nan, inf),
        "filter_radius": (0.0, -1.0, nan, inf),
        "rho_min": (-1e-3, 1.0, 0.5, nan),
        "contrast": (-1e-9, 1.0, nan, inf),
        "penal": (0.5, -3.0, nan, inf),
    }
    for name, values in ranges.items():
        for value in values:
            changes: dict[str, Any] = {name: value}
            yield partial(beam, **changes)
    yield partial(beam, supports=())
    yield partial(beam, loads=())
    yield partial(beam, objective=PNormStress(12, 3.5))
    for young, nu in ((0.0, 0.3), (-1.0, 0.3), (nan, 0.3), (inf, 0.3), (1.0, 0.5), (1.0, -1.0), (1.0, nan)):
        yield partial(Material, young, nu)
    for p, q in ((0.5, 0.5), (nan, 0.5), (inf, 0.5), (12.0, -0.1), (12.0, nan)):
        yield partial(PNormStress, p, q)
    for h in (0.0, -1.0, nan, inf, 0.3):
        yield partial(discretise, beam(), h)
    for ppc in (0, -1):
        yield partial(discretise, beam(), 1.0, ppc)
    for move in (0.0, -0.1, 1.1, nan):
        for rule in (MMA, GCMMA, SingleStepGCMMA, OptimalityCriteria):
            yield partial(rule, move)
    here, one = np.array([[1.0, 1.0]]), np.ones(1)
    yield partial(MaterialPoints, here * nan, one, np.ones((1, 2)))
    yield partial(MaterialPoints, here, -one, np.ones((1, 2)))
    yield partial(MaterialPoints, here, one, np.zeros((1, 2)))
    yield partial(MaterialPoints, here, one * nan, np.ones((1, 2)))
    yield partial(MaterialPoints, here, one * inf, np.ones((1, 2)))
    yield partial(MaterialPoints, here, one, np.full((1, 2), inf))
    yield partial(MaterialPoints, np.empty((0, 2)), np.empty(0), np.empty((0, 2)))
    yield partial(Circle, (0.0, 0.0), -1.0)
    yield partial(Rectangle, (1.0, 0.0), (0.0, 1.0))
    yield partial(model_of, "tent", grid=Grid((0.0, 0.0), (1.0, 1.0), (4, 2)))
    yield partial(model_of, "tent", (1e3, 0.0), grid=Grid((0.0, 0.0), (1.0, 1.0), (9, 9)))
    yield partial(model_of, "GIMP", points=replace(lattice(), half_length=lattice().half_length * 3))
    yield partial(model_of, "B-spline", ghost=0.01)
    yield partial(model_of, "tent", ghost=nan)
    yield partial(model_of, "tent", scene=beam(loads=(PointLoad((5.0, 1.0), (0.0, 0.0)),)))
    yield partial(model_of, "tent", scene=beam(loads=(PointLoad((0.0, 1.0), (0.0, 1.0), points=0),)))
    yield partial(model_of, "tent", scene=beam(loads=(PointLoad((5.0, 1.0), (0.0, 1.0), points=99),)))
    yield partial(model_of, "tent", scene=beam(supports=(Support(Rectangle((8.0, 0.0), (9.0, 1.0))),)))
    for force in (nan, inf):
        yield partial(PointLoad, (5.0, 1.0), (0.0, force))
    for force in (1e-170, 1e-200, 1e170, 1e200):
        yield partial(analysed, beam(loads=(PointLoad((5.0, 1.0), (0.0, force)),)))
    for rho in (nan, -0.1, 1.1, inf):
        yield partial(problem_of("tent").analyse, np.full(40, rho))
    yield partial(problem_of("tent").analyse, np.ones(39))


def analysed(scene: Scene) -> object:
    """The solid beam of another scene."""
    return DesignProblem(model_of("tent", scene=scene)).analyse(np.ones(40))
