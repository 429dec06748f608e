"""Parameters of the optimisation past what is sensible, and inputs that must be refused."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np

from mpmtop.body import Material, Support
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.errors import EmptyDomain, InvalidScene, LoadOutsideBody, PointOutsideGrid, UnsupportedBody
from mpmtop.grid import Grid
from mpmtop.loads import PointLoad, PositionLoad
from mpmtop.model import Model, discretise
from mpmtop.optimizers import GCMMA, MMA, OptimalityCriteria, SingleStepGCMMA, optimize
from mpmtop.points import MaterialPoints
from mpmtop.problem import DesignProblem
from mpmtop.region import Circle, Rectangle
from mpmtop.scene import Scene
from validation.measures.derivatives import central_difference
from validation.studies.stability.cases import FUNCTIONS, beam, lattice, model_of
from validation.studies.stability.judge import Case, Finding, direct, refused, worst
from validation.studies.stability.runs import FEASIBLE

STEP = 1e-6
"""Of central differences: their own error is 1e-12 times the third derivative, at p = 100 up to 1e6 of the first."""
RTOL_DIFFERENCE = 1e-5
PENALTIES = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 10.0)
PS = (1.0, 2.0, 4.0, 12.0, 30.0, 60.0, 100.0)
QS = (0.0, 0.25, 0.5, 1.0, 2.0, 3.0)
nan, inf = np.nan, np.inf


@cache
def base(function: str) -> Model:
    """The beam, its points shifted by (0.1, 0.05)."""
    return direct(model_of(function, (0.1, 0.05)))


def problem_of(function: str, **changes: Any) -> DesignProblem:
    """The beam with other parameters of the optimisation, on the same discretisation."""
    scene = beam(**changes)
    return DesignProblem(base(function), scene.design, scene.objective)


def parameters() -> Iterator[Case]:
    """Penalty, p, q, filter radius and volume fraction: gradients; a few iterations; and what is refused."""
    rng = np.random.default_rng(1)
    for penal, p, q in product(PENALTIES, PS, QS):
        if q >= penal:
            continue  # refused, see `invalid_scenes`
        function = str(rng.choice(list(FUNCTIONS)))
        yield Case(
            f"penalty, p, q; {function}",
            f"penalty {penal}, p {p}, q {q}",
            "central difference",
            partial(gradient, function, penal=penal, p=p, q=q),
        )
    for function, penal in product(FUNCTIONS, PENALTIES):
        run = partial(gradient, function, penal=penal)
        yield Case(f"penalty, compliance; {function}", f"penalty {penal}", "central difference", run)
    radii, fractions = (1e-9, 0.1, 0.5, 1.5, 1e3), (1e-3, 0.01, 0.1, 0.4, 0.9, 1 - 1e-12, 1.0)
    for radius, fraction, objective in product(radii, fractions, (Compliance(), PNormStress())):
        function = str(rng.choice(list(FUNCTIONS)))
        yield Case(
            "filter radius and volume fraction",
            f"{function}, radius {radius}, fraction {fraction}, {objective}",
            "feasible, descending",
            partial(descent, function, filter_radius=radius, volume_fraction=fraction, objective=objective),
        )
    for i, (make, error, says) in enumerate(invalid()):
        yield Case("invalid input", f"{i}", "the error to expect", partial(refused, make), (error,), says)


def gradient(function: str, *, penal: float, p: float | None = None, q: float = 0.5) -> Finding:
    """Directional derivative at a random design, by the adjoint and by a central difference."""
    objective = Compliance() if p is None else PNormStress(p, q)
    problem = problem_of(function, penal=penal, objective=objective)
    rng = np.random.default_rng(7)
    x, d = rng.uniform(0.2, 0.9, len(problem.x0)), rng.uniform(-1, 1, len(problem.x0))
    slope = problem.gradient(problem.evaluate(x))[0] @ d
    difference = central_difference(lambda x: problem.evaluate(x).objective, x, d, STEP)
    return Finding(abs(float(difference / slope - 1)) / RTOL_DIFFERENCE)


def descent(function: str, **changes: Any) -> Finding:
    """Five steps of GCMMA: from a feasible design the objective must not rise, nor the volume leave its bound."""
    problem = problem_of(function, **changes)
    iterates = list(optimize(problem, GCMMA(), max_iterations=5))
    rises = [b.objective / a.objective - 1 for a, b in pairwise(iterates)]
    return Finding(worst(worst(*(i.constraints[0] for i in iterates)) / FEASIBLE, worst(*rises) / 1e-8))


class Refusal(NamedTuple):
    """An input that must not be taken, the class of the error to expect, and a word of its message."""

    make: Callable[[], object]
    error: type[Exception]
    says: str


def invalid() -> Iterator[Refusal]:
    """Inputs outside their ranges."""
    yield from invalid_scenes()
    yield from invalid_points()
    yield from invalid_models()
    for force in (1e-170, 1e-200, 1e170, 1e200):
        yield Refusal(partial(analysed, beam(loads=(PointLoad((5.0, 1.0), (0.0, force)),))), ValueError, "units")
    for rho in (nan, -0.1, 1.1, inf):
        yield Refusal(partial(problem_of("tent").analyse, np.full(40, rho)), ValueError, "physical densities")
    yield Refusal(partial(problem_of("tent").analyse, np.ones(39)), ValueError, "one for each point")


def invalid_scenes() -> Iterator[Refusal]:
    """Numbers of a scene, its material and objective, and of update rules."""
    ranges: dict[str, tuple[str, tuple[float, ...]]] = {
        "volume_fraction": ("volume fraction", (0.0, -0.1, 1.1, 1e-4, nan, inf)),
        "filter_radius": ("filter radius", (0.0, -1.0, nan, inf)),
        "rho_min": ("rho_min", (-1e-3, 1.0, 0.5, nan)),
        "contrast": ("contrast", (-1e-9, 1.0, nan, inf)),
        "penal": ("penalty", (0.5, -3.0, nan, inf)),
    }
    for name, (says, values) in ranges.items():
        for value in values:
            changes: dict[str, Any] = {name: value}
            yield Refusal(partial(beam, **changes), InvalidScene, says)
    yield Refusal(partial(beam, supports=()), UnsupportedBody, "support")
    yield Refusal(partial(beam, loads=()), InvalidScene, "load")
    for penal, p, q in product(PENALTIES, PS, QS):
        if q >= penal:
            made = partial(beam, penal=penal, objective=PNormStress(p, q))
            yield Refusal(made, InvalidScene, "below the penalty")
    for young in (0.0, -1.0, nan, inf):
        yield Refusal(partial(Material, young, 0.3), InvalidScene, "Young")
    for nu in (0.5, -1.0, nan):
        yield Refusal(partial(Material, 1.0, nu), InvalidScene, "Poisson")
    for p in (0.5, nan, inf):
        yield Refusal(partial(PNormStress, p, 0.5), InvalidScene, "exponent")
    for q in (-0.1, nan):
        yield Refusal(partial(PNormStress, 12.0, q), InvalidScene, "relaxation")
    for force in (nan, inf):
        yield Refusal(partial(PointLoad, (5.0, 1.0), (0.0, force)), InvalidScene, "force")
    yield Refusal(partial(Circle, (0.0, 0.0), -1.0), InvalidScene, "radius")
    yield Refusal(partial(Rectangle, (1.0, 0.0), (0.0, 1.0)), InvalidScene, "upper bound")
    for move, rule in product((0.0, -0.1, 1.1, nan), (MMA, GCMMA, SingleStepGCMMA, OptimalityCriteria)):
        yield Refusal(partial(rule, move), ValueError, "move")


def invalid_points() -> Iterator[Refusal]:
    """Points without place or size."""
    here, one, half = np.array([[1.0, 1.0]]), np.ones(1), np.ones((1, 2))
    yield Refusal(partial(MaterialPoints, here * nan, one, half), ValueError, "coordinates")
    for volume in (-one, one * nan, one * inf):
        yield Refusal(partial(MaterialPoints, here, volume, half), ValueError, "size")
    for length in (0 * half, half * inf):
        yield Refusal(partial(MaterialPoints, here, one, length), ValueError, "size")
    yield Refusal(partial(MaterialPoints, np.empty((0, 2)), np.empty(0), np.empty((0, 2))), EmptyDomain, "points")


def invalid_models() -> Iterator[Refusal]:
    """Cells, grids, points and loads that do not fit each other."""
    for h in (0.0, -1.0, nan, inf):
        yield Refusal(partial(discretise, beam().body, h), InvalidScene, "spacing")
    yield Refusal(partial(discretise, beam().body, 0.3), InvalidScene, "does not divide")
    for ppc in (0, -1):
        yield Refusal(partial(discretise, beam().body, 1.0, ppc), ValueError, "points per cell")
    small, other = Grid((0.0, 0.0), (1.0, 1.0), (4, 2)), Grid((0.0, 0.0), (1.0, 1.0), (9, 9))
    yield Refusal(partial(model_of, "tent", grid=small), PointOutsideGrid, "enlarge the grid")
    yield Refusal(partial(model_of, "tent", (1e3, 0.0), grid=other), PointOutsideGrid, "enlarge the grid")
    wide = replace(lattice(), half_length=lattice().half_length * 3)
    yield Refusal(partial(model_of, "GIMP", points=wide), ValueError, "cells wide")
    yield Refusal(partial(model_of, "B-spline", ghost=0.01), ValueError, "use tent or gimp")
    yield Refusal(partial(model_of, "tent", ghost=nan), ValueError, "finite")
    at_tip, at_clamp = (5.0, 1.0), (0.0, 1.0)
    for load, says in (
        (PointLoad(at_tip, (0.0, 0.0)), "are zero"),
        (PositionLoad(at_clamp, (0.0, 1.0)), "held nodes"),
        (PointLoad(at_tip, (0.0, 1.0), points=99), "99 points"),
    ):
        yield Refusal(partial(model_of, "tent", scene=beam(loads=(load,))), LoadOutsideBody, says)
    nowhere = beam(supports=(Support(Rectangle((8.0, 0.0), (9.0, 1.0))),))
    yield Refusal(partial(model_of, "tent", scene=nowhere), UnsupportedBody, "holds no node")


def analysed(scene: Scene) -> object:
    """The solid beam of another scene."""
    return DesignProblem(model_of("tent", scene=scene), scene.design).analyse(np.ones(40))
