"""Outlines of domains: their length, their normals and what they enclose, by Gauss's theorem."""

import numpy as np
import pytest

from mpmtop.errors import InvalidScene
from mpmtop.outline import Surface, surface
from mpmtop.region import Circle, Difference, HalfPlane, Intersection, LevelSet, Polygon, Rectangle, Region, Union

INF = np.inf
ALL = Rectangle((-INF, -INF), (INF, INF))
LINES = 0.1 + 0.7 * np.arange(-20, 60), 0.9 * np.arange(-20, 60)
PI = np.pi
RING = Intersection(Difference(Circle((0, 0), 8), Circle((0, 0), 4)), Rectangle((0, 0), (8, 8)))
TURNED = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
OBLIQUE = Polygon(tuple(map(tuple, np.array([(0.0, -1.0), (8.0, -1.0), (8.0, 1.0), (0.0, 1.0)]) @ TURNED.T)))


def whole(domain: Region) -> Surface:
    return surface(domain, ALL, LINES)


@pytest.mark.parametrize(
    ("domain", "length", "area", "rtol"),
    [
        (Rectangle((0, 0), (8, 4)), 24, 32, 1e-13),
        (Circle((1, 2), 3), 6 * PI, 9 * PI, 1e-13),
        (RING, 6 * PI + 8, 12 * PI, 1e-9),  # the probe's reach, where circle and edge meet
        (Difference(Rectangle((0, 0), (30, 30)), Rectangle((8, 8), (30, 30))), 120, 416, 1e-13),
        (Union(Rectangle((0, 0), (2, 2)), Rectangle((2, 0), (4, 2))), 12, 8, 1e-11),  # a seam, and edges in one line
        (Union(Rectangle((0, 0), (2, 2)), Rectangle((1, 0), (4, 2))), 12, 8, 1e-11),
        (OBLIQUE, 20, 16, 1e-13),
        (Intersection(Circle((0, 0), 3), HalfPlane((1, 0), (2, 0))), None, None, 1e-8),
        (Difference(Rectangle((0, 0), (12, 8)), Union(Circle((4, 4), 2), Circle((6, 4), 2))), None, None, 1e-8),
        (Intersection(Rectangle((0, -INF), (5, INF)), Rectangle((-INF, 0), (INF, 3))), 16, 15, 1e-9),
    ],
)
def test_whole_outlines(domain: Region, length: float | None, area: float | None, rtol: float) -> None:
    """Length; int n ds = 0; int x . n ds = 2 area, or the same by each component, where no formula is at hand."""
    on = whole(domain)
    np.testing.assert_allclose(np.hypot(*on.normal.T), 1, rtol=1e-14)
    total = on.length.sum()
    np.testing.assert_allclose(on.length @ on.normal, 0, atol=rtol * total)
    by_x, by_y = on.length @ (on.x * on.normal)
    assert by_x == pytest.approx(by_y, rel=rtol)
    if length is not None and area is not None:
        assert total == pytest.approx(length, rel=rtol)
        assert (by_x + by_y) / 2 == pytest.approx(area, rel=rtol)


@pytest.mark.parametrize(
    ("domain", "region", "length", "normal"),
    [
        (Rectangle((0, 0), (8, 4)), Rectangle((8, 0), (8, 4)), 4, (4, 0)),
        (Rectangle((0, 0), (8, 4)), Rectangle((7, 1), (9, 1.1)), 0.1, (0.1, 0)),
        (Rectangle((0, 0), (8, 4)), HalfPlane((2, 0), (1, 0)), 8, (-4, 0)),
        (RING, Circle((0, 0), 4), 2 * PI, (-4, -4)),  # a pressure there pushes outwards
        (OBLIQUE, HalfPlane((0, 0), (np.cos(0.3), np.sin(0.3))), 2, (-2 * np.cos(0.3), -2 * np.sin(0.3))),
    ],
)
def test_parts(domain: Region, region: Region, length: float, normal: tuple[float, float]) -> None:
    on = surface(domain, region, LINES)
    assert on.length.sum() == pytest.approx(length, rel=1e-10)
    np.testing.assert_allclose(on.length @ on.normal, normal, atol=1e-10)


def test_no_line_of_the_grid_lies_between_points_of_one_interval() -> None:
    """Every five points lie in one cell: what is a polynomial there is integrated exactly."""
    x = whole(OBLIQUE).x.reshape(-1, 5, 2)
    for axis in (0, 1):
        cell = np.searchsorted(LINES[axis], x[..., axis])
        assert np.all(cell == cell[:, :1])


def test_a_part_without_outline_is_empty() -> None:
    assert len(surface(RING, Circle((0, 0), 1), LINES).x) == 0


def test_what_has_no_outline_is_named() -> None:
    level = LevelSet((0, 0), (4, 4), lambda x: np.hypot(*x.T) - 3)
    with pytest.raises(InvalidScene, match="LevelSet has no outline"):
        surface(Difference(Rectangle((0, 0), (4, 4)), level), ALL, LINES)
