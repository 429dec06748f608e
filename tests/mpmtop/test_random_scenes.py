"""Random scenes against the equations written out densely: the same number, or a named refusal, and never another one.

Value and gradient by design variables, through filter, SIMP, K, loads, supports and objective, beside complex steps
through `validation.oracles.dense`, in some variables of each scene. It shares no equation with mpmtop but the ghost
penalty's operators.
"""

import warnings
from collections import Counter
from typing import Any

import numpy as np

from mpmtop.arrays import Array
from mpmtop.body import Body, Material, Support
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.design import Design
from mpmtop.diagnose import ModelWarning
from mpmtop.errors import EmptyDomain, InvalidScene, LoadOutsideBody, NotConverged, UnsupportedBody
from mpmtop.loads import PointLoad, RegionLoad
from mpmtop.model import discretise
from mpmtop.points import seed
from mpmtop.problem import DesignProblem
from mpmtop.region import Circle, Difference, HalfPlane, Intersection, Polygon, Rectangle, Region, Union
from mpmtop.shape_functions import gimp, tent
from tests.scenes import SHAPE_FUNCTIONS
from validation.oracles.complex_step import stepped_problem
from validation.oracles.extended import condition

NAMED = EmptyDomain, InvalidScene, LoadOutsideBody, NotConverged, UnsupportedBody
AGREE = 1e-8
"""Of J and of the largest entry of its gradient: rounding, 1e-16, times condition numbers up to 1e8."""
VARIABLES = 5
INF = np.inf


def random_region(rng: np.random.Generator, corner: Array, size: Array) -> Region:
    """A box from `corner` of `size`, with something cut off or out of it."""
    lower, upper = corner, corner + size
    box = Rectangle(tuple(lower), tuple(upper))
    middle, small = tuple(corner + size * rng.uniform(0.4, 0.6, 2)), 0.3 * size.min() * rng.uniform(0.5, 1)
    kind = rng.integers(6)
    if kind == 1:
        return Difference(box, Circle(middle, small))
    if kind == 2:
        return Intersection(box, HalfPlane(tuple(upper - 0.3 * size), (1.0, 1.5)))
    if kind == 3:
        return Union(box, Circle(middle, small))
    if kind == 4:
        return Polygon((tuple(lower), (upper[0], lower[1]), tuple(lower + size * (1, 0.6)), (lower[0], upper[1])))
    return box


def random_problem(rng: np.random.Generator) -> DesignProblem:
    """A problem of some 20 to 120 points; raises what `mpmtop` names."""
    cells, h, ppc = rng.integers(2, 6, 2), 10 ** rng.uniform(-2, 2) * rng.uniform(0.5, 2, 2), rng.integers(1, 4, 2)
    corner, size = rng.choice([0.0, 0.3, 50.0]) * h, cells * h
    x, y = corner + size * rng.uniform(0.2, 1, 2)
    domain = random_region(rng, corner, size)
    left = Rectangle((-INF, -INF), (corner[0], INF))
    held = Support(left, (True, False)), Support(Rectangle((-INF, -INF), (INF, corner[1])), (False, True))
    supports = held if rng.random() < 0.4 else (Support(left),)
    force: tuple[float, float] = tuple(rng.normal(size=2))
    loads: list[Any] = [PointLoad(tuple(corner + size * (0.9, rng.uniform(0.2, 0.5))), force, int(rng.integers(1, 7)))]
    if rng.random() < 0.4:
        loads.append(RegionLoad(Rectangle((x, -INF), (INF, y)), tuple(rng.normal(size=2))))
    plane = rng.choice(["strain", "stress"])
    material = Material(10 ** rng.uniform(-3, 3), rng.uniform(-0.5, 0.48), plane)
    body = Body(domain, supports, tuple(loads), material)
    f = SHAPE_FUNCTIONS[rng.integers(4)]
    points = None
    if rng.random() < 0.7:
        points = seed(domain, tuple(h / ppc))
        moved = rng.uniform(0, 1, 2) * h if rng.random() < 0.5 else rng.uniform(-0.3, 0.3, points.x.shape) * h / ppc
        points = points.moved(moved)
    model = discretise(
        body,
        tuple(h),
        None if points is not None else tuple(int(n) for n in ppc),
        f,
        points=points,
        ghost=float(rng.choice([0.0, 0.01])) if f in (tent, gimp) else 0.0,
        b_bar=bool(plane == "strain" and rng.random() < 0.3),
    )
    penal = rng.uniform(1, 4)
    kinds = ("passive_solid", "passive_void")
    passive = {
        name: Rectangle(tuple(corner + size * a), tuple(corner + size * (a + 0.25)))
        for name, a in zip(kinds, (rng.uniform(0.1, 0.3, 2), rng.uniform(0.5, 0.6, 2)), strict=True)
        if rng.random() < 0.3
    }
    design = Design(0.7, h.min() * rng.uniform(0.2, 1.5), penal, 10 ** rng.uniform(-6, -2), 1e-3, **passive)
    stress = PNormStress(rng.uniform(1, 14), rng.uniform(0, 1) * min(1.0, 0.99 * penal))
    objective = Compliance() if rng.random() < 0.5 else stress
    return DesignProblem(model, design, objective, filter_passive=bool(rng.random() < 0.5))


def differences(case: int) -> tuple[str, float]:
    """What came of the case, and by how much ours is off: J and g, and their derivatives by some variables."""
    rng = np.random.default_rng(case)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)  # of the body: the equations are the same
        try:
            problem = random_problem(rng)
            x = rng.uniform(0.1, 1, len(problem.x0))
            at = problem.evaluate(x)
            dJ, dg = problem.gradient(at)
        except NAMED as error:
            return type(error).__name__, 0.0
    some = rng.choice(len(x), min(VARIABLES, len(x)), replace=False)
    J, g, by_J, by_g = stepped_problem(problem, x, some)
    off = [
        abs(at.objective / J - 1),
        abs(at.constraints[0] - g),
        np.abs(dJ[some] - by_J).max() / np.abs(dJ).max(),
        np.abs(dg[0, some] - by_g).max() / np.abs(dg).max(),
    ]
    if max(off) > AGREE and condition(problem.model, at.state.moduli) > 1e12:
        return "too ill-conditioned to judge", 0.0
    return "agrees" if max(off) <= AGREE else "differs", float(max(off))


def test_random_scenes() -> None:
    """Whichever gets an answer gets the right one. The others are refused by name: a body that a cut or a move leaves
    free, a load off the body, a passive region without a point."""
    found = Counter[str]()
    for case in range(24):
        outcome, off = differences(case)
        assert outcome != "differs", f"case {case} is off by {off:.1e}"
        found[outcome] += 1
    assert found == {"agrees": 18, "UnsupportedBody": 3, "LoadOutsideBody": 3}  # none lost to refusals, none gained
