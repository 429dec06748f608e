"""Models that mislead about the body say so, and those that do not are left in peace."""

import re
import warnings
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpmtop.body import Support
from mpmtop.diagnose import GluedGap, ModelWarning, NearMechanism, PointsOnGridLines, energy_warning
from mpmtop.equilibrium import equilibrium
from mpmtop.grid import Grid
from mpmtop.loads import PointLoad, RegionLoad
from mpmtop.material import Material
from mpmtop.model import Model, discretise
from mpmtop.planning import plan
from mpmtop.points import MaterialPoints, seed
from mpmtop.problem import DesignProblem
from mpmtop.region import Circle, Difference, Polygon, Rectangle, Region, Union
from mpmtop.scene import Scene
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3, gimp, tent
from mpmtop.transfer import body_ends, transfer
from reference_fem import elasticity
from tests.scenes import SHAPE_FUNCTIONS, cantilever

INF = np.inf
ALL = pytest.mark.parametrize("shape_function", SHAPE_FUNCTIONS, ids=lambda f: f.__name__)


def kinds(make: Callable[[], Model], *, solve: bool = False) -> tuple[Model, set[type[Warning]]]:
    """The model and the classes of warnings that making it, and its first analysis, gave."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        model = make()
        if solve:
            equilibrium(model, np.ones(len(model.points.volume)))
    return model, {warning.category for warning in caught}


def body(domain: Region, load: tuple[float, float] = (20.0, 6.0)) -> Scene:
    return cantilever(domain=domain, load=PointLoad(load, (0.0, -1.0), points=1))


def fork(slit: float) -> Scene:
    """20 x 8, slit of the given width along its middle from x = 4 on, its arms pressed together."""
    arms = (
        RegionLoad(Rectangle((19.0, 4.0), (20.0, 8.0)), (0.0, -0.5)),
        RegionLoad(Rectangle((19.0, 0.0), (20.0, 4.0)), (0.0, 0.5)),
    )
    domain = Difference(Rectangle((0.0, 0.0), (20.0, 8.0)), Rectangle((4.0, 4 - slit / 2), (21.0, 4 + slit / 2)))
    return cantilever(domain=domain, loads=arms, material=Material(1.0, 0.0, "stress"))


@pytest.mark.parametrize("slit", [0.25, 0.5, 1.0, 2.0])
@pytest.mark.parametrize(("h", "ppc"), [(1.0, 2), (1.0, 4), (0.5, 1), (0.5, 2)])
@ALL
def test_slit_is_named_where_it_is_glued(slit: float, h: float, ppc: int, shape_function: ShapeFunction) -> None:
    """Warned of if the arms do not bend alone, not where they do. By finite elements C > 200 for every slit (222 for
    0.5, 265 for 1, 398 for 2, at size 1/4); one beam under the pair of forces has C < 12."""
    model, found = kinds(lambda: discretise(fork(slit).body, h, ppc, shape_function))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NearMechanism)  # one point per cell
        C = float(model.f_ext @ equilibrium(model, np.ones(len(model.points.volume))).u)
    if found == set():
        assert C > 200
    elif not (shape_function is bspline3 and ppc == 1):  # there arms that a hair ties are too soft, C = 339
        assert found == {GluedGap}
        assert C < 100
    if found:
        (warning,) = model.findings
        assert " to (20, " in str(warning)  # up to the mouth
        if slit == 1.0:  # whole rows of points are missing
            assert "gap 1 wide" in str(warning)


def test_reference_sees_the_slit() -> None:
    """The elements have the slit in their mesh."""
    model = elasticity.discretise(fork(1.0).body, 0.25)
    C = float(model.f_ext @ elasticity.solve(model, np.ones(len(model.area))))
    assert C > 200


def band(start: tuple[float, float], end: tuple[float, float], width: float) -> Polygon:
    """A straight slit from start to end."""
    along = np.subtract(end, start)
    across = width / 2 * np.array([-along[1], along[0]]) / np.hypot(*along)
    return Polygon(tuple(tuple(map(float, p)) for p in (start - across, end - across, end + across, start + across)))


BOX = Rectangle((0.0, 0.0), (20.0, 12.0))
GAPS: dict[str, tuple[Region, tuple[float, float]]] = {
    "diagonal": (Difference(BOX, band((5.0, 1.0), (21.0, 13.0), 0.9)), (20.0, 1.0)),
    "steep": (Difference(BOX, band((8.0, 3.0), (11.0, 13.0), 0.9)), (20.0, 6.0)),
    "curved": (
        Difference(
            BOX,
            Difference(
                Difference(Circle((20.0, 0.0), 9.0), Circle((20.0, 0.0), 8.1)), Rectangle((0.0, -9.0), (13.0, 2.0))
            ),
        ),
        (20.0, 11.0),
    ),
    "inside": (Difference(BOX, Rectangle((5.0, 5.5), (15.0, 6.5))), (20.0, 1.0)),
    "L with a narrow notch": (
        Difference(Difference(BOX, Rectangle((12.0, 6.0), (20.0, 12.0))), Rectangle((8.0, 2.0), (8.5, 12.0))),
        (20.0, 3.0),
    ),
    "two islands": (
        Union(Rectangle((0.0, 0.0), (9.0, 6.0)), Rectangle((9.5, 0.0), (20.0, 6.0))),
        (20.0, 3.0),
    ),
    "islands at a corner": (
        Union(Rectangle((0.0, 0.0), (9.0, 6.0)), Rectangle((9.5, 6.5), (20.0, 12.0))),
        (20.0, 7.0),
    ),
}


@pytest.mark.parametrize("ppc", [2, 3])
@pytest.mark.parametrize("h", [(1.0, 1.0), (1.25, 1.5)], ids=str)
@pytest.mark.parametrize("name", GAPS)
@ALL
def test_gaps_of_every_kind(name: str, h: tuple[float, float], ppc: int, shape_function: ShapeFunction) -> None:
    domain, load = GAPS[name]
    _, found = kinds(lambda: discretise(body(domain, load).body, h, ppc, shape_function))
    assert GluedGap in found


@pytest.mark.slow
@pytest.mark.parametrize("name", GAPS)
@ALL
def test_gaps_that_the_grid_resolves(name: str, shape_function: ShapeFunction) -> None:
    """At an eighth of the cell every gap is wider than the functions reach, but a corner's, and points show it."""
    domain, load = GAPS[name]
    model, found = kinds(lambda: discretise(body(domain, load).body, 0.125, 1, shape_function))
    assert GluedGap not in found, model.findings


@given(
    holes=st.lists(st.tuples(st.floats(2, 14), st.floats(2, 8), st.floats(0.3, 2.5)), max_size=3),
    ppc=st.sampled_from([1, 2, 3, (2, 1)]),
    shape_function=st.sampled_from(SHAPE_FUNCTIONS),
    corner=st.tuples(st.integers(4, 16), st.integers(4, 10)),
)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_sound_bodies_raise_no_alarm(
    holes: list[tuple[float, float, float]],
    ppc: int | tuple[int, int],
    shape_function: ShapeFunction,
    corner: tuple[int, int],
) -> None:
    """An L with round holes five cells apart or more and three from the boundary: no gap, no warning."""
    domain: Region = Difference(Rectangle((0.0, 0.0), (20.0, 14.0)), Rectangle(tuple(map(float, corner)), (21.0, 15.0)))
    kept: list[tuple[float, float, float]] = []
    for x, y, r in holes:
        apart = all(np.hypot(x - a, y - b) > r + s + 5 for a, b, s in kept)
        inside = (x + r + 3 < corner[0] or y + r + 3 < corner[1]) and x - r > 3 and y - r > 3
        if apart and inside and x + r < 17 and y + r < 11:
            kept.append((x, y, r))
            domain = Difference(domain, Circle((x, y), r))
    _, found = kinds(lambda: discretise(body(domain, (0.5, 0.5)).body, 1.0, ppc, shape_function))
    assert found == set()


def bar(shape_function: ShapeFunction, s: float, h: float = 1.0, ghost: float = 0.0) -> Model:
    """8 x 4, pulled at its end, held at x <= 0, with lines of the grid at k h + s h."""
    load = RegionLoad(Rectangle((8 - h / 2, 0.0), (8.0, 4.0)), (1.0, 0.0))
    scene = cantilever(8, 4, load=load, material=Material(1.0, 0.0))
    grid = Grid((-3 * h + s * h, -3 * h), (h, h), (round(8 / h) + 7, round(4 / h) + 6))
    return discretise(scene.body, shape_function=shape_function, grid=grid, ghost=ghost)


@pytest.mark.parametrize("s", [0.0, 0.3, 0.45, 0.6, 0.8, 0.95])
@pytest.mark.parametrize("h", [1.0, 0.25])
@ALL
def test_clamp_between_grid_lines(s: float, h: float, shape_function: ShapeFunction) -> None:
    """Warned of where the bar gives by six per cent more than F L / (E W); not where the clamp lies on the edge or a
    twentieth of a cell off it, which makes one per cent."""
    try:
        model, found = kinds(lambda: bar(shape_function, s, h))
        u = float(model.f_ext @ equilibrium(model, np.ones(len(model.points.volume))).u)
    except ValueError:  # UnsupportedBody: no point in the cell of the clamp
        assert s in (0.0, 0.3, 0.45)
        return
    error = u / ((8 - h / 4) / 4) - 1
    if error > 0.06:
        assert NearMechanism in found
    if s in (0.0, 0.95):
        assert error < 0.06  # by GIMP, whose other end is cut by a hair
        assert NearMechanism not in found


@pytest.mark.parametrize("s", [0.0, 0.8, 0.85, 0.9, 0.95])
def test_estimate_of_a_bent_clamp(s: float) -> None:
    """The estimate is that of a beam longer by a hair, to first order; from 4 per cent on it is a warning."""

    def compliance(s: float) -> tuple[float, set[type[Warning]], Model]:
        scene = cantilever(20, 4, load=PointLoad((19.75, 2.0), (0.0, -1.0), points=4))
        model, found = kinds(lambda: discretise(scene.body, grid=Grid((s - 3, -3.0), (1.0, 1.0), (27, 10))))
        return float(model.f_ext @ equilibrium(model, np.ones(len(model.points.volume))).u), found, model

    straight, (C, found, model) = compliance(0.0)[0], compliance(s)
    error = C / straight - 1
    assert (NearMechanism in found) == (error > 0.04)
    if found:
        said = re.search(r"too large by about ([\d.]+) %", str(model.findings[0]))
        assert said is not None
        assert float(said[1]) / 100 == pytest.approx(error, rel=0.1)  # the next order is 3 (longer / length)^2


@pytest.mark.parametrize("a", [1.0, 1.9, 2.1, 4.0])
def test_energy_between_the_points(a: float) -> None:
    """One point per cell sees the strain e = 1, not the hourglass u_x = a (-1)^(i + j) / 2: eps_xx and the engineering
    shear of it have a^2 / 3 in the mean square, and shear counts by half. Warned of from three times the energy on."""
    grid, points = Grid((0.0, 0.0), (1.0, 1.0), (9, 7)), seed(Rectangle((0.0, 0.0), (8.0, 6.0)), (1.0, 1.0))
    operators = transfer(grid, points, tent, body_ends(grid, points))
    x, y = grid.node_positions(operators.nodes).T
    u = np.stack([x + a * (-1.0) ** (x + y) / 2, 0 * x], axis=1).ravel()
    found = energy_warning(grid, points, operators, u, operators.strain(u), np.ones(len(points.x)))
    ratio = 1 + a**2 / 3 * (1 + 1 / 2)
    assert (found is not None) == (ratio > 3)
    assert found is None or f"{ratio:.3g} times the strain" in str(found)


@pytest.mark.parametrize("apart", [0.0, 0.5, 0.7, 0.8, 1.0])
def test_columns_of_points_that_moved_apart(apart: float) -> None:
    """The right half of a body moved by a part of a domain's width: in contact up to three quarters of it."""
    lattice = seed(Rectangle((0.0, 0.0), (8.0, 4.0)), (0.5, 0.5))
    points = lattice.moved((lattice.x[:, :1] > 4) * [0.5 * apart, 0.0])
    _, found = kinds(lambda: discretise(cantilever(9, 4).body, 1.0, points=points))
    assert (GluedGap in found) == (apart > 0.75)


def test_gaps_beyond_the_third_are_counted() -> None:
    domain: Region = BOX
    for x in (3.0, 7.0, 11.0, 15.0):
        domain = Difference(domain, Rectangle((x, 2.0), (x + 0.5, 13.0)))
    model, _ = kinds(lambda: discretise(body(domain, (20.0, 1.0)).body, 1.0))
    assert str(model.findings[0]).count(" nodes from ") == 3
    assert "; and 1 more." in str(model.findings[0])


@pytest.mark.parametrize("degrees", [20, 30, 45])
@pytest.mark.parametrize("h", [1.0, 0.5, 0.25])
@ALL
def test_rotated_cantilever(degrees: float, h: float, shape_function: ShapeFunction) -> None:
    """8 x 2 at an angle to the grid, clamped behind its short side: too soft by 12 % and more, said every time."""
    t = np.radians(degrees)
    R = np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]])
    straight = seed(Rectangle((0.0, -1.0), (8.0, 1.0)), (h / 2, h / 2))
    points = MaterialPoints(straight.x @ R.T, straight.volume, straight.half_length)
    corners = tuple(tuple(map(float, R @ q)) for q in ((0, -1), (8, -1), (8, 1), (0, 1)))
    behind = tuple(tuple(map(float, R @ q)) for q in ((-9, -9), (0, -9), (0, 9), (-9, 9)))
    end = tuple(map(float, R @ (8, 0)))
    scene = cantilever(
        domain=Polygon(corners), supports=(Support(Polygon(behind)),), load=PointLoad(end, (0.0, -1.0), points=4)
    )
    _, found = kinds(lambda: discretise(scene.body, h, points=points, shape_function=shape_function))
    assert NearMechanism in found


def stretched(shape_function: ShapeFunction, stretch: float) -> Model:
    p = seed(Rectangle((0.0, 0.0), (8.0, 2.0)), (0.5, 0.5))
    points = MaterialPoints(p.x * [stretch, 1], p.volume * stretch, p.half_length * [stretch, 1])
    last = float(points.x[:, 0].max())
    rollers = (
        Support(Rectangle((-INF, -INF), (0.0, INF)), (True, False)),
        Support(Rectangle((-INF, -INF), (INF, 0.0)), (False, True)),
    )
    load = RegionLoad(Rectangle((last - 1e-6, 0.0), (last + 1e-6, 2.0)), (1.0, 0.0))
    scene = cantilever(8 * stretch, 2, supports=rollers, load=load, material=Material(1.0, 0.0))
    return discretise(scene.body, 1.0, points=points, shape_function=shape_function)


@pytest.mark.parametrize("stretch", [1.0, 1.1, 1.2, 1.3, 1.5, 1.7, 1.8, 1.9, 1.95, 1.99])
@ALL
def test_points_pulled_apart(stretch: float, shape_function: ShapeFunction) -> None:
    """The bar of twice its length: right to the 16 per cent that tents lose by points that drift through the cells, or
    warned of. GIMP at 1.9 is out by 39 times."""
    model, found = kinds(lambda: stretched(shape_function, stretch), solve=True)
    u = float(model.f_ext @ equilibrium(model, np.ones(len(model.points.volume))).u)
    right = abs(u / (model.points.x[:, 0].max() / 2) - 1) < 0.16
    assert right != (NearMechanism in found)


def test_domains_that_see_no_strain() -> None:
    """GIMP at 1.9 is the case of the test above that is not right: without it that one could not fail."""
    _, found = kinds(lambda: stretched(gimp, 1.9), solve=True)
    assert NearMechanism in found


@pytest.mark.parametrize("shape_function", [bspline2, bspline3], ids=lambda f: f.__name__)
def test_one_row_of_points(shape_function: ShapeFunction) -> None:
    """A beam of one row of points, which sees no bending: out by thousands; warned of at the first analysis only."""
    model = discretise(cantilever(8, 1).body, 1.0, (2, 1), shape_function)
    moduli = np.ones(len(model.points.volume))
    with pytest.warns(NearMechanism, match="times the strain"):
        equilibrium(model, moduli)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        equilibrium(model, moduli)


@ALL
def test_points_on_grid_lines(shape_function: ShapeFunction) -> None:
    """A bar whose rows of points lie on grid lines and its mirror image have one compliance, or are warned of."""

    def compliance(mirrored: bool) -> tuple[float, set[type[Warning]]]:
        p = seed(Rectangle((0.0, 0.0), (6.0, 2.0)), (0.5, 0.5)).moved((0.25, 0.0))
        last, held, side = float(p.x[:, 0].max()), Rectangle((-INF, -INF), (0.0, INF)), 1.0
        if mirrored:
            p = MaterialPoints([6.0, 0.0] + p.x * [-1, 1], p.volume, p.half_length)
            last, held, side = 6 - last, Rectangle((6.0, -INF), (INF, INF)), -1.0
        load = RegionLoad(Rectangle((last - 1e-6, 0.0), (last + 1e-6, 2.0)), (side, 0.0))
        scene = cantilever(domain=Rectangle((-1.0, 0.0), (7.0, 2.0)), supports=(Support(held),), load=load)
        model, found = kinds(lambda: discretise(scene.body, 1.0, points=p, shape_function=shape_function))
        return float(model.f_ext @ equilibrium(model, np.ones(len(p.x))).u), found

    (one, found), (other, _) = compliance(False), compliance(True)
    assert (PointsOnGridLines in found) == (abs(one / other - 1) > 1e-9)


@ALL
def test_seeded_points_lie_on_no_line(shape_function: ShapeFunction) -> None:
    _, found = kinds(lambda: discretise(cantilever().body, 1.0, 2, shape_function))
    assert found == set()


def test_plan_repeats_the_findings() -> None:
    scene = fork(1.0)
    model, _ = kinds(lambda: discretise(fork(1.0).body, 1.0, 2, tent))
    (finding,) = model.findings
    assert f"warning, GluedGap: {finding}" in plan(DesignProblem(model, scene.design, scene.objective)).splitlines()
    sound = discretise(cantilever().body, 1.0)
    assert "warning" not in plan(DesignProblem(sound, scene.design, scene.objective))


def test_each_kind_is_of_one_base() -> None:
    """So that a user turns them off, or into errors, one by one or together."""
    for kind in (GluedGap, NearMechanism, PointsOnGridLines):
        assert issubclass(kind, ModelWarning)
        assert issubclass(kind, UserWarning)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", GluedGap)
        discretise(fork(1.0).body, 1.0)
