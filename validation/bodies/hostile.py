"""Bodies in large deformation at random: methods, laws, loads, moduli and units; what load steps make of each."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from mpmtop.arrays import Array
from mpmtop.body import Body, Material, Support
from mpmtop.errors import LoadOutsideBody, NotConverged, PointOutsideGrid, UnsupportedBody
from mpmtop.large_deformation.law import Hencky, NeoHookean, jacobian
from mpmtop.large_deformation.model import Frame, Model, discretise
from mpmtop.large_deformation.objectives import EndCompliance, gradient
from mpmtop.large_deformation.steps import trajectory
from mpmtop.loads import RegionLoad
from mpmtop.region import Rectangle
from mpmtop.shape_functions import bspline2, gimp, tent

NAMED = (LoadOutsideBody, NotConverged, PointOutsideGrid, UnsupportedBody)
INF = np.inf


@dataclass(frozen=True)
class Case:
    """A model, its point moduli (p,) and a direction (p,) in which they change."""

    model: Model
    moduli: Array
    direction: Array


def case(seed: int) -> Case:
    """Cells of any size and ratio, anywhere; 1 to 3 points per cell and direction; loads of 1e-5 to 1 of E in bending;
    moduli alike, over three decades, or partly void."""
    rng = np.random.default_rng(seed)
    h = 10.0 ** rng.uniform(-3, 3) * np.array([1.0, rng.choice([0.5, 1.0, 3.0])])
    cells = np.array([rng.integers(2, 6), rng.integers(1, 4)])
    lower = rng.uniform(-1e3, 1e3, 2) * h * rng.integers(2)
    upper = lower + cells * h
    E0, nu = 10.0 ** rng.uniform(-6, 9), float(rng.choice([-0.3, 0.0, 0.3, 0.45]))
    slender = min((cells[1] * h[1] / (cells[0] * h[0])) ** 3 / 4, 0.25)
    angle, size = rng.uniform(0, 2 * np.pi), 10.0 ** rng.uniform(-5, 0) * E0 * cells[1] * h[1] * slender
    force = (float(size * np.cos(angle)), float(size * np.sin(angle)))
    clamp = Support(Rectangle((-INF, -INF), (float(lower[0]), INF)))
    tip = RegionLoad(Rectangle((float(upper[0] - h[0]), -INF), (INF, INF)), force)
    domain = Rectangle(tuple(lower.tolist()), tuple(upper.tolist()))
    scene = Body(domain, (clamp,), (tip,), Material(E0, nu))
    shape_function = (tent, gimp, bspline2)[rng.integers(3)]
    frame: Frame = "total" if rng.random() < 0.25 else "updated"
    stretched = shape_function is gimp and frame == "updated" and rng.random() < 0.5
    model = discretise(
        scene,
        (float(h[0]), float(h[1])),
        (int(rng.integers(1, 4)), int(rng.integers(1, 4))),
        shape_function,
        steps=int(rng.integers(1, 5)),
        frame=frame,
        domains="stretched" if stretched else "fixed",
        alpha=float(rng.choice([0.0, 1e-5, 1e-5, 1e-3])),
        law=(Hencky, NeoHookean)[rng.integers(2)](nu),
    )
    p = len(model.points.x)
    kind = rng.integers(3)
    void = (rng.random(p) < 0.3) & ~np.any(model.force, axis=1) & (kind == 2)
    moduli = E0 * np.where(void, 1e-9, 10.0 ** (rng.uniform(-3, 0, p) * (kind == 1)))
    return Case(model, moduli, moduli * rng.standard_normal(p))


RIGHT, NAMED_ERROR, BRANCH, LAST_BITS = "right", "named error", "another branch", "last bits"
DOCUMENTED = (RIGHT, NAMED_ERROR, BRANCH, LAST_BITS)


def outcome(seed: int) -> str:
    """What becomes of a case.

    "right": finite, no point inverted, in equilibrium, and the gradient that a complex step through all steps says;
    "named error", with step and place; "another branch", the documented limit: a body at its limit, whose equilibrium
    under moduli that differ by 1e-30 is another one; "last bits", the other one: a body of which a part hangs on void
    without a background, whose gradient moduli with other last bits change as much. All else says what is wrong.
    """
    body = case(seed)
    try:
        path = trajectory(body.model, body.moduli)
        by_moduli = gradient(EndCompliance(), body.model, path, body.moduli)[1]
        stepped = trajectory(body.model, body.moduli + 1e-30j * body.direction, polish=3)
    except NAMED as error:
        named = str(error).startswith(("load step", "load on void"))
        return NAMED_ERROR if named else f"an error without a place: {error}"
    end, rerun = path.states[-1], stepped.states[-1]
    if not (np.all(np.isfinite(end.x)) and np.all(jacobian(end.F) > 0)):
        return "a point is inverted, or not a number"
    if max(i.residuals[-1] for i in path.increments) > 1e-6:  # the least loads are 1e-9 of E: rounding of the stresses
        return "not in equilibrium"
    if np.abs(rerun.x.real - end.x).max() > 1e-6 * np.abs(path.displacement()).max():
        return BRANCH
    exact = np.sum(body.model.force * rerun.x.imag) / 1e-30
    # rounding of loads of 1e-5 of E, times the condition of what has no background
    gap, size = abs(exact - by_moduli @ body.direction), np.sum(np.abs(by_moduli * body.direction))
    if gap <= 1e-6 * size:
        return RIGHT
    others = [_gradient(body.model, body.moduli * (1 + k * np.finfo(float).eps)) for k in (1, -1, 2)]
    scatter = max(abs((other - by_moduli) @ body.direction) for other in others)
    return LAST_BITS if gap <= 10 * scatter and body.model.alpha == 0 else f"the gradient is off by {gap / size:.0e}"


def _gradient(model: Model, moduli: Array) -> Array:
    return gradient(EndCompliance(), model, trajectory(model, moduli), moduli)[1]


def outcomes(first: int, last: int) -> tuple[Counter[str], dict[int, str]]:
    """How many of the cases from `first` to below `last` have each outcome, and those that have none of DOCUMENTED."""
    found = {seed: outcome(seed) for seed in range(first, last)}
    count = Counter(found.values())
    return count, {seed: what for seed, what in found.items() if what not in DOCUMENTED}
