"""The ghost penalty: what it leaves alone, what it costs, and what it holds on to."""

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.body import Support
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.equilibrium import adjoint, equilibrium, moduli_gradient
from mpmtop.errors import UnsupportedBody
from mpmtop.ghost import cell_volumes
from mpmtop.grid import Grid
from mpmtop.loads import PointLoad
from mpmtop.model import Model, discretise
from mpmtop.objectives import COMPLIANCE, compliance
from mpmtop.planning import plan
from mpmtop.problem import DesignProblem, design_problem
from mpmtop.region import Circle, Difference, Rectangle
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3, gimp, tent
from mpmtop.transfer import body_ends, transfer
from tests.scenes import LEFT_CLAMP, cantilever
from validation.measures.conditioning import condition
from validation.measures.derivatives import taylor_orders

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # bodies are moved and cut on purpose

BOTH = pytest.mark.parametrize("shape_function", [tent, gimp], ids=lambda f: f.__name__)
HOLE = Difference(Rectangle((0, 0), (8, 4)), Circle((4.3, 1.2), 1.3))
"""Leaves a lone point in some cells: singular without the penalty."""


DESIGN = cantilever().design


def perforated(shape_function: ShapeFunction, gamma: float, shift: float = 0.3, **changes: object) -> Model:
    """The small cantilever with a hole, its points moved along y: cuts at the hole and along two edges."""
    scene = cantilever(domain=HOLE, **changes)
    points = discretise(scene.body, 1.0).points.moved((0.0, shift))
    return discretise(scene.body, 1.0, points=points, shape_function=shape_function, ghost=gamma)


def moduli_of(model: Model) -> Array:
    return np.random.default_rng(1).uniform(0.1, 1, len(model.points.x))


def matrix(model: Model, moduli: Array) -> Array:
    """K in full, for degrees of freedom in the order of the nodes; zero where held."""
    K, s = np.zeros((len(model.f_ext),) * 2), model.stiffness
    K[s.dof[s.row], s.dof[s.col]] = K[s.dof[s.col], s.dof[s.row]] = s.data(moduli)
    return K


@BOTH
def test_penalty_in_the_stiffness(shape_function: ShapeFunction) -> None:
    """What K gains is what `force` and `work` say, and no deformation gives it back energy."""
    model, plain = perforated(shape_function, 0.1), perforated(shape_function, 0.0)
    moduli, free = moduli_of(model), model.stiffness.dof
    K = matrix(model, moduli) - matrix(plain, moduli)
    assert len(model.stiffness.row) > len(plain.stiffness.row)
    assert np.all(model.stiffness.row >= model.stiffness.col)
    assert np.all(np.diff(model.stiffness.col * len(free) + model.stiffness.row) > 0)
    u, v = np.zeros((2, len(K)))
    u[free], v[free] = np.random.default_rng(2).normal(size=(2, len(free)))
    # entries of order one, a few of them in a row
    np.testing.assert_allclose((K @ u)[free], model.ghost.force(moduli, u)[free], rtol=0, atol=1e-13)
    assert moduli @ model.ghost.work(v, u) == pytest.approx(v @ K @ u, rel=1e-12)
    spectrum = np.linalg.eigvalsh(K)
    assert spectrum[0] > -1e-13 * spectrum[-1]  # rounding
    assert spectrum[-1] > 0.01  # gamma times a modulus, and no zero


@BOTH
def test_linear_fields_cost_nothing(shape_function: ShapeFunction) -> None:
    """Rigid translation and rotation and any constant strain, on cells that are no squares."""
    grid = Grid((-3, -2), (1.5, 0.75), (9, 9))  # its lines are not the body's edges
    model = discretise(cantilever(6, 3).body, shape_function=shape_function, grid=grid, ghost=1.0)
    assert model.ghost.modulus.shape[0] > 0
    x = model.grid.node_positions(model.transfer.nodes)
    u = x @ np.random.default_rng(3).normal(size=(2, 2)) + [0.7, -0.4]
    np.testing.assert_allclose(model.ghost.force(moduli_of(model), u.ravel()), 0, atol=1e-14)  # rounding of x


def test_energy_of_curved_fields() -> None:
    """A body that fills half of its last column, and of its top row: energies by hand, on cells 1 by 2.

    u = x^2 has a jump of 2 h_x at the faces across x, y^2 one of 2 h_y at those across y, x y none.
    """
    body = Rectangle((0, 0), (2.5, 5))  # 2 x 2 full cells, two half ones beside and two above them, one of a quarter
    model = discretise(cantilever(domain=body, load=PointLoad((2.5, 2), (0, -1))).body, (1.0, 2.0), ghost=0.3)
    assert model.ghost.between == 12
    assert model.ghost.modulus.shape[0] == 8  # all but the four between full cells
    np.testing.assert_allclose(model.ghost.modulus.sum(axis=1), 1, rtol=1e-15)
    x, y = model.grid.node_positions(model.transfer.nodes).T
    moduli, zero = np.full(len(model.points.x), 5.0), np.zeros_like(x)

    def energy(*u: Array) -> float:
        field = np.stack(u, axis=1).ravel()
        return moduli @ model.ghost.work(field, field)

    # E gamma h_n / 3 (2 h_n)^2 h_t, four faces each: the one between the half cells and the three that lead into the
    # last column or row
    across_x, across_y = 5 * 0.3 / 3 * 4 * 2.0 * 4, 5 * 0.3 * 2 / 3 * 16 * 1.0 * 4
    assert energy(x**2, zero) == pytest.approx(across_x, rel=1e-13)
    assert energy(zero, x**2) == pytest.approx(across_x, rel=1e-13)
    assert energy(y**2, zero) == pytest.approx(across_y, rel=1e-13)
    assert energy(x**2, y**2) == pytest.approx(across_x + across_y, rel=1e-13)
    along = (6**3 + 6**3 - 4**3) / 3  # of y^2: the jump of x^2 y grows along a face
    assert energy(x**2 * y, zero) == pytest.approx(across_x / 8 * along, rel=1e-13)  # 8, the faces' length
    assert energy(x * y, -x * y) == pytest.approx(0, abs=1e-25)


def test_modulus_is_the_mean_by_volume() -> None:
    """Four points of a full cell and two of the half one beyond it."""
    model = discretise(cantilever(2.5, 1).body, 1.0, ghost=1.0)
    assert model.ghost.modulus.shape == (1, 10)
    np.testing.assert_allclose(model.ghost.modulus @ np.where(model.points.x[:, 0] < 2, 3.0, 0.0), 2.0, rtol=1e-15)
    beside = np.flatnonzero(model.points.x[:, 0] > 1)
    np.testing.assert_array_equal(np.flatnonzero(model.ghost.modulus.toarray()), beside)


@BOTH
@pytest.mark.parametrize("shift", [0.0, 0.1, 0.25, 0.3, 0.25 + 1e-9])
@pytest.mark.parametrize("h", [(1.0, 1.0), (1.1, 0.9)])
def test_volumes_in_cells(shape_function: ShapeFunction, shift: float, h: tuple[float, float]) -> None:
    """Against the overlap of rectangles, and for the tent the cell that a point is in."""
    points = discretise(cantilever(domain=HOLE).body, 1.0).points.moved((shift, -shift))
    grid = Grid((-2, -2), h, (13, 9))
    cell, volume = cell_volumes(grid, points, transfer(grid, points, shape_function, body_ends(grid, points)))
    corner = grid.node_positions(cell)
    half = points.half_length if shape_function is gimp else np.full_like(points.half_length, 1e-12)
    low = np.maximum(points.x - half, corner[:, None])
    width = np.clip(np.minimum(points.x + half, corner[:, None] + h) - low, 0, None)
    overlap = points.volume * np.prod(width / (2 * half), axis=-1)
    if shape_function is gimp:
        np.testing.assert_allclose(volume.toarray(), overlap, rtol=0, atol=1e-12)  # tolerance of crossing, in cells
        np.testing.assert_allclose(volume.sum(axis=0), points.volume, rtol=1e-14)
        np.testing.assert_array_equal(volume.toarray()[overlap == 0], 0)  # no cell by rounding
    else:
        xi = points.x - corner[:, None]
        inside = np.all((xi > -1e-10) & (xi < np.array(h) - 1e-10), axis=-1)
        np.testing.assert_allclose(volume.toarray(), inside * points.volume, rtol=1e-14)


@BOTH
@pytest.mark.parametrize("gamma", [1e-3, 1.0])
def test_patch_test_with_a_hole(shape_function: ShapeFunction, gamma: float) -> None:
    """Forces of a linear field give back that field, whatever gamma: the cells at the hole and the edges are cut."""
    rollers = (Support(LEFT_CLAMP.region, (True, False)), Support(Rectangle((0, 0), (0, 0)), (False, True)))
    model = perforated(shape_function, gamma, supports=rollers)
    x, y = model.grid.node_positions(model.transfer.nodes).T
    exact = np.stack([0.1 * x, -0.03 * y], axis=1)  # zero where held
    moduli = moduli_of(model)
    force = model.internal_force(model.stress(moduli, model.transfer.strain(exact.ravel())))
    state = equilibrium(model, moduli, f_ext=force)
    # rounding times the condition number, 1e6 at the smaller gamma
    np.testing.assert_allclose(state.u.reshape(-1, 2), exact, rtol=0, atol=1e-9)


@BOTH
def test_turned_body(shape_function: ShapeFunction) -> None:
    """The scene turned by a quarter, grid, cuts and all, has the same compliance."""
    centre, radius = (4.3, 1.2), 1.3
    turned = cantilever(
        domain=Difference(Rectangle((-4, 0), (0, 8)), Circle((-centre[1], centre[0]), radius)),
        supports=(Support(Rectangle((-np.inf, -np.inf), (np.inf, 0))),),
        loads=(PointLoad((-2.0, 8.0), (1.0, 0.0)),),
    )
    values = []
    for scene, shift, grid in (
        (cantilever(domain=HOLE), (0.0, 0.3), Grid((-2, -2), (1, 1), (12, 9))),
        (turned, (-0.3, 0.0), Grid((-7, -2), (1, 1), (9, 12))),
    ):
        points = discretise(scene.body, 1.0).points.moved(shift)
        model = discretise(scene.body, points=points, grid=grid, shape_function=shape_function, ghost=0.01)
        values.append(compliance(model, equilibrium(model, np.ones(len(points.x)))))
    assert values[0] == pytest.approx(values[1], rel=1e-10)  # rounding times the condition number


def test_gamma_is_a_pure_number() -> None:
    """Compliance per unit thickness has no length in it: in millimetres or in metres, it is the same."""
    values = []
    for unit in (1.0, 1e-3):
        body = Difference(Rectangle((0, 0), (8 * unit, 4 * unit)), Circle((4.3 * unit, 1.2 * unit), 1.3 * unit))
        scene = cantilever(domain=body, load=PointLoad((8 * unit, 2 * unit), (0, -1)), filter_radius=unit)
        model = discretise(scene.body, unit, ghost=0.01)
        values.append(compliance(model, equilibrium(model, np.ones(len(model.points.x)))))
    assert values[0] == pytest.approx(values[1], rel=1e-10)  # rounding times the condition number


@BOTH
def test_full_cells_are_not_touched(shape_function: ShapeFunction) -> None:
    """Not a bit of a body that fills its cells changes, and its plan says so."""
    off, on = (design_problem(cantilever(), 1.0, shape_function=shape_function, ghost=g) for g in (0.0, 0.1))
    assert on.fingerprint == off.fingerprint
    a, b = on.evaluate(on.x0), off.evaluate(off.x0)
    assert a.objective == b.objective
    np.testing.assert_array_equal(on.gradient(a)[0], off.gradient(b)[0])
    assert "ghost faces: skipped, none of the 52" in plan(on)  # 7 x 4 across x, 8 x 3 across y
    assert "ghost faces: skipped, the ghost penalty is off" in plan(off)


def test_fingerprint_and_plan() -> None:
    problems = [DesignProblem(perforated(gimp, gamma), DESIGN) for gamma in (0.0, 0.01, 0.02)]
    assert len({problem.fingerprint for problem in problems}) == 3
    ghost = problems[1].model.ghost
    assert 0 < ghost.modulus.shape[0] < ghost.between
    assert f"ghost faces: {ghost.modulus.shape[0]} of {ghost.between}" in plan(problems[1])


@BOTH
@pytest.mark.parametrize("objective", [Compliance(), PNormStress()], ids=lambda o: type(o).__name__)
def test_gradient_has_a_second_order_remainder(
    shape_function: ShapeFunction, objective: Compliance | PNormStress
) -> None:
    """Taylor test at a random density and direction; at this gamma the penalty is a good part of the energy."""
    design = DesignProblem(perforated(shape_function, 1.0), DESIGN, objective)
    p = len(design.model.points.x)
    rng = np.random.default_rng(4)
    rho, d = rng.uniform(0.3, 0.9, p), rng.uniform(-0.1, 0.1, p)
    at = design.analyse(rho)
    slope = design.density_gradient(at) @ d
    order = taylor_orders(lambda rho: design.analyse(rho).objective, rho, d, slope, (1e-3, 1e-4))
    assert order == pytest.approx(2, abs=0.05)  # the third-order term at t = 1e-4
    model, state = design.model, at.state
    assert state.moduli @ model.ghost.work(state.u, state.u) > 0.01 * compliance(model, state)
    # homogeneous of degree -1 in the moduli, the penalty included; the solve's rounding
    by_moduli = moduli_gradient(model, state, adjoint(model, state, COMPLIANCE))
    assert state.moduli @ by_moduli == pytest.approx(-compliance(model, state), rel=1e-10)


@pytest.mark.parametrize("direction", [(1.0, 0.0), (1.0, 1.0)], ids=["x", "diagonal"])
def test_small_cuts(direction: tuple[float, float]) -> None:
    """A GIMP domain that overlaps the next cell by s: without the penalty the condition number grows as s^-2, at a
    corner as s^-6 and the displacement as s^-3; with it both are those of the body that is not cut."""
    scene = cantilever(20, 10)
    seeded = discretise(scene.body, 1.0)
    E = np.ones(800)
    whole = equilibrium(seeded, E)
    uncut = condition(seeded, whole).plain
    largest = np.abs(whole.u).max()
    for s in (1e-2, 1e-4, 1e-8):
        points = seeded.points.moved(s * np.array(direction))
        for gamma in (0.0, 0.01):
            model = discretise(scene.body, 1.0, points=points, shape_function=gimp, ghost=gamma)
            state = equilibrium(model, E)
            plain = condition(model, state).plain
            if gamma:
                assert plain < 2 * uncut
                # linear continuation over one cell adds one part in twenty; the tip's rotation is 1.5 of its mean
                assert np.abs(state.u).max() < 1.1 * largest
                change = compliance(model, state) / compliance(seeded, whole) - 1
                assert abs(change) < 0.5 * s + 3e-4  # the lever arm grows by s; gamma's own part
            elif s < 1e-3:
                assert plain > 1e4 * uncut
                assert np.abs(state.u).max() > 30 * largest


@BOTH
def test_lone_points_are_held(shape_function: ShapeFunction) -> None:
    with pytest.raises(UnsupportedBody, match="carries no stiffness"):
        equilibrium(perforated(shape_function, 0.0, shift=0.0), np.ones(107))
    model = perforated(shape_function, 0.01, shift=0.0)
    state = equilibrium(model, np.ones(107))
    full = discretise(cantilever().body, 1.0)
    # 3.5 times, the same at gamma = 1: the hole has made the body softer, no cut shows
    assert condition(model, state).plain < 4 * condition(full, equilibrium(full, np.ones(128))).plain


def test_point_on_a_crossing_of_grid_lines() -> None:
    """Moved by a quarter both ways the outermost point of the tent sits on a node, and its cell lacks the far one."""
    points = discretise(cantilever().body, 1.0).points.moved((0.25, 0.25))
    values = []
    for gamma in (0.0, 0.01):
        model = discretise(cantilever().body, 1.0, points=points, ghost=gamma)
        values.append(compliance(model, equilibrium(model, np.ones(128))))
    assert values[1] == pytest.approx(values[0], rel=0.01)  # gamma
    assert values[1] < values[0]  # the penalty stiffens


def test_islands_stay_loose() -> None:
    """The load on a piece that no cell's face connects with the body: no penalty can know what holds it."""
    gap = Difference(Rectangle((0, 0), (8, 4)), Rectangle((3, 0), (5, 4)))
    model = discretise(cantilever(domain=gap).body, 1.0, ghost=1.0)
    with pytest.raises(UnsupportedBody, match="connect it to a support"):
        equilibrium(model, np.ones(len(model.points.x)))


def test_void_stays_void() -> None:
    """Points of no modulus lend the penalty none."""
    model = perforated(tent, 1.0)
    solid = model.points.x[:, 0] < 2
    E = np.where(solid, 1.0, 0.0)
    right = (model.grid.node_positions(model.transfer.nodes)[:, 0] > 4).repeat(2)
    u = np.random.default_rng(5).normal(size=len(right))
    assert np.all(model.ghost.force(np.ones(len(E)), u)[right] != 0)
    np.testing.assert_array_equal(model.ghost.force(E, u)[right], 0)


def test_what_is_refused() -> None:
    for function in (bspline2, bspline3):
        with pytest.raises(ValueError, match="use tent or gimp"):
            discretise(cantilever().body, 1.0, shape_function=function, ghost=0.01)
        discretise(cantilever().body, 1.0, shape_function=function)
    for gamma in (-0.1, np.nan, np.inf):
        with pytest.raises(ValueError, match="finite number"):
            discretise(cantilever().body, 1.0, ghost=gamma)
