"""Crossing is the only difference between a seeded and a crossed run: both select the same points."""

from dataclasses import replace

import numpy as np
import pytest

from mpmtop import (
    AtMost,
    BodyForce,
    Design,
    Displacement,
    LoadCase,
    Material,
    Part,
    PointLoad,
    Rectangle,
    RegionLoad,
    Scene,
    Weight,
    Worst,
)
from mpmtop.arrays import Array
from mpmtop.comparison.asked import ask
from mpmtop.comparison.methods import Prepared, prepare
from mpmtop.crossing import Periodic
from mpmtop.loads import Load, action
from mpmtop.model import Model, discretise
from mpmtop.points import seed
from mpmtop.problem import DesignProblem
from tests.mpmtop.comparison.scenes import BEAM, BODY

CROSSED = "periodic(4, 0.26)"
EDGE = Rectangle((2.5, 3.0), (4.0, 4.0))  # its right edge is the line that a column goes over
DOWN = (0.0, -1.0)


def prepared(scene: Scene, crossing: str) -> Prepared:
    return prepare(ask(scene, h=1.0, crossing=("none", CROSSED)), "mpm", crossing)


def by_point(model: Model) -> Array:
    """Force (p, 2) that each point carries."""
    x, volume = model.points.x, model.points.volume
    found = np.zeros_like(x)
    acts = action(model.body.loads, x, volume, 1e-9)
    np.add.at(found, acts.points, acts.carried)
    return found + sum((volume[:, None] * part.at(x, 1e-9) for part in acts.throughout), start=np.zeros_like(x))


@pytest.mark.parametrize(
    "load",
    [
        RegionLoad(EDGE, DOWN),
        PointLoad((4.0, 4.0), DOWN, points=1),
        BodyForce(DOWN, EDGE),
        Weight(lambda x: np.stack([x[:, 0], -x[:, 1]], axis=1)),
    ],
    ids=lambda load: type(load).__name__,
)
@pytest.mark.parametrize("in_case", [False, True])
def test_points_carry_when_crossed_what_they_carry_as_seeded(load: Load, in_case: bool) -> None:
    body = replace(BODY, loads=() if in_case else (load,))
    scene = Scene("a beam", body, Design(0.4, 1.5), cases=(LoadCase((load,)),) if in_case else ())
    still, crossed = (prepared(scene, crossing).problem.models[0] for crossing in ("none", CROSSED))
    assert np.any(still.points.x != crossed.points.x)
    np.testing.assert_array_equal(by_point(crossed), by_point(still))
    alone = replace(crossed, body=replace(crossed.body, loads=(load,)))
    assert np.any(by_point(alone) != by_point(still))  # the scene's own load would choose by where points are now


def test_parts_and_regions_of_criteria_hold_the_points_that_they_held() -> None:
    part = Part(EDGE, Material(young=3.0))
    mean = Displacement(EDGE, DOWN)
    case = LoadCase((PointLoad((8.0, 2.0), DOWN),))
    scene = Scene(
        "a beam",
        replace(BODY, loads=(), parts=(part,)),
        Design(0.4, 1.5),
        Worst(mean),
        (AtMost(mean, 1.0),),
        cases=(case, replace(case, loads=(PointLoad((8.0, 4.0), DOWN),))),
    )
    still, crossed = (prepared(scene, crossing).problem for crossing in ("none", CROSSED))
    np.testing.assert_array_equal(crossed.model.elastic.young, still.model.elastic.young)
    assert np.count_nonzero(still.model.elastic.young == 3.0) == 3 * 2
    for of in (crossed.objective.criterion, crossed.constraints[0].criterion):
        acts = of.unit_load.act(crossed.model.points.x, crossed.model.points.volume, 1e-9)
        np.testing.assert_array_equal(acts.points, np.flatnonzero(still.model.elastic.young == 3.0))


def test_a_scene_without_such_regions_is_crossed_as_before() -> None:
    """The runs that are kept of it stay good."""
    seeded = seed(BODY.domain, (0.5, 0.5))
    model = discretise(BODY, 1.0, points=Periodic(4)(seeded, BODY.domain))
    direct = DesignProblem(model, BEAM.design, BEAM.objective, seeded)
    assert prepared(BEAM, CROSSED).problem.fingerprint == direct.fingerprint
