"""Loads: what acts where, on points of any sizes, and through which functions."""

from dataclasses import replace

import numpy as np
import pytest
from skfem import MeshQuad

from mpmtop.body import Body, Material, Support
from mpmtop.design import Design
from mpmtop.equilibrium import equilibrium
from mpmtop.errors import InvalidScene, LoadOutsideBody, PositionOutsideBody
from mpmtop.grid import Grid
from mpmtop.loads import Action, PointLoad, PositionLoad, RegionLoad
from mpmtop.model import discretise
from mpmtop.quadtree import quadtree
from mpmtop.region import Rectangle
from mpmtop.scene import Scene
from mpmtop.shape_functions import ShapeFunction, gimp, tent
from reference_fem import elasticity
from reference_fem.reanalyse import reanalyse
from tests.scenes import SHAPE_FUNCTIONS, cantilever

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # bodies are moved on purpose

INF = np.inf
LENGTH, HEIGHT = 40.0, 10.0
EVERY = pytest.mark.parametrize("shape_function", SHAPE_FUNCTIONS, ids=lambda f: f.__name__)


def bar(load: RegionLoad) -> Body:
    """40 x 10, E = 1, nu = 0, on rollers at x = 0 and one pin."""
    rollers = Support(Rectangle((-1, -1), (0, HEIGHT + 1)), (True, False))
    pin = Support(Rectangle((0, 0), (0, 0)))
    return Body(Rectangle((0, 0), (LENGTH, HEIGHT)), (rollers, pin), (load,), Material(1.0, 0.0, "stress"))


def arm(force: np.ndarray, y: np.ndarray) -> float:
    """Height of the resultant of forces along x."""
    return float(force @ y / force.sum())


PULL = RegionLoad(Rectangle((LENGTH - 1, 0), (LENGTH, HEIGHT)), (1.0, 0.0))


@pytest.mark.parametrize("refined", [False, True], ids=["uniform", "upper half refined"])
@pytest.mark.parametrize("shape_function", [tent, gimp])
def test_a_region_shares_by_volume(refined: bool, shape_function: ShapeFunction) -> None:
    """A uniform pull over the last column: by statics it acts at mid-height and does the same work on points that are
    twice as fine above. C = 3.913: what uniform points give, of a pull that enters over half a column, 3.95."""
    tree = quadtree(bar(PULL).domain, (1.0, 1.0))
    points = (tree.refine(tree.centre[:, 1] > HEIGHT / 2) if refined else tree).points()
    model = discretise(bar(PULL), 2.0, shape_function=shape_function, points=points)
    f = model.f_ext.reshape(-1, 2)[:, 0]
    assert f.sum() == pytest.approx(1, rel=1e-14)
    assert arm(f, model.grid.node_positions(model.transfer.nodes)[:, 1]) == pytest.approx(5, rel=1e-13)
    state = equilibrium(model, np.ones(len(points.volume)))
    # two of the stiffness's points lie elsewhere in their cells when refined: a thousandth
    assert model.f_ext @ state.u == pytest.approx(3.913, rel=1e-3)


@pytest.mark.parametrize("refined", [False, True], ids=["uniform", "upper half refined"])
def test_a_region_shares_by_area_of_elements(refined: bool) -> None:
    """3.925 by bilinear elements, whose column is one of elements."""
    y = np.concatenate([np.linspace(0, 5, 6), np.linspace(5, 10, 11 if refined else 6)[1:]])
    model = elasticity.discretise(bar(PULL), mesh=MeshQuad.init_tensor(np.linspace(0, LENGTH, 41), y))
    along = model.basis.split_indices()[0]
    assert arm(model.f_ext[along], model.basis.doflocs[1, along]) == pytest.approx(5, rel=1e-13)
    assert model.f_ext @ elasticity.solve(model, np.ones(len(model.area))) == pytest.approx(3.925, rel=1e-3)


def test_the_fine_reference_shares_by_volume() -> None:
    tree = quadtree(bar(PULL).domain, (1.0, 1.0))
    scene = Scene("bar", bar(PULL), Design(0.4, 1.5))
    compliance = []
    for refined in (tree, tree.refine(tree.centre[:, 1] > HEIGHT / 2)):
        points = refined.points()
        compliance.append(reanalyse(scene, points.x, points.half_length, np.ones(len(points.x)), split=1).compliance)
    assert compliance[1] == pytest.approx(compliance[0], rel=2e-3)  # the load enters over points half as wide above


def test_weight_of_a_body_acts_at_its_centre() -> None:
    weight = RegionLoad(Rectangle((0, 0), (LENGTH, HEIGHT)), (1.0, 0.0))
    tree = quadtree(bar(weight).domain, (1.0, 1.0))
    model = discretise(bar(weight), 2.0, points=tree.refine(tree.centre[:, 1] > HEIGHT / 2).points())
    f, y = model.f_ext.reshape(-1, 2)[:, 0], model.grid.node_positions(model.transfer.nodes)[:, 1]
    assert arm(f, y) == pytest.approx(5, rel=1e-13)


def test_the_nearest_points_share_equally_whatever_their_sizes() -> None:
    """As in the paper; the docstring says so."""
    tree = quadtree(Rectangle((0, 0), (4, 4)), (1.0, 1.0))
    points = tree.refine(tree.centre[:, 1] > 2).points()
    acts = PointLoad((4, 2), (0.0, -1.0)).act(points.x, points.volume, 1e-9)
    assert acts.carried.sum(axis=0) == pytest.approx([0, -1])
    assert np.ptp(points.volume[acts.points]) > 0.5
    x, y = acts.carried.T
    assert np.all(x == 0) and set(np.round(y * 6, 12)) <= {-1.0, -0.5}  # a sixth each; two in one shell divide one


@EVERY
def test_a_force_at_a_position_works_on_what_moves_there(shape_function: ShapeFunction) -> None:
    """f . u is the force times the displacement under it, by the functions of the model."""
    loads = (PositionLoad((8.0, 1.3), (0.3, -1.0)), PositionLoad((3.1, 4.0), (0.0, -0.5)))
    model = discretise(cantilever(loads=loads).body, 1.0, shape_function=shape_function)
    state = equilibrium(model, np.ones(128))
    under = model.at([load.position for load in loads]).displacement(state.u)
    work = sum(np.dot(load.force, at) for load, at in zip(loads, under, strict=True))
    assert model.f_ext @ state.u == pytest.approx(work, rel=1e-12)


@EVERY
def test_a_traction_by_forces_at_positions_is_uniform(shape_function: ShapeFunction) -> None:
    """A bar pulled by forces on its edge, at the rows of its points: stress 1 exactly. Through tents instead, B-splines
    were off by 7 % (quadratic) and 19 % (cubic) near the edge, at every h."""
    h, length, height = 0.25, 10.0, 2.0
    rows = h / 2 * (np.arange(16) + 0.5)
    left = Support(Rectangle((-INF, -INF), (0.0, INF)), (True, False))
    below = Support(Rectangle((-INF, -INF), (INF, 0.0)), (False, True))
    loads = tuple(PositionLoad((length, float(y)), (h / 2, 0.0)) for y in rows)
    body = Body(Rectangle((0.0, 0.0), (length, height)), (left, below), loads, Material(1.0, 0.0))
    model = discretise(body, h, 2, shape_function)
    one = np.ones(len(model.points.x))
    sigma = model.stress(one, equilibrium(model, one).strain)
    np.testing.assert_allclose(sigma, np.tile([1.0, 0.0, 0.0], (len(one), 1)), atol=1e-9)  # condition times rounding


@EVERY
def test_a_load_on_the_last_grid_line(shape_function: ShapeFunction) -> None:
    """A grid that ends with the body has no cell on the other side: the last one is closed."""
    body = cantilever(8, 4, load=PositionLoad((8.0, 4.0), (0.0, -1.0))).body
    tight = discretise(body, grid=Grid((0.0, 0.0), (1.0, 1.0), (8, 4)), shape_function=shape_function)
    wide = discretise(body, 1.0, shape_function=shape_function)
    u = [equilibrium(model, np.ones(128)).u for model in (tight, wide)]
    np.testing.assert_allclose(u[0], u[1], rtol=0, atol=1e-11 * np.abs(u[1]).max())


@EVERY
def test_functions_at_positions_are_those_of_points(shape_function: ShapeFunction) -> None:
    """At the points themselves, with their domains, N and B are the model's own to the last bit; partition of unity and
    linear fields hold anywhere, on the body's edges, too."""
    points = discretise(cantilever().body, 1.0).points.moved((0.3, 0.1))
    model = discretise(cantilever().body, 1.0, points=points, shape_function=shape_function)
    own = model.at(points.x, points.half_length)
    assert abs(own.N - model.transfer.N_matrix).max() == 0 and abs(own.B - model.transfer.B).max() == 0
    x = np.array([(0.0, 0.0), (9.0, 4.0), (9.0, 0.2), (3.3, 4.0), (4.0, 2.0), (8.999999, 1e-9)])
    at = model.at(x)
    np.testing.assert_allclose(at.N.sum(axis=1), 1, rtol=1e-14)
    nodes = model.grid.node_positions(model.transfer.nodes)
    np.testing.assert_allclose(at.displacement(nodes.ravel()), x, atol=1e-13)
    np.testing.assert_allclose(at.strain(nodes.ravel()), np.tile([1.0, 1.0, 0.0], (len(x), 1)), atol=1e-13)


@pytest.mark.parametrize("x", [(9.6, 2.0), (-2.0, 2.0), (4.0, 5.5), (4.0, 1e3)])
def test_a_position_outside_is_refused(x: tuple[float, float]) -> None:
    model = discretise(cantilever().body, 1.0)
    with pytest.raises(PositionOutsideBody, match="move it inwards"):
        model.at(np.array([x]))
    away = replace(model.points, x=np.where(model.points.x > 6, model.points.x - 2, model.points.x))
    with pytest.raises(LoadOutsideBody, match="no material point touches"):
        discretise(cantilever(load=PositionLoad((8.0, 2.0), (0, -1))).body, 1.0, points=away)


def test_a_load_of_ones_own() -> None:
    """Whatever has `act`: here a couple of forces on two points."""

    class Couple:
        def act(self, x: np.ndarray, volume: np.ndarray, tol: float) -> Action:
            return PointLoad((8, 4), (1, 0), 1).act(x, volume, tol)

    model = discretise(cantilever(loads=(Couple(),)).body, 1.0)
    assert model.f_ext.sum() == pytest.approx(1)
    with pytest.raises(InvalidScene, match="give a `PointLoad`"):
        cantilever(loads=((0, -1),))
    with pytest.raises(InvalidScene, match="give a region"):
        RegionLoad(((0, 0), (1, 1)), (0, -1))  # type: ignore[arg-type]
