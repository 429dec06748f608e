"""What a run says of its last design, in both solvers: a displacement of nothing, or of void."""

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mpmtop.body import Body, Material, Spring, Support
from mpmtop.criteria import AtMost, Compliance, Displacement, NothingMoves, PlaceInVoid
from mpmtop.design import Design
from mpmtop.loads import PointLoad, PositionLoad
from mpmtop.optimizers import MMA, optimize
from mpmtop.problem import design_problem
from mpmtop.region import Rectangle
from mpmtop.scene import LoadCase, Scene
from reference_fem.simp import design_problem as of_elements

BOX = Rectangle((0, 0), (8, 4))
SUPPORTS = (
    Support(Rectangle((0, 0), (0, 1))),
    Support(Rectangle((0, 4), (8, 4)), (False, True)),
    Spring((0, 4), 0.1, (1, 0)),
    Spring((8, 4), 0.1, (1, 0)),
)
PUSH = PositionLoad((0, 4), (1.0, 0.0))
SCENE = Scene(
    "inverter",
    Body(BOX, SUPPORTS, (PUSH,), Material(plane="stress")),
    Design(0.5, 1.0, penal=3.0, contrast=1e-9),
    Displacement((8, 4), (1, 0)),
)


SOLVERS = pytest.mark.parametrize("made", [design_problem, of_elements], ids=["points", "elements"])


@SOLVERS
def test_a_design_that_connects_nothing_is_named(made: Any) -> None:
    """Material at the input only; a connected design is passed over. Of load cases, whose sum may be small as it is, it
    is told that the output is in void."""
    problem = made(SCENE, 1.0)
    apart = np.where(problem.positions[:, 0] < 3, 1.0, problem.lower)
    rule = MMA(0.2)
    with pytest.warns(NothingMoves, match="nothing connects") as said:
        list(optimize(problem, rule, start=apart, max_iterations=0))
    assert len(said) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        list(optimize(problem, rule, max_iterations=0))
    several = made(Scene("cases", Body(BOX, SUPPORTS), SCENE.design, SCENE.objective, cases=(LoadCase((PUSH,)),)), 1.0)
    with pytest.warns(PlaceInVoid):
        list(optimize(several, rule, start=apart, max_iterations=0))


BEAM = Scene(
    "beam",
    Body(BOX, (Support(Rectangle((-1, 0), (0, 4))),), (PointLoad((8, 1), (0.0, -1.0)),), Material(plane="stress")),
    Design(0.5, 0.5),
)
PLACES: dict[str, tuple[Any, bool]] = {
    "on the structure": ((4.0, 0.0), False),
    "under the load": ((8.0, 1.0), False),
    "in void": ((4.0, 3.5), True),
    "a region, half of it void": (Rectangle((3, 0), (4, 4)), True),
    "an island": ((6.0, 3.9), True),
    "at the support": ((0.0, 4.0), False),
}


@SOLVERS
@pytest.mark.parametrize("place", PLACES)
def test_a_place_that_only_void_holds_is_named(made: Any, place: str) -> None:
    """The lower half is solid, and a passive island floats above it; limited in the second of two load cases."""
    at, void = PLACES[place]
    design = replace(BEAM.design, passive_solid=Rectangle((5, 3), (7, 4)))
    cases = LoadCase((PointLoad((8, 1), (1.0, 0.0)),)), LoadCase(BEAM.body.loads)
    limited = AtMost(Displacement(at, (0.0, -1.0)), 100.0, case=1)
    scene = replace(BEAM, body=replace(BEAM.body, loads=()), design=design, constraints=(limited,), cases=cases)
    problem = made(scene, 0.5)
    lower_half = np.where(problem.positions[:, 1] < 2, 1.0, problem.lower)
    said = problem.remarks(problem.evaluate(lower_half))
    assert [type(warning) for warning in said] == [PlaceInVoid] * void
    solid = problem.remarks(problem.evaluate(problem.upper))
    assert not solid


@SOLVERS
def test_a_limit_that_a_run_has_met_in_void_is_named(made: Any) -> None:
    """A fifth of the deflection that the stiffest design has there: void is left there, and moves as is asked."""
    box, place = Rectangle((0, 0), (24, 12)), Displacement((12.0, 12.0), (0.0, -1.0))
    clamp, load = Support(Rectangle((-1, 0), (0, 12))), PointLoad((24, 6), (0.0, -1.0))
    body = Body(box, (clamp,), (load,), Material(plane="stress"))
    scene = Scene("limited", body, Design(0.4, 2.0), Compliance(), (AtMost(place, 10.0),))
    with pytest.warns(PlaceInVoid, match=r"at \(12.0, 12.0\) is that of void, which stores (9\d|100)%") as said:
        *_, last = optimize(made(scene, 1.0), MMA(0.2), max_iterations=60)
    assert len(said) == 1 and last.constraints[1] <= 1e-3
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        list(optimize(made(replace(scene, constraints=()), 1.0), MMA(0.2), max_iterations=1))
