"""Criteria, cases, projection and symmetry in both solvers: points at the Gauss points are bilinear elements."""

from dataclasses import replace

import numpy as np
import pytest

from mpmtop.criteria import AtLeast, AtMost, Compliance, Displacement, PNormStress, Volume, Worst
from mpmtop.design import Design, Mirror
from mpmtop.errors import InvalidScene
from mpmtop.loads import PositionLoad, RegionLoad
from mpmtop.points import seed, to_gauss_points
from mpmtop.problem import design_problem
from mpmtop.region import Rectangle
from mpmtop.scene import LoadCase, Scene
from reference_fem.simp import design_problem as fem_problem
from tests.mpmtop.test_criteria import ALONG, BELOW, BODY, DESIGN, DESIGNS, Own

PULL, PUSH = RegionLoad(Rectangle((3, 0), (4, 2)), (1.0, 0.3)), PositionLoad((4.0, 2.0), (0.2, -1.0))
CASES = LoadCase((PUSH,), 0.7), LoadCase((PULL,), 1.3), LoadCase((PUSH, PULL), 0.4, supports=(BELOW,))
LIMITS = (
    AtMost(Compliance(), 90.0),
    AtMost(PNormStress(8, 0.5, weight="volume"), 3.0),
    AtLeast(ALONG, 0.0, scale=2.0),
    AtMost(Displacement((4.0, 1.0), (0, -1)), 3.0),
    AtLeast(Volume(), 0.2),
    AtMost(Own(), 10.0),
)
AGREE = 1e-10  # of the largest entry: rounding times the condition number of a body of eight cells


def scene(design: Design = DESIGN, **changes: object) -> Scene:
    asked = {"objective": Worst(Compliance()), "constraints": LIMITS, "cases": CASES}
    return Scene("cases", BODY, design, **(asked | changes))  # type: ignore[arg-type]


def test_all_criteria_at_gauss_points() -> None:
    """Values and derivatives by the densities, in three cases on two supports."""
    points = to_gauss_points(seed(BODY.domain, (0.5, 0.5)))
    ours = design_problem(replace(scene(), body=BODY), 1.0, points=points)
    theirs = fem_problem(scene(), 1.0, stress_at="gauss")
    element = np.argmin(np.linalg.norm(points.x[:, None] - theirs.model.centres, axis=-1), axis=1)
    rho = np.random.default_rng(0).uniform(0.2, 1, 8)
    a, b = ours.analyse(rho[element]), theirs.analyse(rho)
    np.testing.assert_allclose(a.objectives, b.objectives, rtol=AGREE)
    np.testing.assert_allclose(a.constraints, b.constraints, rtol=0, atol=AGREE * np.abs(b.constraints).max())
    sums = zip((*ours._objectives, *ours._constraints), (*theirs.sums[0], *theirs.sums[1]), strict=True)
    for one, other in sums:
        of_points = np.bincount(element, ours._by_density(one.terms, a))
        of_elements = theirs._by_density(other, b)
        np.testing.assert_allclose(of_points, of_elements, rtol=0, atol=AGREE * np.abs(of_elements).max())


@pytest.mark.parametrize("name", DESIGNS)
def test_variables_of_points_at_the_centres(name: str) -> None:
    """Projection, symmetry, passive parts, start and volume: codes apart, the same densities and chain rule."""
    ours = design_problem(scene(DESIGNS[name]), 0.5, 1, filter_passive=True)
    theirs = fem_problem(scene(DESIGNS[name]), 0.5, filter_passive=True)
    order = np.argmin(np.linalg.norm(ours.model.points.x[:, None] - theirs.model.centres, axis=-1), axis=1)
    assert len(ours.x0) == len(theirs.x0)
    np.testing.assert_allclose(ours.x0[0], theirs.x0[0], rtol=1e-9)
    rng = np.random.default_rng(1)
    field, by_rho = rng.uniform(0.2, 1, len(order)), rng.normal(size=len(order))
    # the value of the element or point that stands for a variable; symmetric fields so that it does not matter which
    place = {tuple(np.round(x, 6)): v for x, v in zip(ours.positions, field, strict=False)}
    x = np.array(list(place.values()))
    same = [tuple(np.round(p, 6)) in place for p in theirs.positions]
    assert all(same)
    y = np.array([place[tuple(np.round(p, 6))] for p in theirs.positions])
    filtered, others = ours.filter(x), theirs.H @ y + theirs.space.fixed
    np.testing.assert_allclose(ours.densities(filtered), theirs.densities(others)[order], rtol=0, atol=1e-12)
    g, h = ours.pull_back(filtered, by_rho[order]), theirs.pull_back(others, by_rho)
    back = {tuple(np.round(p, 6)): v for p, v in zip(ours.positions, g, strict=True)}
    np.testing.assert_allclose([back[tuple(np.round(p, 6))] for p in theirs.positions], h, rtol=0, atol=1e-11)


def test_gradient_by_the_design_beside_a_difference() -> None:
    """Elements' whole chain, by the fourth-order quotient along a direction."""
    of = fem_problem(scene(DESIGNS["all"]), 0.5, stress_at="gauss", filter_passive=True)
    rng = np.random.default_rng(2)
    x, d, h = rng.uniform(0.3, 0.9, len(of.x0)), rng.normal(size=len(of.x0)), 1e-3

    def values(t: float) -> np.ndarray:
        at = of.evaluate(x + t * d)
        return np.append(at.objectives, at.constraints)

    quotient = (8 * (values(h) - values(-h)) - values(2 * h) + values(-2 * h)) / (12 * h)
    slopes = np.vstack(of.gradient(of.evaluate(x))) @ d
    np.testing.assert_allclose(slopes, quotient, rtol=1e-7, atol=1e-7 * np.abs(slopes).max())  # h^4, and rounding / h


def test_one_factorisation_for_two_cases() -> None:
    of = fem_problem(scene(cases=CASES[:2]), 1.0)
    assert len({id(model.stiffness) for model in of.models}) == 1
    assert len({id(model.stiffness) for model in fem_problem(scene(), 1.0).models}) == 2


def test_fingerprints_of_elements() -> None:
    changed = [
        scene(),
        scene(objective=Compliance()),
        scene(constraints=LIMITS[1:]),
        scene(constraints=(replace(LIMITS[0], bound=91.0), *LIMITS[1:])),
        scene(constraints=(*LIMITS[:2], AtLeast(replace(ALONG, place=(3.5, 1.5)), 0.0, 2.0), *LIMITS[3:])),
        scene(cases=CASES[:2]),
        scene(cases=(replace(CASES[0], weight=0.6), *CASES[1:])),
        *(scene(design) for name, design in DESIGNS.items() if name != "plain"),
    ]
    prints = [fem_problem(each, 1.0 if not each.design.passive_solid else 0.5).fingerprint for each in changed]
    assert len(set(prints)) == len(prints)


def test_what_elements_refuse() -> None:
    with pytest.raises(InvalidScene, match="density filter"):
        fem_problem(scene(), 1.0, filtered="sensitivity")
    with pytest.raises(InvalidScene, match="have no image"):
        fem_problem(scene(replace(DESIGN, symmetry=(Mirror((2.2, 1), (1, 0)),))), 1.0)
    one = fem_problem(Scene("one", replace(BODY, loads=(PULL,)), DESIGN), 1.0)
    given = replace(one.model, forces_of=None)
    for changes in ({"cases": CASES}, {"objective": ALONG}):
        with pytest.raises(InvalidScene, match="was given its load vector"):
            replace(one, model=given, **changes)
    of = fem_problem(scene(DESIGNS["projected"]), 1.0)
    at = of.analyse(np.full(8, 0.5))
    with pytest.raises(ValueError, match="come from no design"):
        of.gradient(at)
