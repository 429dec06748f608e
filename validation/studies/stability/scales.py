"""Material and units past what is sensible: Poisson's ratio, flat and tall cells, all decades of h, E and F."""

from collections.abc import Iterator
from functools import cache, partial
from itertools import product
from typing import Literal

import numpy as np

from mpmtop.arrays import Array
from mpmtop.body import Material
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.equilibrium import equilibrium
from mpmtop.loads import PointLoad
from mpmtop.model import discretise
from mpmtop.objectives import compliance
from mpmtop.optimizers import GCMMA, optimize
from mpmtop.points import MaterialPoints, seed
from mpmtop.problem import DesignProblem
from mpmtop.scene import Scene
from validation.studies.stability.cases import FUNCTIONS, beam, lattice, model_of
from validation.studies.stability.judge import Analysis, Case, Finding, Limit, direct, distance, quantities, worst

PLANES: tuple[Literal["strain", "stress"], ...] = ("strain", "stress")
LOCKING = Limit("volumetric locking", least=0.1, most=1.0)
"""Limit: see `mpmtop.body.Material`; too stiff, by less than an order of magnitude up to 0.49999."""


def materials() -> Iterator[Analysis]:
    """Poisson's ratio from -0.9 to 0.49999; cells from flat to tall."""
    ratios = (-0.9, -0.5, -0.1, 1e-3, 0.1, 0.2, 0.35, 0.45, 0.49, 0.499, 0.4999, 0.49999)
    for function, nu, plane, s in product(FUNCTIONS, ratios, PLANES, (0.0, 0.3)):
        yield Analysis(
            f"Poisson's ratio, {function}",
            f"{nu}, plane {plane}, {s}",
            partial(model_of, function, (s, s / 2), scene=beam(material=Material(1.0, nu, plane))),
            sane=None if nu < 0 else bent(function, s) * ((1 - nu**2) / (1 - 0.3**2) if plane == "strain" else 1.0),
            limit=LOCKING if nu > 0.45 and plane == "strain" else None,
        )
    for function, k, s in product(FUNCTIONS, [k for k in range(-12, 13) if k != 0], (0.0, 0.1)):
        h = (1.0, 10.0 ** (k / 4))
        points = seed(beam(h=h).body.domain, (h[0] / 2, h[1] / 2)).moved(np.multiply(h, s))
        make = partial(model_of, function, points=points, scene=beam(h=h), h=h)
        yield Analysis(f"aspect ratio, {function}", f"{h[1]:.3g}, {s}", make)


@cache
def bent(function: str, s: float) -> float:
    """Compliance of the beam at Poisson's ratio 0.3 with its points shifted by (s, s / 2), most of it by bending: it
    goes with 1 - nu^2 in plane strain, and not with nu in plane stress."""
    model = direct(model_of(function, (s, s / 2)))
    return compliance(model, equilibrium(model, np.ones(len(model.points.x))))


def units() -> Iterator[Case]:
    """Cell size h, modulus E and force F over all decades: what has no unit must not change."""
    rng = np.random.default_rng(2)
    for h, E, F in product(range(-9, 10, 3), range(-6, 13, 3), range(-12, 13, 3)):
        function, s = str(rng.choice(list(FUNCTIONS))), float(rng.choice((0.0, 0.1, 0.3)))
        yield Case(
            f"h, E, F, {function}",
            f"h = 1e{h}, E = 1e{E}, F = 1e{F}, {s}",
            "invariance",
            partial(scaled, function, s, 10.0**h, 10.0**E, 10.0**F),
        )


def runs_in_units() -> Iterator[Case]:
    """A few steps of GCMMA with h, E and F at the ends of their ranges: the designs must not change."""
    extremes = ((-9, 12, -12), (9, -6, 12), (-9, -6, 12), (9, 12, -12), (-9, 0, 0))
    objectives: tuple[Compliance | PNormStress, ...] = Compliance(), PNormStress()
    for function, objective, (h, E, F) in product(FUNCTIONS, objectives, extremes):
        yield Case(
            f"GCMMA in h, E, F, {function}",
            f"h = 1e{h}, E = 1e{E}, F = 1e{F}, {objective}",
            "invariance",
            partial(same_design, function, objective, 10.0**h, 10.0**E, 10.0**F),
        )


def same_design(function: str, objective: Compliance | PNormStress, h: float, E: float, F: float) -> Finding:
    """Design and objective after five steps, to 1e-8: 1e-10 of an analysis, with what the steps make of it."""
    x, J = designed(function, objective, h, E, F)
    x1, J1 = designed(function, objective, 1.0, 1.0, 1.0)
    return Finding(worst(float(np.abs(x - x1).max()), abs(J / J1 - 1)) / 1e-8)


@cache
def designed(function: str, objective: Compliance | PNormStress, h: float, E: float, F: float) -> tuple[Array, float]:
    """Design (p,) after five steps, and its objective in units of h, E and F."""
    load = PointLoad((5 * h, h), (0.0, -F))
    scene = beam(h=(h, h), material=Material(E), loads=(load,), objective=objective)
    model = direct(model_of(function, scene=scene, h=h, points=seed(scene.body.domain, (h / 2, h / 2))))
    problem = DesignProblem(model, scene.design, objective)
    *_, last = optimize(problem, GCMMA(), max_iterations=5, stop=lambda history: False)
    return last.x, last.objective / (F**2 / E if isinstance(objective, Compliance) else F / h)


def scaled(function: str, s: float, h: float, E: float, F: float) -> Finding:
    """Compliance E / F^2, p-norm h / F, displacement E / F and the gradients beside those of h = E = F = 1."""
    scene = beam(
        h=(h, h),
        material=Material(E),
        loads=(PointLoad((5 * h, h), (0.0, -F)),),
        supports=beam().body.supports,
        contrast=1e-3,
    )
    unit = lattice().moved((s, s / 2))
    points = MaterialPoints(unit.x * h, unit.volume * h**2, unit.half_length * h)
    found = nondimensional(function, scene, points, h, E, F)
    base = unit_beam(function, s)
    return Finding(worst(*(distance(a, b) for a, b in zip(found, base, strict=True))) / 1e-10)


@cache
def unit_beam(function: str, s: float) -> tuple[Array, ...]:
    """The same for h = E = F = 1."""
    return nondimensional(function, beam(contrast=1e-3), lattice().moved((s, s / 2)), 1.0, 1.0, 1.0)


def nondimensional(
    function: str, scene: Scene, points: MaterialPoints, h: float, E: float, F: float
) -> tuple[Array, ...]:
    """All quantities of the beam with random densities, in units of h, E and F."""
    model = discretise(scene.body, h, points=points, shape_function=FUNCTIONS[function])
    rho = np.random.default_rng(5).uniform(0.2, 1, len(points.x))
    found = quantities(model, equilibrium(model, E * (1e-3 + rho**3 * (1 - 1e-3))), rho)
    unit = (F**2 / E, F / h, F**2 / E, F / h, F / E)
    return tuple(part / size for part, size in zip(found, unit, strict=True))
