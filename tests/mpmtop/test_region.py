"""Regions: set algebra, growth, areas, and curved domains seeded without touching the grid."""

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpmtop.arrays import Array
from mpmtop.errors import InvalidScene
from mpmtop.points import seed
from mpmtop.region import Circle, Difference, HalfPlane, Intersection, LevelSet, Polygon, Rectangle, Region, Union

NAN = float("nan")
SQUARE = Polygon(((0, 0), (2, 0), (2, 1), (0, 1)))
L_SHAPE = Polygon(((0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)))
REGIONS = [
    Rectangle((-1, -1), (1, 0.5)),
    Circle((0.2, -0.3), 1.1),
    HalfPlane((0.1, 0.2), (1, -2)),
    Polygon(((-1, -1), (1.5, -0.5), (0.1, 0.1), (0.5, 1.7))),
    LevelSet((-2, -2), (2, 2), lambda x: np.hypot(*x.T) - 1.3),
]
BOX = np.array([-2.0, -2.0]), np.array([2.0, 2.0])


def cloud(n: int = 4000) -> Array:
    return np.random.default_rng(0).uniform(*BOX, (n, 2))


def area(region: Region, n: int = 1000) -> float:
    """By counting the centres of a lattice of n x n over the bounding box."""
    lower, upper = region.bounds
    axes = [a + (b - a) * (np.arange(n) + 0.5) / n for a, b in zip(lower, upper, strict=True)]
    x = np.stack(np.meshgrid(*axes), -1).reshape(-1, 2)
    return float(np.mean(region.contains(x)) * np.prod(upper - lower))


@pytest.mark.parametrize("a", REGIONS, ids=lambda r: type(r).__name__)
@pytest.mark.parametrize("b", REGIONS, ids=lambda r: type(r).__name__)
def test_algebra_is_that_of_membership(a: Region, b: Region) -> None:
    x = cloud()
    in_a, in_b = a.contains(x), b.contains(x)
    np.testing.assert_array_equal(Union(a, b).contains(x), in_a | in_b)
    np.testing.assert_array_equal(Intersection(a, b).contains(x), in_a & in_b)
    np.testing.assert_array_equal(Difference(a, b).contains(x), in_a & ~in_b)
    both = Union(Difference(a, b), Intersection(a, b), Difference(b, a))
    np.testing.assert_array_equal(both.contains(x), Union(b, a).contains(x))


@pytest.mark.parametrize("region", [*REGIONS, Union(*REGIONS), Intersection(*REGIONS), Difference(*REGIONS[:2])])
def test_growth_is_monotonic_and_bounded_by_its_length(region: Region) -> None:
    """What grows by t holds all it held, and nothing further than t, sqrt 2 t at a sharp corner, from the region."""
    x = cloud()
    held = [region.contains(x, tol) for tol in (-0.3, -0.1, 0.0, 0.1, 0.3)]
    for less, more in itertools.pairwise(held):
        assert np.all(more[less]) and np.count_nonzero(more) > np.count_nonzero(less)
    if isinstance(region, Intersection | Difference):
        return  # those grow further where the boundaries of their parts meet at an acute angle
    gained = x[held[3] & ~held[2]]
    step = np.random.default_rng(1).uniform(-0.15, 0.15, (2000, 2))
    near = region.contains((gained[:, None] + step[np.hypot(*step.T) <= 0.15]).reshape(-1, 2))
    assert np.all(near.reshape(len(gained), -1).any(axis=1))


def directions(n: int) -> Array:
    angle = 2 * np.pi * np.arange(n) / n
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


@pytest.mark.parametrize("region", REGIONS, ids=lambda r: type(r).__name__)
def test_nothing_lies_outside_the_bounds(region: Region) -> None:
    x = 2 * cloud()
    lower, upper = region.bounds
    inside = x[region.contains(x)]
    assert len(inside) > 0 and np.all((inside >= lower) & (inside <= upper))


@given(radius=st.floats(0.5, 2), x=st.floats(-3, 3), y=st.floats(-3, 3))
def test_area_of_a_circle(radius: float, x: float, y: float) -> None:
    # a boundary of length s is cut by about s / step cells, each in error by less than half of its area at random
    assert area(Circle((x, y), radius), 300) == pytest.approx(np.pi * radius**2, rel=2e-3)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(0.3, 1.0), min_size=3, max_size=9), st.floats(0, 6))
def test_area_of_a_polygon(radii: list[float], turn: float) -> None:
    """A star around the origin, convex or not, of either orientation: the shoelace formula. At 0.1 no edge runs along
    the diagonals of the lattice, where its points would all be on the edge."""
    angle = 0.1 + turn + 2 * np.pi * np.arange(len(radii)) / len(radii)
    x, y = np.array(radii) * [np.cos(angle), np.sin(angle)]
    shoelace = abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2
    vertices = tuple(zip(x, y, strict=True))
    assert area(Polygon(vertices), 300) == pytest.approx(shoelace, abs=5e-3)  # a few of 300 rows along an edge
    points = cloud()
    rotated = Polygon((*vertices[2:], *vertices[:2]))
    np.testing.assert_array_equal(Polygon(vertices).contains(points), rotated.contains(points))
    np.testing.assert_array_equal(Polygon(vertices).contains(points), Polygon(vertices[::-1]).contains(points))


@pytest.mark.parametrize("tol", [-0.25, 0.0, 0.25])
def test_polygon_of_a_rectangle_is_the_rectangle(tol: float) -> None:
    """Boundary included, for axis-parallel edges exactly; grown, the polygon's corners are round."""
    lattice = np.stack(np.meshgrid(np.arange(-8, 25) / 8, np.arange(-8, 17) / 8), -1).reshape(-1, 2)
    rectangle = Rectangle((0, 0), (2, 1)).contains(lattice, tol)
    corners = np.array(SQUARE.vertices)
    past = np.min(np.hypot(*(lattice[:, None] - corners).T), axis=0) > max(tol, 0)
    beyond = past & np.all((lattice < 0) | (lattice > corners.max(axis=0)), axis=1)
    np.testing.assert_array_equal(SQUARE.contains(lattice, tol), rectangle & ~beyond)
    assert np.any(beyond & rectangle) == (tol > 0)


def test_boundary_belongs_to_the_polygon() -> None:
    """Vertices exactly, edges of any direction to the tolerance."""
    for polygon in (L_SHAPE, REGIONS[3], Polygon(tuple(map(tuple, directions(7))))):
        assert isinstance(polygon, Polygon)
        vertices = np.array(polygon.vertices)
        assert np.all(polygon.contains(vertices)) and not np.any(polygon.contains(vertices, -1e-9))
        along = np.linspace(0, 1, 11)[:, None, None]
        edges = (vertices + along * (np.roll(vertices, -1, axis=0) - vertices)).reshape(-1, 2)
        assert np.all(polygon.contains(edges, 1e-12)) and not np.any(polygon.contains(edges, -1e-12))


def test_polygons_of_any_shape() -> None:
    centres = np.array([[0.5, 0.5], [2.5, 0.5], [0.5, 2.5], [2.0, 2.0]])
    np.testing.assert_array_equal(L_SHAPE.contains(centres), [True, True, True, False])
    bow_tie = Polygon(((0, 0), (2, 2), (2, 0), (0, 2)))
    np.testing.assert_array_equal(bow_tie.contains(np.array([[0.1, 1.0], [1.9, 1.0], [1.0, 0.1]])), [True, True, False])
    closed = Polygon((*SQUARE.vertices, SQUARE.vertices[0]))
    assert closed == SQUARE


def test_half_planes_make_a_rectangle() -> None:
    sides = [
        HalfPlane((0, 0), (-3, 0)),
        HalfPlane((0, 0), (0, -1)),
        HalfPlane((2, 1), (1, 0)),
        HalfPlane((2, 1), (0, 7)),
    ]
    x = np.stack(np.meshgrid(np.arange(-8, 25) / 8, np.arange(-8, 17) / 8), -1).reshape(-1, 2)
    for tol in (-0.25, 0.0, 0.25):
        expected = Rectangle((0, 0), (2, 1)).contains(x, tol)
        np.testing.assert_array_equal(Intersection(*sides).contains(x, tol), expected)
    slope = HalfPlane((0, 0), (3, 4))
    np.testing.assert_array_equal(slope.contains(np.array([[0.6, 0.8]]) * [[0.99], [1.01]], 1.0), [True, False])
    tiny = HalfPlane((0, 0), (1e-300, 1e-300))  # its length underflows when squared
    np.testing.assert_array_equal(tiny.contains(x), HalfPlane((0, 0), (5, 5)).contains(x))


def test_a_signed_distance_is_a_circle() -> None:
    x, circle = cloud(), Circle((0.5, 0.25), 1.0)
    level_set = LevelSet((-9, -9), (9, 9), lambda x: np.hypot(*(x - [0.5, 0.25]).T) - 1.0)
    for tol in (-0.2, 0.0, 0.2):
        np.testing.assert_array_equal(level_set.contains(x, tol), circle.contains(x, tol))
    assert level_set.contains(np.array([[1.5, 0.25]]))[0]  # closed
    boxed = LevelSet((0, 0), (9, 9), level_set.phi)
    np.testing.assert_array_equal(boxed.contains(x), circle.contains(x) & np.all(x >= 0, axis=1))


def test_a_curved_domain_is_seeded() -> None:
    points = seed(Circle((3, 2), 1.0), (0.02, 0.02))
    assert points.volume.sum() == pytest.approx(np.pi, rel=2e-3)  # 314 boundary cells of 7,854, half of each at random
    np.testing.assert_allclose(points.x.mean(axis=0), [3, 2], atol=1e-12)


def test_equal_by_value_with_a_repr_that_makes_them() -> None:
    arrays = [
        Circle(np.array([1.0, 2.0]), 3.0),  # type: ignore[arg-type]
        HalfPlane(np.array([0.0, 1.0]), (1, 0)),  # type: ignore[arg-type]
        Polygon(np.array(SQUARE.vertices)),  # type: ignore[arg-type]
    ]
    whole = Union(Difference(Rectangle((0, 0), (9, 9)), arrays[0]), Intersection(*arrays))
    assert eval(repr(whole)) == whole and hash(eval(repr(whole))) == hash(whole)
    assert len({*arrays, *arrays, Circle((1, 2), 3.0), SQUARE}) == 3
    assert Union(*arrays[:2]) != Intersection(*arrays[:2])


@pytest.mark.parametrize(
    ("make", "advice"),
    [
        (lambda: Circle((0, 0), 0.0), "positive, finite length"),
        (lambda: Circle((0, 0), NAN), "positive, finite length"),
        (lambda: Circle((0, np.inf), 1.0), "two finite numbers"),
        (lambda: HalfPlane((0, 0), (0, 0)), "direction"),
        (lambda: HalfPlane((0, NAN), (0, 1)), "two finite numbers"),
        (lambda: Polygon(((0, 0), (1, 0))), "at least three"),
        (lambda: Polygon(((0, 0), (1, 0), (1, 0), (0, 0))), "at least three"),
        (lambda: Polygon(((0, 0), (1, 1), (3, 3))), "on one line"),
        (lambda: Polygon(((0, 0), (1, NAN), (3, 3))), "two finite numbers"),
        (lambda: Polygon(()), "one .* for each"),
        (lambda: LevelSet((0, 0), (-1, 1), lambda x: x[:, 0]), "upper bound"),
        (lambda: LevelSet((0, 0), (1, 1), 3.0), "function of positions"),  # type: ignore[arg-type]
        (lambda: LevelSet((0, 0), (1, 1), lambda x: x).contains(cloud()), "one number for each"),
        (lambda: LevelSet((0, 0), (1, 1), lambda x: x[:, 0] * NAN).contains(cloud()), "4000 NaN"),
        (lambda: Union(), "one region or more"),
        (lambda: Intersection([SQUARE]), "argument of its own"),  # type: ignore[arg-type]
    ],
)
def test_regions_refuse(make: Callable[[], object], advice: str) -> None:
    with pytest.raises(InvalidScene, match=advice):
        make()
