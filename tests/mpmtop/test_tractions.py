"""Tractions, pressure, body force and weight: statics, exact stresses, and derivatives."""

from typing import Any

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.body import Body, Material, Support
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.design import Design
from mpmtop.equilibrium import equilibrium
from mpmtop.errors import InvalidScene, LoadOutsideBody
from mpmtop.grid import Grid
from mpmtop.loads import BodyForce, Load, PointLoad, Pressure, Traction, Weight
from mpmtop.material import simp
from mpmtop.model import Model, discretise
from mpmtop.planning import plan
from mpmtop.points import seed
from mpmtop.problem import DesignProblem
from mpmtop.region import Circle, Difference, Rectangle, Region
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3, gimp, tent
from tests.scenes import LEFT_CLAMP, SHAPE_FUNCTIONS
from validation.measures.orders import observed_order

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # bodies are moved on purpose

INF = np.inf
EVERY = pytest.mark.parametrize("shape_function", SHAPE_FUNCTIONS, ids=lambda f: f.__name__)
LENGTH, WIDTH, E = 8.0, 4.0, 100.0
ROLLERS = (
    Support(Rectangle((-INF, -INF), (0, INF)), (True, False)),
    Support(Rectangle((-INF, -INF), (INF, 0)), (False, True)),
)
PLATE = Difference(Rectangle((0, 0), (12, 8)), Circle((6.3, 4.1), 2.2))


def bar(length: float, load: Load) -> Body:
    return Body(Rectangle((0, 0), (length, WIDTH)), ROLLERS, (load,), Material(E, 0.3))


@EVERY
def test_water_behind_a_wall(shape_function: ShapeFunction) -> None:
    """A pressure that grows with depth: resultant and moment of the triangle, by a function of either kind."""
    wall = Rectangle((8, 0), (8, WIDTH))
    water = bar(8, Pressure(wall, lambda x: WIDTH - x[:, 1]))
    pushed = bar(8, Traction(wall, lambda x: np.column_stack([x[:, 1] - WIDTH, 0 * x[:, 1]])))
    of_water, of_push = (discretise(body, 1.0, shape_function=shape_function) for body in (water, pushed))
    force = of_water.f_ext.reshape(-1, 2)
    np.testing.assert_allclose(of_push.f_ext, of_water.f_ext, atol=1e-13)
    assert force.sum(axis=0) == pytest.approx([-(WIDTH**2) / 2, 0], abs=1e-12)
    nodes = of_water.grid.node_positions(of_water.transfer.nodes)
    assert nodes[:, 1] @ force[:, 0] == pytest.approx(-(WIDTH**3) / 6, rel=1e-12)


def pulled(shape_function: ShapeFunction, shift: float, ppc: int = 2) -> Array:
    """Stresses (p, 3) of a bar whose end lies `shift` beyond a line of the grid, under a traction of 1."""
    length = LENGTH + shift
    body = bar(length, Traction(Rectangle((length, 0), (length, WIDTH)), (1.0, 0.0)))
    n = round(LENGTH * ppc * (1.25 if shift else 1))
    points = seed(body.domain, (length / n, 1 / ppc))
    model = discretise(
        body, shape_function=shape_function, points=points, grid=Grid((-3.0, -3.0), (1.0, 1.0), (15, 10))
    )
    state = equilibrium(model, np.full(len(points.x), E))
    assert model.f_ext.reshape(-1, 2).sum(axis=0) == pytest.approx([WIDTH, 0], abs=1e-13)
    return model.stress(state.moduli, state.strain)


@pytest.mark.parametrize(("shape_function", "shift"), [(tent, 0.0), (gimp, 0.0), (gimp, 0.3), (gimp, 1e-3)])
def test_a_pulled_bar_has_uniform_stress(shape_function: ShapeFunction, shift: float) -> None:
    """To rounding, wherever the edge lies: GIMP integrates gradients of tents exactly, and so do points of tents whose
    rectangles fill the cells."""
    stress = pulled(shape_function, shift)
    np.testing.assert_allclose(stress, np.tile([1, 0, 0], (len(stress), 1)), atol=1e-10)


@pytest.mark.parametrize(("shape_function", "most"), [(bspline2, 0.03), (bspline3, 0.03)])
def test_a_bar_of_splines_to_quadrature(shape_function: ShapeFunction, most: float) -> None:
    """The load is integrated exactly, the stiffness by the points: 3 % at two per cell and direction, and with the
    square of their spacing, as the midpoint rule."""
    error = [np.abs(pulled(shape_function, 0.0, ppc) - [1, 0, 0]).max() for ppc in (2, 4, 8)]
    assert error[0] < most
    assert observed_order(error[1], error[2]) > 1.8


@EVERY
@pytest.mark.parametrize("inside", [False, True])
def test_statics_on_stairs(shape_function: ShapeFunction, inside: bool) -> None:
    """A hole that no cell follows: forces and their moment are those of the circle, through whatever functions."""
    load = Pressure(Circle((6.3, 4.1), 2.2), 2.0) if inside else Traction(Circle((6.3, 4.1), 2.2), (0.3, -1.0))
    body = Body(PLATE, (LEFT_CLAMP,), (load,))
    model = discretise(body, 1.0, 2, shape_function)
    f, x = model.f_ext.reshape(-1, 2), model.grid.node_positions(model.transfer.nodes) - [6.3, 4.1]
    force = np.zeros(2) if inside else np.pi * 4.4 * np.array([0.3, -1.0])
    atol = 1e-12 * np.abs(f).sum() * 10  # arms of up to ten
    np.testing.assert_allclose(f.sum(axis=0), force, atol=atol)
    assert np.sum(x[:, 0] * f[:, 1] - x[:, 1] * f[:, 0]) == pytest.approx(0, abs=atol)
    if inside:  # the virial of a pressure in a hole: p times twice its area
        assert np.sum(x * f) == pytest.approx(2.0 * 2 * np.pi * 2.2**2, rel=1e-9)


@EVERY
def test_body_force_is_by_volume(shape_function: ShapeFunction) -> None:
    """A function of position over a region: its sum over the points, and its moment."""
    body = bar(LENGTH, BodyForce(lambda x: np.stack([x[:, 1], -x[:, 0]], axis=1), Rectangle((2, 0), (8, 4))))
    model = discretise(body, 1.0, 2, shape_function)
    points = model.points
    inside = points.x[:, 0] > 2
    f = model.f_ext.reshape(-1, 2)
    expected = (points.volume[:, None] * np.stack([points.x[:, 1], -points.x[:, 0]], axis=1))[inside].sum(axis=0)
    np.testing.assert_allclose(f.sum(axis=0), expected, rtol=1e-13)


def column(load: Load, shape_function: ShapeFunction, ghost: float = 0.0) -> tuple[Model, Array]:
    """A column of height 8 on its foot, nu = 0, and its stresses at density one."""
    foot = Support(Rectangle((-INF, -INF), (INF, 0)), (False, True))
    side = Support(Rectangle((-INF, -INF), (0, INF)), (True, False))
    body = Body(Rectangle((0, 0), (2, 8)), (foot, side), (load,), Material(E, 0.0))
    model = discretise(body, 1.0, 2, shape_function, ghost=ghost)
    state = equilibrium(model, np.full(len(model.points.x), E), f_ext=model.force(np.ones(len(model.points.x))))
    return model, model.stress(state.moduli, state.strain)


@pytest.mark.parametrize("shape_function", [tent, gimp])
@pytest.mark.parametrize("load", [Weight((0.0, -3.0)), BodyForce((0.0, -3.0))], ids=["weight", "body force"])
def test_a_solid_column_carries_its_weight(load: Load, shape_function: ShapeFunction) -> None:
    """In every cell the weight above its centre: what is constant in a cell cannot be nearer to a linear stress."""
    model, stress = column(load, shape_function)
    centre = np.floor(model.points.x[:, 1]) + 0.5
    np.testing.assert_allclose(stress[:, 1], -3.0 * (8 - centre), rtol=1e-10)
    np.testing.assert_allclose(stress[:, [0, 2]], 0, atol=1e-10)


def complex_compliance(model: Model, design: Design, rho: Any, criterion: Compliance | PNormStress) -> Any:
    """The objective by dense algebra that takes complex densities, from the model's map of K and its loads."""
    K, n = model.stiffness, len(model.stiffness.dof)
    moduli = model.body.material.young * simp(rho, design.penal, design.contrast)[0]
    entries, dense = K.data_map @ moduli, np.zeros((n, n), complex)
    dense[K.row, K.col] = entries
    dense[K.col, K.row] = entries
    f = model.f_ext + model.forces.weight @ rho
    u = np.zeros(len(f), complex)
    u[K.dof] = np.linalg.solve(dense, f[K.dof])
    if isinstance(criterion, Compliance):
        return f @ u
    xx, yy, xy = (model.body.material.young * ((model.transfer.B @ u).reshape(-1, 3) @ model.D)).T
    vm = np.sqrt(xx**2 - xx * yy + yy**2 + 3 * xy**2)
    return np.sum((rho**criterion.q * vm) ** criterion.p) ** (1 / criterion.p)


@EVERY
@pytest.mark.parametrize("criterion", [Compliance(), PNormStress(6, measure="von_mises_in_plane")], ids=["C", "stress"])
def test_the_gradient_of_weight(shape_function: ShapeFunction, criterion: Compliance | PNormStress) -> None:
    """Against complex steps through dense algebra, with a load that stays and one that follows the density."""
    body = Body(
        Rectangle((0, 0), (6, 3)),
        (LEFT_CLAMP,),
        (Weight((0.1, -0.5)), Weight(lambda x: x / 10, Rectangle((3, 0), (6, 3))), PointLoad((6, 1.5), (0.0, -1.0))),
    )
    ghost = 0.01 if shape_function in (tent, gimp) else 0.0
    points = discretise(body, 1.0, 2, shape_function).points.moved((0.3, 0.0))
    model = discretise(body, 1.0, shape_function=shape_function, points=points, ghost=ghost)
    design = Design(0.5, 1.0, contrast=1e-3)
    problem = DesignProblem(model, design, criterion)
    rho = np.random.default_rng(0).uniform(0.2, 1, len(points.x))
    at = problem.analyse(rho)
    assert at.objective == pytest.approx(complex_compliance(model, design, rho, criterion).real, rel=1e-10)
    gradient = problem.density_gradient(at)
    for p in (0, 17, 40, len(rho) - 1):
        stepped = complex_compliance(model, design, rho + 1e-30j * (np.arange(len(rho)) == p), criterion)
        assert gradient[p] == pytest.approx(stepped.imag / 1e-30, rel=1e-8, abs=1e-10 * np.abs(gradient).max())


def test_a_weight_is_part_of_the_fingerprint_and_of_the_plan() -> None:
    def problem(*loads: Load) -> DesignProblem:
        return DesignProblem(discretise(Body(Rectangle((0, 0), (6, 3)), (LEFT_CLAMP,), loads), 1.0), Design(0.5, 1.5))

    pull = PointLoad((6, 1.5), (0.0, -1.0))
    problems = [problem(pull), problem(pull, Weight((0, -1))), problem(pull, Weight((0, -2)))]
    problems.append(problem(pull, BodyForce((0, -1))))
    assert len({p.fingerprint for p in problems}) == 4
    assert problems[1].fingerprint == problem(pull, Weight((0, -1))).fingerprint
    assert "6 forces carried by points\n" in plan(problems[0])
    assert "1 by volume, of which some follow the density" in plan(problems[1])


def test_weight_needs_densities() -> None:
    model = column(Weight((0.0, -3.0)), tent)[0]
    with pytest.raises(InvalidScene, match="by density"):
        equilibrium(model, np.ones(len(model.points.x)))


EDGE = Rectangle((8, 0), (8, 4))
NO_PAIR: Any = (1.0,)
NO_REGION: Any = (8, 4)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Traction(NO_REGION, (1, 0)), "region of a traction"),
        (lambda: Traction(EDGE, NO_PAIR), "traction .* two finite numbers"),
        (lambda: discretise(bar(8, Traction(EDGE, lambda x: x[:, 0])), 1.0), "traction by a function gave"),
        (lambda: discretise(bar(8, Pressure(EDGE, lambda x: x)), 1.0), "pressure by a function gave"),
        (lambda: discretise(bar(8, Pressure(EDGE, lambda x: np.inf * x[:, 0])), 1.0), "return finite numbers"),
        (lambda: Traction(EDGE, (np.nan, 0)), "two finite numbers"),
        (lambda: Pressure(EDGE, np.inf), "pressure inf: give a finite number"),
        (lambda: Pressure(EDGE, "high"), "give a finite number"),  # type: ignore[arg-type]
        (lambda: Pressure(NO_REGION, 1.0), "region of a pressure"),
        (lambda: BodyForce((0, np.inf)), "body force .* two finite numbers"),
        (lambda: BodyForce((0, -1), NO_REGION), "region of a body force"),
        (lambda: Weight(NO_PAIR), "weight .* two finite numbers"),
    ],
)
def test_bad_input_is_named(make: Any, words: str) -> None:
    with pytest.raises(InvalidScene, match=words):
        make()


@pytest.mark.parametrize(
    ("load", "words"),
    [
        (Traction(Rectangle((3, 1), (4, 2)), (1, 0)), "no boundary of the domain"),
        (Pressure(Circle((20, 4), 1), 1.0), "no boundary of the domain"),
        (BodyForce((0, -1), Rectangle((9, 0), (12, 4))), "holds no material"),
        (BodyForce(lambda x: x[:, 0]), "return finite numbers"),
        (Traction(Rectangle((0, 0), (0, 4)), (1, 0)), "do no work"),
        (Weight((0.0, 0.0)), "do no work"),
    ],
)
def test_misplaced_loads_are_named(load: Load, words: str) -> None:
    with pytest.raises(InvalidScene, match=words):
        discretise(Body(Rectangle((0, 0), (8, 4)), (LEFT_CLAMP,), (load,)), 1.0)


def test_points_that_left_the_outline_are_named() -> None:
    body = bar(LENGTH, Traction(EDGE, (1, 0)))
    points = seed(Rectangle((0, 0), (5, 4)), (0.5, 0.5))
    with pytest.raises(LoadOutsideBody, match="of the outline: no material point within"):
        discretise(body, 1.0, points=points)


PASSIVE: tuple[tuple[Load, Region], ...] = (
    (Traction(EDGE, (1, 0)), Rectangle((6, 2), (8, 4))),
    (BodyForce((0, -1)), Rectangle((6, 2), (8, 4))),
)


@pytest.mark.parametrize(("load", "void"), PASSIVE)
def test_void_that_would_carry_a_load_is_named(load: Load, void: Region) -> None:
    model = discretise(Body(Rectangle((0, 0), (8, 4)), (LEFT_CLAMP,), (load,)), 1.0)
    with pytest.raises(LoadOutsideBody, match="passive void would carry"):
        DesignProblem(model, Design(0.5, 1.5, passive_void=void))
