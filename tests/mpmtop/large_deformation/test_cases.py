"""What may be asked of load steps beside one load: cases, stages, coarser levels, a start, an objective of one's own;
and what they refuse, by name."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.body import Bed, Body, EdgeSupport, Material, Part, Spring, Support
from mpmtop.criteria import AtMost, Compliance, PNormStress, Worst
from mpmtop.design import Design, Mirror, Projection
from mpmtop.errors import InvalidScene, LoadOutsideBody, NotConverged, PointOutsideGrid
from mpmtop.grid import Grid
from mpmtop.large_deformation.adjoint import Seed
from mpmtop.large_deformation.model import Model, discretise
from mpmtop.large_deformation.objectives import EndCompliance, EndStress, PathCompliance
from mpmtop.large_deformation.problem import LoadStepProblem
from mpmtop.large_deformation.steps import Trajectory, trajectory
from mpmtop.loads import BodyForce, Pressure, RegionLoad, Traction, Weight
from mpmtop.optimizers import GCMMA, Stage, continuation, optimize
from mpmtop.planning import plan
from mpmtop.region import Rectangle
from mpmtop.scene import LoadCase
from tests.mpmtop.large_deformation.cases import INF, cantilever
from validation.measures.derivatives import taylor_orders

BOX = Grid((-8.0, -20.0), (2.0, 2.0), (20, 25))
TIP = Rectangle((18, 3), (20, 7))
DESIGN = Design(volume_fraction=0.5, filter_radius=3.0, passive_solid=Rectangle((18, 2), (20, 8)))
DOWN, UP = (RegionLoad(TIP, (0.0, side * 4e-3)) for side in (-1, 1))
BOTH_ENDS = (*cantilever().supports, Support(Rectangle((20.0, -INF), (INF, INF)), (True, False)))
CASES = (LoadCase((DOWN,), 0.7), LoadCase((UP,), 0.3), LoadCase((DOWN,), 0.2, BOTH_ENDS))


def model(loads: tuple[Any, ...] = (), **how: Any) -> Model:
    return discretise(replace(cantilever(), loads=loads), **({"steps": 2, "grid": BOX} | how))


def problem(**how: Any) -> LoadStepProblem:
    return LoadStepProblem(**({"model": model(), "design": DESIGN, "cases": CASES} | how))


def designs(of: LoadStepProblem) -> tuple[Array, Array]:
    rng = np.random.default_rng(0)
    return rng.uniform(0.4, 0.8, len(of.x0)), rng.standard_normal(len(of.x0))


@pytest.mark.parametrize("objective", [PathCompliance(), EndStress(8.0, 0.5)], ids=lambda o: type(o).__name__)
def test_cases_are_weighted_and_each_is_the_body_under_its_loads_and_supports(objective: Any) -> None:
    of = problem(objective=objective)
    x, d = designs(of)
    at = of.evaluate(x)
    alone = []
    for case in CASES:
        supports = cantilever().supports if case.supports is None else case.supports
        body = discretise(replace(cantilever(), loads=case.loads, supports=supports), steps=2, grid=BOX)
        alone.append(LoadStepProblem(body, DESIGN, objective).evaluate(x).objective)
    weights = [case.weight for case in CASES]
    assert at.objective == pytest.approx(np.dot(weights, alone), rel=1e-14)
    assert len(at.paths) == 3 and at.path is at.paths[0]
    dJ = of.gradient(at)[0]
    assert np.all(taylor_orders(lambda x: of.evaluate(x).objective, x, d, dJ @ d, (1e-3, 5e-4, 2.5e-4)) > 1.9)


def test_loads_of_the_body_act_in_every_case() -> None:
    both = problem(model=model((DOWN,)), cases=(LoadCase((DOWN,)), LoadCase(())))
    np.testing.assert_allclose(both.models[0].force, 2 * model((DOWN,)).force)
    np.testing.assert_array_equal(both.models[1].force, model((DOWN,)).force)
    with pytest.raises(LoadOutsideBody, match="the loads are zero"):
        problem(model=model((DOWN,)), cases=(LoadCase((UP,)),))


def test_mirrored_cases_of_one_weight_make_a_mirrored_design() -> None:
    """A cantilever under a load up or down; the two halves are equal to what the optimiser makes of rounding."""
    of = problem(cases=(LoadCase((DOWN,)), LoadCase((UP,))))
    *_, last = optimize(of, GCMMA(), max_iterations=4)
    rho, points = last.evaluation.rho, of.grid_points.x
    image = np.hypot(*(points[:, None] - Mirror((0, 5), (0, 1)).image(points)).transpose(2, 0, 1)).argmin(axis=1)
    np.testing.assert_allclose(rho, rho[image], atol=1e-5)


def test_cases_tell_problems_apart_and_a_run_of_them_resumes(tmp_path: Path) -> None:
    others = [problem(), problem(cases=CASES[:2]), problem(cases=(*CASES[:2], replace(CASES[2], weight=0.3)))]
    others.append(problem(design_grid=model().points.moved(np.full((200, 2), 0.1))))
    others.append(problem(filter_passive=True))
    assert len({each.fingerprint for each in others}) == len(others)
    straight, file = list(optimize(problem(), GCMMA(), max_iterations=3)), tmp_path / "run.npz"
    list(optimize(problem(), GCMMA(), max_iterations=1, checkpoint=file))
    *_, resumed = optimize(problem(), GCMMA(), max_iterations=3, checkpoint=file)
    np.testing.assert_array_equal(resumed.x, straight[-1].x)


def test_an_error_names_its_case() -> None:
    heavy = LoadCase((RegionLoad(TIP, (0.0, -5e3)),))
    of = problem(cases=(CASES[0], heavy))
    with pytest.raises((NotConverged, PointOutsideGrid), match="load case 1: load step 1"):
        of.evaluate(of.x0)


def test_stages_levels_and_starts_are_those_of_small_strain() -> None:
    """Projection by continuation; a coarser model first; a start by position; points moved off the design's grid."""
    fine, one = model((DOWN,)), {"cases": ()}
    stages = [
        Stage(
            problem(model=fine, design=replace(DESIGN, projection=Projection(beta)), **one), GCMMA(), max_iterations=1
        )
        for beta in (1.0, 2.0)
    ]
    assert {iterate.stage for iterate in continuation(stages)} == {0, 1}
    coarse = discretise(replace(cantilever(), loads=(DOWN,)), 2.0, 1, steps=2)
    wide = replace(DESIGN, filter_radius=4.0)
    levels = [LoadStepProblem(coarse, wide)]
    *_, last = optimize(
        LoadStepProblem(fine, wide), GCMMA(), levels=levels, start=lambda at: 0.3 + 0.01 * at[:, 0], max_iterations=1
    )
    assert last.stage == 1 and np.isfinite(last.objective)
    moved = fine.points.moved(np.outer(fine.points.x[:, 0] < 18, [0.1, 0.0]))
    of = problem(model=model((DOWN,), points=moved), design_grid=fine.points, **one)
    np.testing.assert_array_equal(of.positions, problem(model=fine, **one).positions)


@dataclass(frozen=True)
class Sideways:
    """How far the loaded points move along x, at the end."""

    def value(self, model: Model, path: Trajectory, rho: Array) -> float:
        return float(np.any(model.force, axis=1) @ path.displacement()[:, 0])

    def seed(self, model: Model, path: Trajectory, rho: Array, step: int) -> Seed:
        return Seed(x=np.outer(np.any(model.force, axis=1), [1.0, 0.0])) if step == model.steps else Seed()

    def explicit(self, model: Model, path: Trajectory, rho: Array) -> Array:
        return np.zeros_like(rho)


def test_an_objective_of_ones_own() -> None:
    of = problem(objective=Sideways())
    x, d = designs(of)
    dJ = of.gradient(of.evaluate(x))[0]
    assert np.all(taylor_orders(lambda x: of.evaluate(x).objective, x, d, dJ @ d, (1e-3, 5e-4, 2.5e-4)) > 1.9)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"constraints": (AtMost(Compliance(), 1.0),)}, "leave out `constraints`"),
        ({"objective": Compliance()}, "give EndCompliance"),
        ({"objective": PNormStress(8.0, 0.5)}, "give EndCompliance"),
        ({"objective": EndCompliance}, "give EndCompliance"),
        ({"objective": Worst(Compliance())}, "give them weights"),
        ({"cases": [CASES[0]]}, "give a tuple of LoadCase"),
        ({"cases": (LoadCase((DOWN,), 0.0),)}, "no load case has a weight"),
        ({"cases": ()}, "the body has no load"),
        ({"cases": (LoadCase((Pressure(Rectangle((0, 10), (20, 10)), 1.0),)),)}, "of small strain"),
        ({"cases": (LoadCase((DOWN,), 1.0, (Spring((20, 5), 1.0, (0, 1)),)),)}, "of small strain"),
    ],
)
def test_what_a_problem_of_load_steps_does_not_know(change: dict[str, Any], match: str) -> None:
    with pytest.raises(InvalidScene, match=match):
        problem(**change)


def test_plans_are_of_small_strain() -> None:
    with pytest.raises(TypeError, match="give a DesignProblem"):
        plan(problem())  # type: ignore[arg-type]


def test_design_grids_and_passive_void_are_checked_in_every_case() -> None:
    with pytest.raises(ValueError, match="one for each"):
        problem(design_grid=discretise(cantilever(), 2.0, 1).points)
    void = replace(DESIGN, passive_solid=None, passive_void=Rectangle((18, 0), (20, 4)))
    with pytest.raises(LoadOutsideBody, match="passive void"):
        problem(design=void)


def test_a_body_without_loads_has_no_trajectory() -> None:
    with pytest.raises(LoadOutsideBody, match="no loads"):
        trajectory(model(), np.ones(200))


LEFT = Rectangle((0.0, 0.0), (0.0, 10.0))
TOP = Rectangle((0.0, 10.0), (20.0, 10.0))


@pytest.mark.parametrize(
    ("of", "match"),
    [
        (
            lambda body: replace(body, parts=(Part(TIP, Material(2.0, 0.3)),)),
            "leave out `parts`",
        ),
        (lambda body: replace(body, supports=(*body.supports, Bed(TOP, 1.0))), "beds"),
        (lambda body: replace(body, supports=(*body.supports, Spring((20, 5), 1.0, (0, 1)))), "springs"),
        (lambda body: replace(body, supports=(EdgeSupport(LEFT),)), "along the outline"),
        (lambda body: replace(body, supports=(Support(LEFT, (True, True), (0.1, 0.0)),)), "displacements"),
        (lambda body: replace(body, loads=(Traction(TOP, (0.0, -1.0)),)), "loads along the outline"),
        (lambda body: replace(body, loads=(Pressure(TOP, 1.0),)), "loads along the outline"),
        (lambda body: replace(body, loads=(Weight((0.0, -1.0)),)), "by volume"),
        (lambda body: replace(body, loads=(BodyForce((0.0, -1.0), TIP),)), "by volume"),
    ],
)
def test_what_a_body_in_load_steps_does_not_know(of: Callable[[Body], Body], match: str) -> None:
    with pytest.raises(InvalidScene, match=match):
        discretise(of(cantilever(4e-3)), 2.0)
