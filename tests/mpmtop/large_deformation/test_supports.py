"""Supports in load steps: clamps stated as a line, pins that a body turns about."""

from dataclasses import replace

import numpy as np
import pytest

from mpmtop.body import Body, Support
from mpmtop.large_deformation.model import discretise
from mpmtop.large_deformation.objectives import EndCompliance
from mpmtop.large_deformation.steps import trajectory
from mpmtop.loads import RegionLoad
from mpmtop.region import Rectangle
from mpmtop.shape_functions import ShapeFunction, bspline2, gimp, tent
from tests.mpmtop.large_deformation.cases import METHODS, cantilever

CLAMPED = Support(Rectangle((0.0, 0.0), (0.0, 10.0)))
SHAPES = pytest.mark.parametrize("shape_function", [tent, gimp, bspline2], ids=lambda s: s.__name__)


@pytest.mark.parametrize("method", ["tent", "GIMP", "GIMP, stretched", "bspline2"])
@pytest.mark.parametrize("alpha", [1e-5, 1e-7])
def test_a_clamp_on_the_edge_is_one_of_all_behind_it(method: str, alpha: float) -> None:
    """A per cent: half of it is what the half-plane holds above and below the clamp. With the nodes behind it free,
    GIMP's cantilever bends by a tenth too far."""
    J = []
    for supports in ((CLAMPED,), cantilever().supports):
        model = discretise(
            replace(cantilever(), supports=supports), 2.0, steps=4, **(METHODS[method] | {"alpha": alpha})
        )
        J.append(EndCompliance().value(model, trajectory(model, np.ones(200)), np.ones(200)))
    assert J[0] == pytest.approx(J[1], rel=1e-2)


@pytest.mark.parametrize(("face", "axis"), [((0, 0), 0), ((20, 10), 0), ((0, 0), 1), ((20, 10), 1)])
def test_one_component_along_an_edge_is_held_behind_it_alone(face: tuple[int, int], axis: int) -> None:
    """A line that slides: the component across it, in all nodes beyond that face and in no other."""
    low, high = np.array([0.0, 0.0]), np.array([20.0, 10.0])
    low[axis] = high[axis] = face[axis]
    fixed = (axis == 0, axis == 1)
    body = replace(cantilever(), supports=(Support(Rectangle(tuple(low), tuple(high)), fixed),))
    model = discretise(body, 2.0)
    x = model.grid.node_positions()
    side = 1 if face[axis] else -1
    along = (x[:, 1 - axis] >= 0) & (x[:, 1 - axis] <= high[1 - axis])
    expected = np.zeros((len(x), 2), bool)
    expected[along & (side * (x[:, axis] - face[axis]) >= 0), axis] = True
    np.testing.assert_array_equal((model.unknown < 0).reshape(-1, 2), expected)


@SHAPES
def test_a_body_turns_about_the_node_that_it_hangs_on(shape_function: ShapeFunction) -> None:
    """A square hung by its corner swings by 45 degrees, until its centre is below: moments about a pin balance."""
    square = Rectangle((0.0, 0.0), (10.0, 10.0))
    pin = Support(Rectangle((0.0, 10.0), (0.0, 10.0)))
    model = discretise(Body(square, (pin,), (RegionLoad(square, (0.0, -0.01)),)), 2.0, 2, shape_function)
    path = trajectory(model, np.ones(100))
    x, y = path.states[-1].x.mean(axis=0) - [0.0, 10.0]
    assert abs(x) < 1e-2  # a thousandth of the side: the background holds what is left of the increments
    assert y == pytest.approx(-np.hypot(5.0, 5.0), rel=1e-2)


def test_a_half_plane_holds_as_before() -> None:
    """What is held by its own region is all that is held."""
    model = discretise(cantilever(), 2.0)
    x = model.grid.node_positions()
    np.testing.assert_array_equal((model.unknown < 0).reshape(-1, 2), np.repeat(x[:, :1] <= 0, 2, axis=1))
