"""The manufactured solution: its derivatives against finite differences, its assembly against the model's."""

import numpy as np
import pytest

from mpmtop.body import Body, Support
from mpmtop.crossing import Uniform
from mpmtop.grid import Grid
from mpmtop.loads import PointLoad
from mpmtop.model import discretise
from mpmtop.points import seed
from mpmtop.region import Rectangle
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3, gimp, tent
from mpmtop.transfer import body_ends, transfer
from validation.bodies.manufactured import (
    CURVATURE,
    MATERIAL,
    DeformedWave,
    coefficients,
    errors,
    exact,
    held_analysis,
    stiffness_product,
)
from validation.measures.derivatives import central_difference
from validation.measures.orders import observed_order

SIDE = 7.0
X = np.random.default_rng(3).uniform(0, SIDE, (50, 2))
STEP = 1e-3
RTOL_DIFFERENCE = 1e-6
"""Central differences: (STEP / SIDE * wave number)^2 / 6 < 1e-7, rounding 1e-16 / STEP = 1e-13."""


def slope(field: str, component: int, axis: int) -> np.ndarray:
    """Central difference of a component of a field along an axis, at X."""
    return central_difference(lambda x: getattr(exact(x, SIDE), field)[:, component], X, np.eye(2)[axis], STEP)


def assert_close(value: np.ndarray, reference: np.ndarray) -> None:
    np.testing.assert_allclose(value, reference, rtol=0, atol=RTOL_DIFFERENCE * np.abs(reference).max())


def test_stress_follows_hookes_law() -> None:
    # plane strain written with compliances: eps = (1 + nu) / E (sigma - nu tr sigma), the trace in the plane
    nu, stress = MATERIAL.poisson, exact(X, SIDE).stress
    trace = stress[:, 0] + stress[:, 1]
    assert_close(slope("u", 0, 0), (1 + nu) / MATERIAL.young * (stress[:, 0] - nu * trace))
    assert_close(slope("u", 1, 1), (1 + nu) / MATERIAL.young * (stress[:, 1] - nu * trace))
    assert_close(slope("u", 0, 1) + slope("u", 1, 0), 2 * (1 + nu) / MATERIAL.young * stress[:, 2])


def test_body_force_balances_the_stress() -> None:
    divergence = np.stack(
        [slope("stress", 0, 0) + slope("stress", 2, 1), slope("stress", 2, 0) + slope("stress", 1, 1)], axis=1
    )
    assert_close(-divergence, exact(X, SIDE).body_force)


def test_laplacian() -> None:
    shifts = 10 * STEP * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    around = np.sum([exact(X + shift, SIDE).u for shift in shifts], axis=0)
    difference = (around - 4 * exact(X, SIDE).u) / (10 * STEP) ** 2
    # (10 STEP / SIDE * wave number)^2 / 12 < 2e-6, rounding 1e-16 / 1e-4 = 1e-12 of values 1/6 of u
    np.testing.assert_allclose(difference, exact(X, SIDE).laplacian, rtol=0, atol=1e-5)


@pytest.mark.parametrize(("function", "order"), [(tent, 2), (bspline2, 3), (bspline3, 4)])
def test_coefficients_approximate_at_the_order_of_the_space(function: ShapeFunction, order: int) -> None:
    def error(side: int) -> float:
        points = seed(Rectangle((0.0, 0.0), (side, side)), (0.2, 0.2))
        grid = Grid.around(np.zeros(2), np.full(2, side), (1.0, 1.0))
        N = transfer(grid, points, function, body_ends(grid, points))
        c = coefficients(grid.node_positions(N.nodes), side, CURVATURE.get(function, 0.0))
        inside = np.all((points.x > 2) & (points.x < side - 2), axis=1)  # away from the functions closed at the ends
        return float(np.abs(N.N_matrix @ c - exact(points.x, side).u)[inside].max())

    # next term two orders higher: 2^order (1 + c / 400), with c up to 10^2 / 2 by wave numbers of 3 on both axes
    assert observed_order(error(20), error(40)) == pytest.approx(order, abs=0.15)


@pytest.mark.parametrize("function", [tent, gimp, bspline2, bspline3])
def test_analysis_is_the_models(function: ShapeFunction) -> None:
    body = Rectangle((0.0, 0.0), (6.0, 4.0))
    support = Support(Rectangle((-np.inf, -np.inf), (1.0, np.inf)))
    model = discretise(Body(body, (support,), (PointLoad((6.0, 2.0), (0.3, -1.0)),), MATERIAL), 1.0, 2, function)
    moduli = np.ones(len(model.points.x))
    inside = np.sort(model.stiffness.dof)
    u = held_analysis(
        inside,
        np.zeros_like(model.f_ext),
        model.f_ext,
        model.transfer.B,
        stiffness_product(model.points, model.transfer),
    )
    balance = model.f_ext - model.internal_force(model.stress(moduli, model.transfer.strain(u)))
    # condition number 1e4 times rounding
    assert np.abs(balance[inside]).max() < 1e-11
    assert not np.any(np.delete(u, inside))


def test_rates_of_the_tent() -> None:
    # the tent's L2 rates on uniform points, known a priori; the next term is of relative size
    # (wave number h)^2 < 0.1 at 8 cells
    coarse, fine = (errors(n, tent, Uniform(0.0)) for n in (8, 16))
    assert observed_order(coarse.displacement, fine.displacement) == pytest.approx(2, abs=0.1)
    assert observed_order(coarse.stress, fine.stress) == pytest.approx(1, abs=0.1)


def test_deformed_domains_tile_the_body() -> None:
    body = Rectangle((0.0, 0.0), (16.0, 1.0))
    points = DeformedWave(8, 0.26)(seed(body, (0.5, 0.5)), body)
    row = np.isclose(points.x[:, 1], 0.25)
    x, half = points.x[row, 0], points.half_length[row, 0]
    np.testing.assert_allclose((x + half)[:-1], (x - half)[1:], atol=1e-14)  # rounding of numbers up to 16
    assert points.volume.sum() == pytest.approx(16.0, rel=1e-14)
    np.testing.assert_allclose(points.volume, 4 * points.half_length.prod(axis=1), rtol=1e-14)
    assert np.ptp(half) > 0.05  # it does deform them
