"""Bad input gets a named error that says what to change."""

import numpy as np
import pytest

from mpmtop.equilibrium import discretise
from mpmtop.grid import Grid
from mpmtop.points import MaterialPoints, seed
from mpmtop.scene import (
    EmptyDomain,
    InvalidScene,
    LoadOutsideBody,
    Material,
    PointLoad,
    Rectangle,
    RegionLoad,
    UnsupportedBody,
)
from tests.scenes import cantilever

NAN = float("nan")


@pytest.mark.parametrize(
    ("changes", "error", "advice"),
    [
        ({"domain": Rectangle((0, 0), (0, 4))}, EmptyDomain, "positive area"),
        ({"domain": Rectangle((0, 0), (np.inf, 4))}, EmptyDomain, "finite"),
        ({"supports": ()}, UnsupportedBody, "add one"),
        ({"loads": ()}, InvalidScene, "add one"),
        ({"loads": (PointLoad((9, 2), (0, -1)),)}, LoadOutsideBody, "move it into"),
        ({"volume_fraction": 0.0}, InvalidScene, "above 0 and at most 1"),
        ({"volume_fraction": 1.1}, InvalidScene, "above 0 and at most 1"),
        ({"volume_fraction": NAN}, InvalidScene, "above 0 and at most 1"),
        ({"filter_radius": 0.0}, InvalidScene, "positive length"),
        ({"filter_radius": -1.0}, InvalidScene, "positive length"),
        ({"filter_radius": NAN}, InvalidScene, "positive length"),
        ({"rho_min": 1.0}, InvalidScene, "below 1"),
        ({"rho_min": NAN}, InvalidScene, "below 1"),
        ({"rho_min": 0.5}, InvalidScene, "no design is feasible"),
        ({"contrast": 1.0}, InvalidScene, "below 1"),
        ({"contrast": NAN}, InvalidScene, "below 1"),
        ({"penal": 0.5}, InvalidScene, "at least 1"),
        ({"penal": NAN}, InvalidScene, "at least 1"),
    ],
    ids=str,
)
def test_scene_refuses(changes: dict, error: type[Exception], advice: str) -> None:
    with pytest.raises(error, match=advice):
        cantilever(**changes)


def test_parts_refuse() -> None:
    with pytest.raises(InvalidScene, match="upper bound"):
        Rectangle((1, 0), (0, 1))
    with pytest.raises(InvalidScene, match="upper bound"):
        Rectangle((NAN, 0), (1, 1))
    with pytest.raises(InvalidScene, match="positive, finite"):
        Material(young=NAN)
    with pytest.raises(InvalidScene, match=r"below 0\.5"):
        Material(poisson=0.5)
    with pytest.raises(InvalidScene, match="'strain' or 'stress'"):
        Material(plane="thick")  # type: ignore[arg-type]
    with pytest.raises(InvalidScene, match="finite numbers"):
        PointLoad((0, 0), (NAN, 1))
    with pytest.raises(InvalidScene, match="0 or more"):
        PointLoad((0, 0), (0, 1), points=-1)
    with pytest.raises(InvalidScene, match="finite numbers"):
        RegionLoad(Rectangle((0, 0), (1, 1)), (np.inf, 0))


def test_discretisation_refuses() -> None:
    with pytest.raises(ValueError, match="at least one in each direction"):
        discretise(cantilever(), 1.0, 0)
    for h in (-1.0, 0.0, NAN, np.inf):
        with pytest.raises(ValueError, match="positive cell sizes"):
            discretise(cantilever(), h)
    with pytest.raises(ValueError, match="cell sizes positive"):
        Grid((0, 0), (1, -1), (2, 2))
    with pytest.raises(ValueError, match="at least one in each"):
        Grid((0, 0), (1, 1), (2, 0))
    with pytest.raises(EmptyDomain, match="at least one"):
        MaterialPoints(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)))
    with pytest.raises(ValueError, match="not finite"):
        MaterialPoints(np.full((1, 2), NAN), np.ones(1), np.ones((1, 2)))
    with pytest.raises(ValueError, match="must be positive"):
        MaterialPoints(np.zeros((1, 2)), np.zeros(1), np.ones((1, 2)))
    with pytest.raises(ValueError, match=r"give \(p, 2\)"):
        MaterialPoints(np.zeros((2, 2)), np.ones(1), np.ones((2, 2)))


def test_region_without_points_is_empty() -> None:
    class Nowhere:
        bounds = np.zeros(2), np.ones(2)

        def contains(self, x: np.ndarray, tol: float = 0.0) -> np.ndarray:
            return np.zeros(len(x), dtype=bool)

    with pytest.raises(EmptyDomain, match="refine it"):
        seed(Nowhere(), (0.1, 0.1))


@pytest.mark.parametrize(("ppc", "count"), [(1, 32), (2, 128), ((3, 1), 96), (5, 800)])
def test_seeding_tiles_the_domain(ppc: int | tuple[int, int], count: int) -> None:
    points = discretise(cantilever(8, 4), 1.0, ppc).points
    assert len(points.x) == count
    assert points.volume.sum() == pytest.approx(32, rel=1e-14)
    np.testing.assert_allclose(points.volume, np.prod(2 * points.half_length, axis=1), rtol=1e-14)


def test_six_nearest_points() -> None:
    """At mid-height the six nearest of a 2 x 2 lattice are two in the last column and their neighbours, by symmetry."""
    x = discretise(cantilever(8, 4), 1.0).points.x
    nearest = x[PointLoad((8, 2), (0, -1)).carriers(x, 1e-9)]
    expected = {(7.75, 1.75), (7.75, 2.25), (7.25, 1.75), (7.25, 2.25), (7.75, 1.25), (7.75, 2.75)}
    assert set(map(tuple, nearest)) == expected
    jittered = x + np.random.default_rng(0).uniform(-1e-13, 1e-13, x.shape)  # rounding must not change the choice
    for load in (PointLoad((8, 2), (0, -1)), PointLoad((8, 0), (0, -1)), PointLoad((4, 4), (0, -1), points=3)):
        assert set(load.carriers(x, 1e-9)) == set(load.carriers(jittered, 1e-9))
