"""What is asked: cells where none are given, and what is refused by name."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mpmtop import (
    Body,
    Circle,
    Compliance,
    Design,
    Difference,
    LoadCase,
    Material,
    Part,
    PNormStress,
    PointLoad,
    Rectangle,
    Scene,
    Support,
)
from mpmtop.comparison.asked import MORE_POINTS, USUAL_POINTS, area, ask
from mpmtop.comparison.methods import one_method, prepare
from mpmtop.comparison.page import parameters
from mpmtop.errors import InvalidScene
from tests.mpmtop.comparison.scenes import BEAM

HOLE = Difference(Rectangle((0.0, 0.0), (3.0, 1.0)), Circle((1.5, 0.5), 0.3))


def scene(sides: tuple[float, float], radius: float) -> Scene:
    clamp = Support(Rectangle((-1.0, -1.0), (0.0, sides[1])))
    body = Body(Rectangle((0.0, 0.0), sides), (clamp,), (PointLoad((sides[0], 0.0), (0.0, -1.0)),))
    return Scene("a beam", body, Design(0.4, radius))


@pytest.mark.parametrize("sides", [(40.0, 20.0), (0.12, 0.03), (1e3, 4e3), (7.0, 3.0)])
def test_cells_are_square_where_they_can_be_and_make_the_usual_number(sides: tuple[float, float]) -> None:
    asked = ask(scene(sides, max(sides)))
    assert np.isclose(asked.h[0], asked.h[1])
    assert 0.5 * USUAL_POINTS < asked.points < 2 * USUAL_POINTS


def test_cells_of_sides_without_a_common_measure_are_nearly_square() -> None:
    h = ask(scene((1.0, np.pi / 7), 1.0)).h
    assert max(h) < 1.05 * min(h)  # half a cell of 20 over the depth


@pytest.mark.parametrize("h", [(0.5, 4 / 27), [0.5, 0.1481], np.array([0.5, 4 / 27])])
def test_cells_of_two_sides_divide_the_box_exactly(h: Any) -> None:
    """0.1481 is 4 / 27 to four digits."""
    assert ask(BEAM, h=h).h == pytest.approx((0.5, 4 / 27), rel=1e-14)


def test_a_small_filter_radius_asks_for_smaller_cells_up_to_a_limit() -> None:
    fine = ask(scene((40.0, 20.0), 0.8))
    assert max(fine.h) <= 0.8 * 1.01  # the nearest number of cells
    assert ask(scene((40.0, 20.0), 0.01)).points <= 1.1 * MORE_POINTS


def test_the_area_of_a_domain_is_told_to_a_per_cent() -> None:
    assert area(HOLE) == pytest.approx(3 - np.pi * 0.09, rel=0.01)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"methods": ("spectral",)}, "method 'spectral'"),
        ({"methods": ()}, "no method"),
        ({"crossing": ("spiral",)}, "crossing 'spiral'"),
        ({"crossing": ()}, "no crossing"),
        ({"methods": ("fem",), "crossing": ("periodic",)}, "no points that cross"),
        ({"h": 0.3}, "does not divide"),
        ({"h": (0.5, 0.3)}, "does not divide"),
        ({"h": (1.0, 1.0, 1.0)}, r"h = \(1.0, 1.0, 1.0\): give one positive number, or two"),
        ({"h": ("1", "1")}, "give one positive number, or two"),
        ({"h": -1.0}, "give one positive number, or two"),
        ({"ppc": 0}, "0 points per cell"),
        ({"iterations": 0}, "0 iterations"),
        ({"load_steps": 0}, "0 load steps"),
        ({"load_steps": 4, "methods": ("bspline3",)}, "cubic B-splines in load steps"),
        ({"load_steps": 4, "crossing": ("periodic",)}, "cross by themselves"),
    ],
)
def test_what_cannot_be_asked_is_refused_by_name(asked: dict[str, Any], said: str) -> None:
    with pytest.raises(InvalidScene, match=said):
        ask(BEAM, **asked)


def test_load_steps_know_the_compliance_alone() -> None:
    assert isinstance(BEAM.objective, Compliance)
    with pytest.raises(InvalidScene, match="of the compliance of one load case"):
        ask(replace(BEAM, objective=PNormStress()), load_steps=4)


def test_gimp_is_mpm_as_seeded_and_not_when_crossed() -> None:
    """Where no domain leaves its cell their functions are one (Eq. 7)."""
    asked = ask(BEAM, h=1.0)
    for crossing, same in (("none", True), ("periodic(4, 0.26)", False)):
        mpm, gimp, spline = (prepare(asked, method, crossing) for method in ("mpm", "gimp", "bspline2"))
        assert one_method(mpm, gimp) is same
        assert not one_method(mpm, spline)


def test_elements_own_the_rectangles_of_the_points() -> None:
    asked = ask(
        replace(BEAM, body=replace(BEAM.body, domain=Difference(BEAM.body.domain, Circle((4.0, 2.0), 1.0)))), h=1.0
    )
    points, elements = (prepare(asked, method).design_points for method in ("mpm", "fem"))
    order = [np.lexsort(at.x.T) for at in (points, elements)]
    assert np.allclose(points.x[order[0]], elements.x[order[1]], atol=1e-12)
    assert np.allclose(points.volume[order[0]], elements.volume[order[1]])


def test_what_defines_the_comparison_is_told_with_its_parts_and_cases() -> None:
    part = Part(Rectangle((0.0, 3.0), (8.0, 4.0)), Material(young=3.0))
    cases = (LoadCase(BEAM.body.loads), LoadCase(BEAM.body.loads, supports=BEAM.body.supports))
    body = replace(BEAM.body, loads=(), parts=(part,))
    told = dict(parameters(ask(replace(BEAM, body=body, cases=cases), h=1.0)))
    assert "young 3" in told["part 1 of another material"]
    assert told["load case 1"].endswith("supports of the body)")
    assert "Support(" in told["load case 2"]
