"""Properties every shape function must have, at any position: on grid lines, beside them and at random."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mpmtop.arrays import Array
from mpmtop.body import Material
from mpmtop.errors import PointOutsideGrid
from mpmtop.grid import Grid
from mpmtop.material import tangent, von_mises
from mpmtop.points import MaterialPoints, seed
from mpmtop.region import Rectangle
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3, gimp, tent
from mpmtop.transfer import body_ends, transfer
from tests.scenes import SHAPE_FUNCTIONS

ALL = pytest.mark.parametrize("shape_function", SHAPE_FUNCTIONS, ids=lambda f: f.__name__)
TOL = 1e-12  # sums of at most nine terms of order one, at coordinates of order ten: a few hundred roundings at the most

GRID_LINES = [0.25, 0.5, 0.75, 1.0, 1.25, 2.0]
NEAR = [line + d for line in GRID_LINES for d in (0.0, 1e-12, -1e-12, 3e-13, -3e-13, 1e-15, -1e-15)]


def cloud(rng: np.random.Generator, h: tuple[float, float]) -> MaterialPoints:
    """Points on, within 1e-12 of, and away from grid lines, of unequal size, on a grid from (0, 0) of cells h."""
    special = np.stack(np.meshgrid(NEAR, NEAR), axis=-1).reshape(-1, 2)
    xi = np.concatenate([special, rng.uniform(0, 3, (200, 2))])
    half = np.concatenate([np.full(special.shape, 0.25), rng.uniform(0.01, 0.5, (200, 2))])
    return MaterialPoints(xi * h, np.prod(2 * half * h, axis=1), half * h)


@ALL
@pytest.mark.parametrize("h", [(1.0, 1.0), (0.3, 0.7)])
def test_unity_gradients_and_linear_fields(shape_function: ShapeFunction, h: tuple[float, float]) -> None:
    rng = np.random.default_rng(0)
    points = cloud(rng, h)
    grid = Grid((-2 * h[0], -2 * h[1]), h, (8, 8))
    operators = transfer(grid, points, shape_function, body_ends(grid, points))
    x = grid.node_positions()[operators.nodes]

    one = operators.N_matrix @ np.ones(len(x))
    np.testing.assert_allclose(one, 1, rtol=0, atol=TOL)
    assert np.all(operators.N[operators.touched] >= 0)
    gradient_sum = np.sum(operators.grad_N, axis=1) * h
    np.testing.assert_allclose(gradient_sum, 0, rtol=0, atol=TOL)

    A, b = rng.normal(size=(2, 2)), rng.normal(size=2)
    u = (x @ A.T + b).ravel()
    np.testing.assert_allclose(operators.interpolate(u), points.x @ A.T + b, rtol=0, atol=5 * TOL)
    exact = [A[0, 0], A[1, 1], A[0, 1] + A[1, 0]]
    np.testing.assert_allclose(operators.strain(u), np.tile(exact, (len(points.x), 1)), rtol=0, atol=TOL * 5 / min(h))


@ALL
def test_rigid_motion_has_no_stress(shape_function: ShapeFunction) -> None:
    points = cloud(np.random.default_rng(1), (1.0, 1.0))
    grid = Grid((-2, -2), (1.0, 1.0), (8, 8))
    operators = transfer(grid, points, shape_function, body_ends(grid, points))
    x, y = grid.node_positions()[operators.nodes].T
    rotation = np.stack([-y, x], axis=1).ravel() + 3.0
    np.testing.assert_allclose(operators.strain(rotation), 0, atol=5 * TOL)


@ALL
@given(xi=st.floats(-50, 50), half=st.floats(1e-3, 0.5))
@example(xi=1.0, half=0.25)
@example(xi=0.75 - 1e-12, half=0.25)
@example(xi=0.5, half=0.5)
def test_gradient_is_the_derivative(shape_function: ShapeFunction, xi: float, half: float) -> None:
    """N(b) - N(a) equals the integral of grad_N, by Simpson's rule on pieces on which it is a parabola at most."""
    kinks = np.unique([xi, *(k + o for k in range(int(xi) - 2, int(xi) + 3) for o in (0.0, 0.5, half, -half))])
    a, b = xi, xi + 0.3
    knots = np.unique([a, b, *kinks[(kinks > a) & (kinks < b)]])
    # one-sided values at the kinks: 1e-9 inside each piece
    left, right = knots[:-1], knots[1:]
    eps = np.minimum(1e-9, (right - left) / 4)

    def nodal(x: Array) -> tuple[Array, Array]:
        stencil = shape_function(x, np.full_like(x, half))
        N, G = np.zeros((2, len(x), 110))
        columns = stencil.first[:, None] + np.arange(stencil.N.shape[1]) + 54
        np.put_along_axis(N, columns, stencil.N, axis=1)
        np.put_along_axis(G, columns, stencil.grad_N, axis=1)
        return N, G

    ends, middle = nodal(left + eps)[1] + nodal(right - eps)[1], nodal((left + right) / 2)[1]
    integral = np.sum((right - left)[:, None] * (ends + 4 * middle) / 6, axis=0)
    N = nodal(np.array([a, b]))[0]
    # the gradient moves by at most 1/(2 half) * 1e-9 between a kink and the place beside it where it is taken
    np.testing.assert_allclose(N[1] - N[0], integral, rtol=0, atol=1e-9 / half + 1e-12)


def test_gimp_is_the_average_of_the_tent() -> None:
    """Eq. (7) by its definition: the tent averaged over the domain, by a midpoint rule split at the grid lines."""
    rng = np.random.default_rng(2)
    xi, half = rng.uniform(1, 4, 200), rng.uniform(0.01, 0.5, 200)
    N = np.zeros((200, 8))
    line = np.rint(xi)  # the only grid line that a domain of at most one cell can hold
    cut = np.clip(line, xi - half, xi + half)
    for a, b in ((xi - half, cut), (cut, xi + half)):  # the tent is linear on both parts: its midpoint is exact
        stencil = tent((a + b) / 2, half)
        part = (b - a) / (2 * half)
        for k in (0, 1):
            N[np.arange(200), stencil.first + k] += part * stencil.N[:, k]
    stencil = gimp(xi, half)
    for k in range(3):
        N[np.arange(200), stencil.first + k] -= stencil.N[:, k]
    np.testing.assert_allclose(N, 0, atol=1e-13)


def test_gimp_within_one_cell_is_the_tent_bit_for_bit() -> None:
    xi, half = np.array([0.25, 0.75, 1.25, 7.75]), np.full(4, 0.25)
    a, b = gimp(xi, half), tent(xi, half)
    np.testing.assert_array_equal(a.N[:, :2], b.N)
    np.testing.assert_array_equal(a.grad_N[:, :2], b.grad_N)
    np.testing.assert_array_equal(a.N[:, 2], 0)


def test_gimp_refuses_domains_wider_than_a_cell() -> None:
    with pytest.raises(ValueError, match="two points or more per cell"):
        gimp(np.array([1.0]), np.array([0.6]))


def test_half_open_cells() -> None:
    """A point on a grid line belongs to the cell on its right."""
    stencil = tent(np.array([1.0, np.nextafter(1.0, 0)]), np.zeros(2))
    assert stencil.first.tolist() == [1, 0]
    assert stencil.N[0].tolist() == [1.0, 0.0]


def test_point_outside_grid_is_named() -> None:
    points = seed(Rectangle((0, 0), (2, 2)), (0.5, 0.5))
    with pytest.raises(PointOutsideGrid, match="enlarge the grid"):
        transfer(grid := Grid((0, 0), (1, 1), (2, 1)), points, tent, body_ends(grid, points))
    with pytest.raises(PointOutsideGrid):  # GIMP's domain reaches one cell further than its point
        transfer(grid := Grid((0, 0), (1, 1), (2, 2)), points.moved((0.1, 0.0)), gimp, body_ends(grid, points))


@pytest.mark.parametrize("bspline", [bspline2, bspline3], ids=lambda f: f.__name__)
def test_bsplines_end_with_the_body(bspline: ShapeFunction) -> None:
    """At its ends the end node alone carries the value, nothing lies beyond, and linear fields are exact up to there:
    a support on the body's edge holds exactly what the tent's holds."""
    xi = np.concatenate([[0.0], np.random.default_rng(5).uniform(0, 3, 100), [3 - 1e-11, 0.5, 2.5, 1.0]])
    stencil = bspline(xi, np.full_like(xi, 0.25), 1e-12, (0, 3))
    N, grad_N = np.zeros((2, len(xi), 6))
    columns = stencil.first[:, None] + np.arange(stencil.N.shape[1]) + 1  # nodes -1 to 4
    np.put_along_axis(N, columns, stencil.N, axis=1)
    np.put_along_axis(grad_N, columns, stencil.grad_N, axis=1)
    np.testing.assert_array_equal(N[:, [0, 5]], 0)
    np.testing.assert_array_equal(grad_N[:, [0, 5]], 0)
    np.testing.assert_allclose(N[0, 1:5], [1, 0, 0, 0], atol=1e-15)
    np.testing.assert_allclose(N[101, 1:5], [0, 0, 0, 1], atol=1e-10)  # 1e-11 from the end
    np.testing.assert_allclose(N @ np.arange(-1, 5), xi, atol=TOL)
    np.testing.assert_allclose(grad_N @ np.arange(-1, 5), 1, atol=TOL)


def test_cubic_end_function_of_steffen() -> None:
    s = np.linspace(0, 0.99, 12)
    np.testing.assert_allclose(bspline3(s, s, 0.0, (0, 8)).N[:, 1], s**3 / 6 - s + 1, atol=1e-15)


def test_tangent_and_von_mises() -> None:
    """Uniaxial strain and pure shear against the closed forms of isotropic elasticity."""
    nu = 0.3
    strain, stress = (tangent(Material(poisson=nu, plane=p)) for p in ("strain", "stress"))
    np.testing.assert_allclose(strain[0, 0], (1 - nu) / ((1 + nu) * (1 - 2 * nu)), rtol=1e-15)
    uniaxial = np.linalg.solve(stress, [1.0, 0.0, 0.0])  # unit stress in plane stress: strains 1, -nu
    np.testing.assert_allclose(uniaxial, [1, -nu, 0], atol=1e-15)
    shear = np.array([[0.0, 0.0, 2.0]])
    np.testing.assert_allclose(von_mises(shear, Material()), 2 * np.sqrt(3), rtol=1e-15)
    pressure = np.array([[-1.0, -1.0, 0.0]])  # sigma_zz = -2 nu in plane strain, 0 in plane stress
    np.testing.assert_allclose(von_mises(pressure, Material(poisson=nu)), 1 - 2 * nu, rtol=1e-15)
    np.testing.assert_allclose(von_mises(pressure, Material(plane="stress")), 1, rtol=1e-15)


@ALL
@pytest.mark.parametrize("h", [0.1, 1 / 3, 0.7, 1e-9, 1e9])
@pytest.mark.parametrize("offset", [0.0, 1000.3, 1e6])
@pytest.mark.parametrize("place", [0.25, 0.5, 1 / 6])
def test_rounding_does_not_choose_the_cell(
    shape_function: ShapeFunction, h: float, offset: float, place: float
) -> None:
    """Points moved onto grid lines, and domains that end on one, touch the same nodes in any unit and place."""
    exact = seed(Rectangle((0, 0), (4, 2)), (1 / 3, 1 / 3) if place == 1 / 6 else (0.5, 0.5)).moved((place, place))
    unit = Grid((-2, -2), (1, 1), (9, 7))
    reference = transfer(unit, exact, shape_function, body_ends(unit, exact))
    origin = np.array([offset * h, -offset * h])
    scaled = MaterialPoints(exact.x * h + origin, exact.volume * h**2, exact.half_length * h)
    grid = Grid(tuple(np.array([-2.0, -2.0]) * h + origin), (h, h), (9, 7))  # type: ignore[arg-type]
    moved = transfer(grid, scaled, shape_function, body_ends(grid, scaled))
    np.testing.assert_array_equal(moved.nodes, reference.nodes)
    # positions at 1e6 h are given to 1e-10 h only
    difference = abs(moved.N_matrix - reference.N_matrix).max()
    assert difference < 1e-12 + 1e-15 * offset
