"""Bad input gets a named error that says what to change."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mpmtop.body import Material, Support
from mpmtop.criteria import PNormStress
from mpmtop.errors import EmptyDomain, InvalidScene, LoadOutsideBody, UnsupportedBody
from mpmtop.grid import Grid
from mpmtop.loads import PointLoad, RegionLoad
from mpmtop.model import discretise
from mpmtop.points import MaterialPoints, seed
from mpmtop.region import Rectangle
from tests.scenes import LEFT_CLAMP, cantilever

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
        ({"supports": LEFT_CLAMP}, InvalidScene, "with a comma"),
        ({"supports": (LEFT_CLAMP.region,)}, InvalidScene, "give a `Support`, an `EdgeSupport`, a `Spring` or a `Bed`"),
        ({"loads": (LEFT_CLAMP,)}, InvalidScene, "give a `PointLoad`"),
        ({"material": (Material(), Material())}, InvalidScene, "one Material for the body"),
        ({"objective": "compliance"}, InvalidScene, r"give Compliance\(\)"),
        ({"objective": PNormStress(12, 3.0)}, InvalidScene, "below the penalty"),
        ({"passive_void": Rectangle((7, 1), (9, 3))}, LoadOutsideBody, "in the passive void"),
        ({"passive_solid": (Rectangle((0, 0), (1, 1)),)}, InvalidScene, "give a region, such as"),
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
    with pytest.raises(InvalidScene, match="modulus nan: give a finite"):
        Material(young=NAN)
    with pytest.raises(InvalidScene, match=r"below 0\.5"):
        Material(poisson=0.5)
    with pytest.raises(InvalidScene, match="'strain' or 'stress'"):
        Material(plane="thick")  # type: ignore[arg-type]
    with pytest.raises(InvalidScene, match="two coordinates"):
        Rectangle((0, 0, 0), (1, 1, 1))  # type: ignore[arg-type]
    with pytest.raises(InvalidScene, match="two components"):
        Support(Rectangle((0, 0), (1, 1)), (True,))  # type: ignore[arg-type]
    for fixed in ((0.01, False), (None, True), ("x", "y"), "xy", (NAN, 0.0), 1, (2, 0)):
        with pytest.raises(InvalidScene, match="two components"):
            Support(Rectangle((0, 0), (1, 1)), fixed)  # type: ignore[arg-type]
    for nothing in ((False, False), (0, 0)):
        with pytest.raises(InvalidScene, match="holds nothing"):
            Support(Rectangle((0, 0), (1, 1)), nothing)  # type: ignore[arg-type]
    corners: Any = ((0, 0), (1, 1))
    for no_region in (
        lambda: Support(corners),
        lambda: RegionLoad(corners, (0, 1)),
        lambda: cantilever(domain=corners),
        lambda: cantilever(passive_void=corners),
    ):
        with pytest.raises(InvalidScene, match=r"give a region, such as Rectangle\(lower, upper\)"):
            no_region()
    for points in (2.5, "6", None):
        with pytest.raises(InvalidScene, match="whole number"):
            PointLoad((0, 0), (0, 1), points)  # type: ignore[arg-type]
    with pytest.raises(InvalidScene, match="finite numbers"):
        PointLoad((0, 0), (NAN, 1))
    for points in (-1, 0, 2.5):
        with pytest.raises(InvalidScene, match="PositionLoad"):
            PointLoad((0, 0), (0, 1), points=points)  # type: ignore[arg-type]
    with pytest.raises(InvalidScene, match="finite numbers"):
        RegionLoad(Rectangle((0, 0), (1, 1)), (np.inf, 0))


def test_what_means_the_same_is_taken() -> None:
    """Flags as most codes write them, arrays for pairs: the same body, equal and hashable."""
    flags: list[Any] = [(1, 0), [True, False], (np.True_, np.False_), np.array([1, 0]), (1.0, 0.0)]
    assert {Support(LEFT_CLAMP.region, fixed) for fixed in flags} == {Support(LEFT_CLAMP.region, (True, False))}
    pair: Any = np.array([8.0, 2.0])
    assert {PointLoad(pair, pair, np.int64(6))} == {PointLoad((8.0, 2.0), (8, 2))}  # type: ignore[arg-type]


def test_an_argument_that_another_leaves_without_effect_is_refused() -> None:
    """Cells by h or by a grid, points by ppc or by themselves; seeded points follow a grid that is given."""
    body = cantilever().body
    points, grid = seed(body.domain, (0.5, 0.5)), Grid((-2, -2), (2.0, 2.0), (6, 4))
    for both in ({"h": 1.0, "grid": grid}, {}, {"points": points}):
        with pytest.raises(InvalidScene, match="size h or a `grid`"):
            discretise(body, **both)  # type: ignore[arg-type]
    with pytest.raises(InvalidScene, match="beside `points`"):
        discretise(body, 1.0, 7, points=points)
    assert len(discretise(body, grid=grid).points.x) == 32


def test_a_model_takes_other_loads_but_no_other_supports_or_material() -> None:
    model = discretise(cantilever(8, 4).body, 1.0)
    pulled = replace(model, body=replace(model.body, loads=(PointLoad((8.0, 2.0), (2.0, 0.0)),)))
    assert pulled.f_ext.reshape(-1, 2).sum(axis=0) == pytest.approx([2.0, 0.0], abs=1e-12)
    roller = (*model.body.supports, Support(Rectangle((8.0, 0.0), (8.0, 4.0)), (True, False)))
    for body, what in (
        (replace(model.body, supports=roller), "other supports"),
        (replace(model.body, material=Material(1.0, 0.2)), "another material"),
    ):
        with pytest.raises(InvalidScene, match=f"made (for|of) {what}: discretise the body anew"):
            replace(model, body=body)


def test_discretisation_refuses() -> None:
    with pytest.raises(ValueError, match="at least one in each direction"):
        discretise(cantilever().body, 1.0, 0)
    for h in (-1.0, 0.0, NAN, np.inf):
        with pytest.raises(ValueError, match="positive lengths"):
            discretise(cantilever().body, h)
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
    points = discretise(cantilever(8, 4).body, 1.0, ppc).points
    assert len(points.x) == count
    assert points.volume.sum() == pytest.approx(32, rel=1e-14)
    np.testing.assert_allclose(points.volume, np.prod(2 * points.half_length, axis=1), rtol=1e-14)


def test_six_nearest_points() -> None:
    """At mid-height the six nearest of a 2 x 2 lattice are two in the last column and their neighbours, by symmetry."""
    x = discretise(cantilever(8, 4).body, 1.0).points.x
    at, force = PointLoad((8, 2), (0, -1)).act(x, np.ones(len(x)), 1e-9).places(x)
    expected = {(7.75, 1.75), (7.75, 2.25), (7.25, 1.75), (7.25, 2.25), (7.75, 1.25), (7.75, 2.75)}
    assert set(map(tuple, at)) == expected
    np.testing.assert_allclose(force, [[0, -1 / 6]] * 6, rtol=1e-15)


@pytest.mark.parametrize("points", [1, 2, 3, 5, 6, 7])
@pytest.mark.parametrize("position", [(8.0, 2.0), (8.0, 0.0), (4.0, 4.0), (5.0, 2.0), (5.1, 2.3)])
def test_load_is_shared_by_whole_shells(position: tuple[float, float], points: int) -> None:
    """The whole force acts, rounding of positions changes nothing, and a mirrored scene has the mirrored load."""
    x = discretise(cantilever(8, 4).body, 1.0).points.x
    load = PointLoad(position, (0.3, -1.0), points)
    at, force = load.act(x, np.ones(len(x)), 1e-9).places(x)
    np.testing.assert_allclose(force.sum(axis=0), [0.3, -1.0], rtol=1e-14)
    jittered = x + np.random.default_rng(0).uniform(-1e-13, 1e-13, x.shape)
    assert set(load.act(x, np.ones(len(x)), 1e-9).points) == set(load.act(jittered, np.ones(len(x)), 1e-9).points)
    mirror = np.array([8.0, 0.0])
    mirrored = PointLoad((8 - position[0], position[1]), (-0.3, -1.0), points)
    there, other = mirrored.act(mirror + [-1, 1] * x, np.ones(len(x)), 1e-9).places(mirror + [-1, 1] * x)
    ours = {(*np.round(a, 9), *np.round(f, 12)) for a, f in zip(at, force, strict=True)}
    theirs = {
        (*np.round(mirror + [-1, 1] * a, 9), *np.round([-1, 1] * f, 12)) for a, f in zip(there, other, strict=True)
    }
    assert ours == theirs


def test_spacing_must_divide_the_domain() -> None:
    with pytest.raises(InvalidScene, match="does not divide"):
        discretise(cantilever(8.3, 4).body, 1.0)
    with pytest.raises(ValueError, match="whole number"):
        discretise(cantilever().body, 1.0, 2.5)  # type: ignore[arg-type]
