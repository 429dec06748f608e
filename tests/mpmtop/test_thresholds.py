"""Thresholds of K and of what is said of it: each from both sides, with data that a wrong one gets wrong."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from mpmtop.arrays import Array
from mpmtop.body import Support
from mpmtop.equilibrium import equilibrium
from mpmtop.errors import UnsupportedBody
from mpmtop.loads import PointLoad
from mpmtop.model import discretise
from mpmtop.region import Difference, Rectangle, Region
from mpmtop.shape_functions import gimp
from mpmtop.solvers import BandedCholesky
from mpmtop.stiffness import CellMap
from tests.scenes import cantilever


def by_cells(x: Array) -> tuple[CellMap, Array, Array]:
    """The map of a body with points at x, its product with some moduli, and that of B^T E V D B in its places."""
    points = discretise(cantilever(8, 4).body, 1.0).points
    model = discretise(cantilever(8, 4).body, 1.0, points=replace(points, x=x))
    part, K, B = model.stiffness.maps[0], model.stiffness, model.transfer.B
    assert isinstance(part, CellMap)
    moduli = np.random.default_rng(1).uniform(0.1, 1, len(points.x))
    EVD = sp.kron(sp.diags_array(moduli * points.volume), model.D)
    return part, K.data(moduli), (B.T @ EVD @ B).toarray()[np.ix_(K.dof, K.dof)][K.row, K.col]


@pytest.mark.parametrize("apart", [1e-12, 1e-9, 1e-6, 1e-3])
def test_points_that_are_not_alike(apart: float) -> None:
    """Points a little off the lattice keep their own matrices; those that rounding moved share them."""
    x = discretise(cantilever(8, 4).body, 1.0).points.x
    part, ours, expected = by_cells(x + apart * np.random.default_rng(0).uniform(-1, 1, x.shape))
    # what is alike may be off by the rounding of positions, 1e-11 of a cell, and two neighbours by twice that
    np.testing.assert_allclose(ours, expected, rtol=0, atol=3e-11)
    assert len(part.local) == 128 if apart >= 1e-9 else len(part.local) < 40


def test_kinds_that_one_number_does_not_tell_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """With equal weights all points have the same number, as gradients sum to zero: every point is its own kind."""

    class Equal:
        def uniform(self, low: float, high: float, size: int) -> Array:
            return np.ones(size)

    x = discretise(cantilever(8, 4).body, 1.0).points.x
    with monkeypatch.context() as patched:
        patched.setattr("mpmtop.stiffness.np.random.default_rng", lambda seed: Equal())
        part = discretise(cantilever(8, 4).body, 1.0).stiffness.maps[0]
    assert isinstance(part, CellMap)
    assert len(part.local) == len(x)
    moduli = np.random.default_rng(1).uniform(0.1, 1, len(x))
    np.testing.assert_allclose(part @ moduli, by_cells(x)[2], rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("domain", "load", "at_most"),
    [
        (Rectangle((0, 0), (30, 8)), (30, 4), 2 * (9 + 1) + 1),  # columns: the nodes of one, and one more
        (Rectangle((0, 0), (8, 30)), (8, 15), 2 * (9 + 1) + 1),  # rows
        (Difference(Rectangle((0, 0), (30, 30)), Rectangle((8, 8), (30, 30))), (30, 4), 2 * (2 * 9 + 2) + 1),
        (Difference(Rectangle((0, 0), (30, 30)), Rectangle((8, 0), (30, 22))), (30, 26), 2 * (2 * 9 + 2) + 1),
    ],
    ids=["columns", "rows", "diagonals", "other diagonals"],
)
def test_narrow_order(domain: Region, load: tuple[float, float], at_most: int) -> None:
    """The band is as wide as the body's narrow side, and twice that for an L, along whose diagonals it is numbered."""
    scene = cantilever(30, 30, domain=domain, load=PointLoad(load, (0.0, -1.0)))
    solver = discretise(scene.body, 1.0, solver=BandedCholesky).solver
    assert isinstance(solver, BandedCholesky)
    assert solver.bandwidth <= at_most


@pytest.mark.parametrize("missing", [0.0, 1e-13, 1e-6, 1e-3])
def test_what_counts_as_cut(missing: float) -> None:
    """A cell that lacks a millionth of its volume is cut; one that rounding takes a hair from is not."""
    points = discretise(cantilever(6, 4).body, 1.0).points
    points = replace(points, volume=points.volume * np.where(np.arange(len(points.volume)) == 30, 1 - 4 * missing, 1))
    model = discretise(cantilever(6, 4).body, 1.0, points=points, shape_function=gimp, ghost=0.01)
    assert (model.ghost.modulus.shape[0] > 0) == (missing >= 1e-6)


@pytest.mark.parametrize(("tie", "island"), [(1e-6, False), (1e-8, True)])
def test_what_ties_to_a_support(tie: float, island: bool) -> None:
    """A body that turns about a pin, its far half behind a soft strip: a strip of 1e-6 ties it, 1e-8 does not."""
    pin = Support(Rectangle((0, 0), (0, 0)))
    model = discretise(cantilever(12, 4, supports=(pin,)).body, 1.0, solver=BandedCholesky)
    soft = np.abs(model.points.x[:, 0] - 6) < 1
    with pytest.raises(UnsupportedBody) as error:
        equilibrium(model, np.where(soft, tie, 1.0))
    assert ("on an island" in str(error.value)) == island
