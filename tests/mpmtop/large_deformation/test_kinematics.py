"""Weights of moving points, stretched domains, the background: derivatives by complex steps, dense algebra, SciPy."""

import numpy as np
import pytest
from scipy.linalg import sqrtm

from mpmtop.arrays import Array
from mpmtop.grid import Grid
from mpmtop.large_deformation.background import background
from mpmtop.large_deformation.kinematics import WIDEST, pull_back, stretched, stretched_pull_back, weights
from mpmtop.shape_functions import ShapeFunction, bspline2, gimp, tent

GRID = Grid((-1.0, 2.0), (0.5, 0.8), (9, 7))
STEP = 1e-30


def points(n: int = 40) -> tuple[Array, Array]:
    rng = np.random.default_rng(0)
    return rng.uniform([0.0, 3.0], [2.5, 6.5], (n, 2)), rng.uniform(0.1, 0.45, (n, 2)) * GRID.h


@pytest.mark.parametrize("shape_function", [tent, gimp, bspline2], ids=lambda s: s.__name__)
def test_pull_back_is_the_derivative(shape_function: ShapeFunction) -> None:
    """By positions and domains, of N and grad N at once."""
    x, length = points()
    rng = np.random.default_rng(1)
    w = weights(GRID, x, length, shape_function, second=True)
    N_bar, grad_bar = rng.standard_normal(w.N.shape), rng.standard_normal(w.grad_N.shape)
    dx, dl = rng.standard_normal((2, *x.shape))
    by_x, by_l = pull_back(w, N_bar, grad_bar)
    s = weights(GRID, x + 1j * STEP * dx, length + 1j * STEP * dl, shape_function)
    expected = np.sum(N_bar * s.N.imag, axis=1) + np.sum(grad_bar * s.grad_N.imag, axis=(1, 2))
    np.testing.assert_array_equal(s.node, w.node)
    np.testing.assert_allclose(np.sum(by_x * dx + by_l * dl, axis=1), expected / STEP, rtol=1e-11, atol=1e-11)


def test_stretched_domains_are_those_of_the_square_root() -> None:
    rng = np.random.default_rng(2)
    F = np.eye(2) + 0.2 * rng.standard_normal((50, 2, 2))
    half_length = rng.uniform(0.02, 0.1, (50, 2))
    U = np.array([sqrtm(f.T @ f) for f in F])
    found, clipped = stretched(half_length, F, GRID.h)
    assert not np.any(clipped)
    np.testing.assert_allclose(found, half_length * U[:, [0, 1], [0, 1]], rtol=1e-13)


def test_stretched_domains_are_clipped_and_their_derivative_is_zero_there() -> None:
    rng = np.random.default_rng(3)
    F = np.eye(2) + 0.1 * rng.standard_normal((50, 2, 2))
    half_length = rng.uniform(0.4, 0.6, (50, 2)) * GRID.h
    found, clipped = stretched(half_length, F, GRID.h)
    assert 0.2 < np.mean(clipped) < 0.9
    assert np.all(found <= WIDEST * np.array(GRID.h))
    bar, dF = rng.standard_normal((50, 2)), rng.standard_normal((50, 2, 2))
    by_step = stretched(half_length, F + 1j * STEP * dF, GRID.h)[0].imag / STEP
    pulled = stretched_pull_back(half_length, F, clipped, bar)
    np.testing.assert_allclose(np.sum(pulled * dF, axis=(1, 2)), np.sum(bar * by_step, axis=1), rtol=1e-12, atol=1e-14)


def test_condensed_background_is_the_schur_complement() -> None:
    """One component held on a line, the other mirrored there, as by a B-spline; a body in the middle of the box."""
    position = GRID.node_positions()
    held = position[:, :1] <= -0.5
    held = np.hstack([held, held & (position[:, 1:] > 4)]).ravel()
    unknown, sign = np.full(len(held), -1), np.ones(len(held))
    unknown[~held] = np.arange(np.count_nonzero(~held))
    mirror = np.flatnonzero(position[:, 0] == -1.0) * 2
    unknown[mirror], sign[mirror] = unknown[mirror + 4 * GRID.nodes[1]], -1
    soft = background(GRID, unknown, sign, 0.3)
    m = unknown.max() + 1
    everything = soft.condensed(np.ones(m, bool)).toarray()
    active = np.zeros(m, bool)
    inside = np.repeat(np.all((position > [-0.6, 3.0]) & (position < [2.2, 6.0]), axis=1), 2)
    active[unknown[inside & (unknown >= 0)]] = True
    assert 0.1 < np.mean(active) < 0.6
    K_ee, K_ea = everything[~active][:, ~active], everything[~active][:, active]
    expected = everything[active][:, active] - K_ea.T @ np.linalg.solve(K_ee, K_ea)
    np.testing.assert_allclose(soft.condensed(active).toarray(), expected, atol=1e-15)
    np.testing.assert_allclose(everything, everything.T, atol=1e-17)
    assert np.linalg.eigvalsh(everything).min() > 0


def test_background_is_the_energy_of_the_gradient() -> None:
    """A linear field u = (x, 2 y) over the box of 4.5 x 5.6: the energy is alpha E0 / 2 (1 + 4) times the area."""
    n = 2 * int(np.prod(GRID.nodes))
    K = background(GRID, np.arange(n), np.ones(n), 0.3).condensed(np.ones(n, bool))
    u = (GRID.node_positions() * [1, 2]).ravel()
    assert u @ (K @ u) / 2 == pytest.approx(0.3 / 2 * 5 * 4.5 * 5.6, rel=1e-13)
