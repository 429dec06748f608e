"""Parallelograms by their corners: a small CPDI passes, and four of its usual faults are found where they lie."""

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.grid import Grid
from mpmtop.shape_functions import gimp
from validation.codes import sheared
from validation.codes.adapter import Adapter, NoAdapter
from validation.codes.card import scorecard
from validation.codes.checks import every
from validation.methods.points import PointMethod


class Cpdi:
    """Weights are the mean of the tents at the corners; gradients the mean over the domain of what is linear along its
    sides: sum_c S(x_c) n_c / A, n_c half the sum of the outward normals of the sides that meet in corner c."""

    name, version, capabilities = "small CPDI", "", frozenset({"sheared domains"})

    def factors(self, corners: Array) -> tuple[Array, Array]:
        """Of the weight (4,) and the gradient (k, 4, 2) at each corner."""
        chord = np.roll(corners, -1, axis=1) - np.roll(corners, 1, axis=1)
        across = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
        area = (across[0][:, 0] * across[1][:, 1] - across[0][:, 1] * across[1][:, 0]) / 2
        return np.full(4, 0.25), np.stack([chord[..., 1], -chord[..., 0]], axis=-1) / (2 * area)[:, None, None]

    def shape_of_corners(self, corners: Array, grid: Grid) -> tuple[Array, Array, Array]:
        xi = (corners - grid.origin) / grid.h
        first = np.floor(xi).astype(int)
        weight, slope = self.factors(corners)
        node = np.stack([first + np.array([a, b]) for a in (0, 1) for b in (0, 1)], axis=2)
        tents = np.prod(1 - np.abs(xi[:, :, None] - node), axis=-1)
        N, grad_N = weight[:, None] * tents, slope[:, :, None] * tents[..., None]
        k = len(corners)
        return node.reshape(k, 16, 2), N.reshape(k, 16), grad_N.reshape(k, 16, 2)


class Uneven(Cpdi):
    """The first corner weighs more."""

    def factors(self, corners: Array) -> tuple[Array, Array]:
        weight, slope = super().factors(corners)
        return weight + np.array([0.01, -0.01, 0, 0]), slope


class Unsheared(Cpdi):
    """Gradients by the sides along the axes alone."""

    def factors(self, corners: Array) -> tuple[Array, Array]:
        weight, slope = super().factors(corners)
        return weight, np.abs(slope) * ((-1, -1), (1, -1), (1, 1), (-1, 1))


class Signed(Cpdi):
    """One corner's factor is of the wrong sign."""

    def factors(self, corners: Array) -> tuple[Array, Array]:
        weight, slope = super().factors(corners)
        return weight, slope * np.array([1, 1, -1, 1])[:, None]


class PerCell(Cpdi):
    """Gradients per cell, not per length."""

    def shape_of_corners(self, corners: Array, grid: Grid) -> tuple[Array, Array, Array]:
        node, N, grad_N = super().shape_of_corners(corners, grid)
        return node, N, grad_N * grid.h


FAULTS: dict[type[Cpdi], set[str]] = {
    Uneven: {"linear fields", "linear fields on oblong cells", "corners from the third on", "mirror image"},
    Unsheared: {"linear fields", "linear fields on oblong cells", "corners from the third on"},
    Signed: {"sum of gradients", "linear fields", "corners from the third on"},
    PerCell: {"linear fields on oblong cells"},
}


def test_a_small_cpdi_passes() -> None:
    card = scorecard(Adapter(Cpdi()), sheared.checks())
    assert [row.verdict for row in card.rows] == ["passes"] * len(sheared.checks())


@pytest.mark.parametrize("fault", FAULTS)
def test_its_faults_are_found(fault: type[Cpdi]) -> None:
    failing = {row.check.name for row in scorecard(Adapter(fault()), sheared.checks()).of("fails")}
    assert failing >= FAULTS[fault] and "unity" not in failing


def test_a_code_of_rectangles_is_not_asked() -> None:
    rows = scorecard(PointMethod("GIMP", gimp), sheared.checks()).rows
    assert {(row.verdict, row.where) for row in rows} == {("not supported", "sheared domains")}
    assert [check for check in every() if check.way == "sheared domain"]


def test_the_method_must_be_there() -> None:
    bare = type("Bare", (), {"capabilities": {"sheared domains"}})
    with pytest.raises(NoAdapter, match="has no method `shape_of_corners`"):
        Adapter(bare())


def test_domains_are_parallelograms_that_cross_lines() -> None:
    """Of positive area, all sorts of them, and none leaves the middle of the grid."""
    corners = sheared.sample().corners
    np.testing.assert_allclose(corners[:, 0] + corners[:, 2], corners[:, 1] + corners[:, 3], atol=1e-14)
    u, v = corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0]
    assert np.all(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0)
    cells = np.floor(corners).astype(int)
    assert 0.5 < np.mean(np.any(cells != cells[:, :1], axis=(1, 2))) < 1
    assert corners.min() > 2 and corners.max() < 8
