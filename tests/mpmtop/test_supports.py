"""Displaced supports, springs, and edges that no line of the grid follows: exact answers and derivatives."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.at_points import fields_at_points
from mpmtop.body import Bed, Body, EdgeSupport, Material, Spring, Support
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.design import Design
from mpmtop.equilibrium import equilibrium
from mpmtop.errors import InvalidScene, LoadOutsideBody, UnsupportedBody
from mpmtop.grid import Grid
from mpmtop.loads import PointLoad, PositionLoad, Pressure, Traction
from mpmtop.material import simp
from mpmtop.model import Model, discretise
from mpmtop.planning import plan
from mpmtop.points import MaterialPoints, seed
from mpmtop.problem import DesignProblem
from mpmtop.region import Circle, HalfPlane, Polygon, Rectangle
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3, gimp, tent
from tests.scenes import LEFT_CLAMP, SHAPE_FUNCTIONS

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # bodies are moved on purpose

INF = np.inf
EVERY = pytest.mark.parametrize("shape_function", SHAPE_FUNCTIONS, ids=lambda f: f.__name__)
LEFT, RIGHT, BOTTOM = (
    Rectangle((-INF, -INF), (0, INF)),
    Rectangle((8, -INF), (INF, INF)),
    Rectangle((-INF, -INF), (INF, 0)),
)
BOX = Rectangle((0, 0), (8, 4))
E, NU, DELTA = 100.0, 0.3, 0.01
DESIGN = Design(0.5, 1.5)


@EVERY
@pytest.mark.parametrize("ghost", [0.0, 0.01])
def test_a_tensile_test(shape_function: ShapeFunction, ghost: float) -> None:
    """Stress E / (1 - nu^2) delta / L throughout and the reaction that times W, without any load."""
    if ghost and shape_function in (bspline2, bspline3):
        return
    grips = Support(LEFT, (True, False)), Support(BOTTOM, (False, True)), Support(RIGHT, (True, False), (DELTA, 0.0))
    model = discretise(Body(BOX, grips, (), Material(E, NU)), 1.0, 2, shape_function, ghost=ghost)
    state = equilibrium(model, np.full(len(model.points.x), E))
    exact = E / (1 - NU**2) * DELTA / 8
    stress = model.stress(state.moduli, state.strain)
    np.testing.assert_allclose(stress, np.tile([exact, 0, 0], (len(stress), 1)), rtol=0, atol=1e-8 * exact)
    at = fields_at_points(model, state, np.ones(len(stress)))
    right = at.layout.nodes[:, 0] > 8 - 1e-9
    assert at.reaction[right, 0].sum() == pytest.approx(exact * 4, rel=1e-8)
    np.testing.assert_allclose(at.reaction.sum(axis=0), 0, atol=1e-10 * exact)
    # minus the work of the grips
    assert DesignProblem(model, Design(1.0, 1.5)).analyse(np.ones(len(stress))).objective == pytest.approx(
        -exact * 4 * DELTA, rel=1e-8
    )


def turned(degrees: float) -> Array:
    t = np.radians(degrees)
    return np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]])


def every_tie(shape_function: ShapeFunction) -> Model:
    """A body on a held oblique edge, a spring, a bed and a displaced support, under a load."""
    low = Polygon(((0, 0), (7, 0.8), (7, 3.3), (0, 3.3)))
    supports = (
        EdgeSupport(HalfPlane((0, 0.01), (-0.8 / 7, 1)), "normal"),
        Spring((6.5, 2.9), 0.3, (1, 2)),
        Bed(Rectangle((2, 3.3), (4.2, 3.3)), 0.2),
        Support(Rectangle((-1, 2.9), (0.1, 3.1)), (True, False), (0.2, 0.0)),
    )
    body = Body(low, supports, (Traction(Rectangle((7, 0), (7, 4)), (0.3, -0.1)),))
    points = seed(Rectangle((0, 0), (7, 3.5)), (0.5, 0.5))
    kept = low.contains(points.x)
    points = MaterialPoints(points.x[kept], points.volume[kept], points.half_length[kept])
    return discretise(
        body, 1.0, shape_function=shape_function, points=points, ghost=0.01 if shape_function in (tent, gimp) else 0.0
    )


def complex_objective(model: Model, design: Design, rho: Any, criterion: Compliance | PNormStress) -> Any:
    """The objective by dense algebra that takes complex densities: K column by column from the model's resistance."""
    moduli = simp(rho, design.penal, design.contrast)[0]
    n = len(model.f_ext)
    K = np.stack([model.resistance(moduli, unit) for unit in np.eye(n)], axis=1)
    g, free = model.prescribed, model.stiffness.dof
    assert g is not None
    u = g.astype(complex)
    u[free] = np.linalg.solve(K[np.ix_(free, free)], (model.f_ext - K @ g)[free])
    if isinstance(criterion, Compliance):
        return 2 * model.f_ext @ u - u @ K @ u
    xx, yy, xy = ((model.transfer.B @ u).reshape(-1, 3) @ model.D).T
    vm = np.sqrt(xx**2 - xx * yy + yy**2 + 3 * xy**2)
    return np.sum((rho**criterion.q * vm) ** criterion.p) ** (1 / criterion.p)


@EVERY
@pytest.mark.parametrize("criterion", [Compliance(), PNormStress(6, measure="von_mises_in_plane")], ids=["C", "stress"])
def test_gradients(shape_function: ShapeFunction, criterion: Compliance | PNormStress) -> None:
    """Of edges, springs and displacements, against complex steps."""
    model = every_tie(shape_function)
    design = Design(0.5, 1.0, contrast=1e-3)
    problem = DesignProblem(model, design, criterion)
    rho = np.random.default_rng(0).uniform(0.2, 1, len(model.points.x))
    at = problem.analyse(rho)
    assert at.objective == pytest.approx(complex_objective(model, design, rho, criterion).real, rel=1e-9)
    gradient = problem.density_gradient(at)
    for p in (0, 11, 40, len(rho) - 1):
        stepped = complex_objective(model, design, rho + 1e-30j * (np.arange(len(rho)) == p), criterion)
        assert gradient[p] == pytest.approx(stepped.imag / 1e-30, rel=1e-8, abs=1e-9 * np.abs(gradient).max())


@EVERY
def test_stiffness_is_that_of_the_resistance(shape_function: ShapeFunction) -> None:
    """The assembled map and the constant part against K u, and no energy below zero."""
    model = every_tie(shape_function)
    K, n = model.stiffness, len(model.f_ext)
    moduli = np.random.default_rng(1).uniform(0.5, 1, len(model.points.x))
    full = np.stack([model.resistance(moduli, unit) for unit in np.eye(n)], axis=1)[np.ix_(K.dof, K.dof)]
    lower = np.zeros_like(full)
    lower[K.row, K.col] = K.data(moduli)
    np.testing.assert_allclose(lower, np.tril(full), rtol=0, atol=1e-13 * np.abs(full).max())
    np.testing.assert_allclose(full, full.T, rtol=0, atol=1e-13 * np.abs(full).max())
    assert np.linalg.eigvalsh(full)[0] > 0


def clamped_bar(shape_function: ShapeFunction, s: float, ppc: int = 2) -> float:
    """f.u over F^2 L / (E W) of a bar whose clamped end lies s beyond a line of the grid; nu = 0."""
    pull = Traction(Rectangle((8, 0), (8, 4)), (0.25, 0))
    body = Body(BOX, (EdgeSupport(Rectangle((0, 0), (0, 4))),), (pull,), Material(1, 0))
    ghost = 0.01 if shape_function in (tent, gimp) else 0.0
    grid = Grid((-3.0 + s, -3.0), (1.0, 1.0), (15, 10))
    points = seed(BOX, (1 / ppc, 1 / ppc))
    model = discretise(body, shape_function=shape_function, points=points, grid=grid, ghost=ghost)
    state = equilibrium(model, np.ones(len(points.x)))
    return float(model.f_ext @ state.u) / 2


@pytest.mark.parametrize("s", [0.0, 1e-6, 0.05, 0.25, 0.5, 0.75, 0.95])
@EVERY
def test_a_clamp_between_the_grids_lines(shape_function: ShapeFunction, s: float) -> None:
    """GIMP, whose stiffness is exact for uniform stress, to solver precision at every shift; tents to 0.1 %, and to 5 %
    where points lie on lines of the grid, which is warned of; B-splines to the quadrature of two points per cell."""
    on_lines = s in (0.25, 0.75)
    most = {tent: 0.05 if on_lines else 1e-3, gimp: 1e-6, bspline2: 5e-3, bspline3: 5e-3}[shape_function]
    assert clamped_bar(shape_function, s) == pytest.approx(1, abs=most)


@pytest.mark.parametrize(
    ("ppc", "s", "error"), [(2, 0.75, 0.044), (3, 0.5, 0.025), (4, 0.375, 0.015), (6, 0.25, 0.009)]
)
def test_tents_fill_the_cell_at_an_edge_by_whole_points(ppc: int, s: float, error: float) -> None:
    """The worst of all shifts: half a point too little in the first cell, as much too much in the last one."""
    assert clamped_bar(tent, s, ppc) - 1 == pytest.approx(error, abs=5e-4)  # the digits that are stated
    assert clamped_bar(gimp, s, ppc) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("shape_function", [tent, gimp])
@pytest.mark.parametrize("degrees", [0.0, 20.0, 45.0])
def test_an_edge_leaves_uniform_stress(shape_function: ShapeFunction, degrees: float) -> None:
    """Sliding on an edge at any angle, and pulled along it: a fitting rectangle is exact, others to quadrature."""
    R = turned(degrees)
    corners = tuple(tuple(R @ q) for q in ((0.0, 0.0), (6.0, 0.0), (6.0, 3.0), (0.0, 3.0)))
    edges = (
        EdgeSupport(HalfPlane((0, 0), tuple(R @ (0.0, 1.0))), "normal"),
        EdgeSupport(HalfPlane((0, 0), tuple(R @ (1.0, 0.0))), tuple(R @ (1.0, 0.0))),
    )
    pull = Traction(HalfPlane(tuple(R @ (6.0, 0.0)), tuple(R @ (-1.0, 0.0))), tuple(R @ (1.0, 0.0)))
    seeded = seed(Rectangle((0, 0), (6, 3)), (0.25, 0.25))
    points = MaterialPoints(seeded.x @ R.T, seeded.volume, seeded.half_length)
    body = Body(Polygon(corners), edges, (pull,), Material(1.0, 0.3))
    model = discretise(body, 1.0, shape_function=shape_function, points=points, ghost=0.01)
    state = equilibrium(model, np.ones(len(points.x)))
    xx, yy, xy = model.stress(state.moduli, state.strain).T
    rotated = R.T @ np.moveaxis(np.array([[xx, xy], [xy, yy]]), -1, 0) @ R
    error = rotated - np.array([[1.0, 0.0], [0.0, 0.0]])
    if degrees == 0:
        np.testing.assert_allclose(error, 0, atol=1e-9)
    else:
        assert np.sqrt(np.mean(error**2)) < (0.05 if shape_function is gimp else 0.15)


def test_a_spring_takes_its_share() -> None:
    """A bar in series with a spring: u = F / k at its end, and its reaction is the force."""
    free = Support(BOTTOM, (False, True))
    spring = tuple(Spring((0, y), 2.5, (-3, 0)) for y in (0.0, 1.0, 2.0, 3.0, 4.0))
    body = Body(BOX, (free, *spring), (Traction(Rectangle((8, 0), (8, 4)), (1, 0)),), Material(1e6, 0.0))
    model = discretise(body, 1.0)
    state = equilibrium(model, np.full(len(model.points.x), 1e6))
    at = fields_at_points(model, state, np.ones(len(model.points.x)))
    assert model.at(np.array([[0.0, 2.0]])).displacement(state.u)[0, 0] == pytest.approx(4 / 12.5, rel=1e-4)
    np.testing.assert_allclose(at.reaction.sum(axis=0), [-4, 0], atol=1e-9)


@pytest.mark.parametrize(("shape_function", "shift"), [(tent, 0.0), (gimp, 0.0), (gimp, 0.3)])
def test_a_column_sinks_into_its_bed(shape_function: ShapeFunction, shift: float) -> None:
    """By p / k, and by p y / E more at height y; with GIMP wherever the grid's lines run."""
    side = Support(Rectangle((-INF, -INF), (0, INF)), (True, False))
    bed = Bed(Rectangle((0, 0), (8, 0)), 0.5, "normal")
    body = Body(BOX, (side, bed), (Pressure(Rectangle((0, 4), (8, 4)), 3.0),), Material(20.0, 0.0))
    grid = Grid((-3.0, -3.0 - shift), (1.0, 1.0), (14, 11))
    model = discretise(body, shape_function=shape_function, points=seed(BOX, (0.5, 0.5)), grid=grid)
    state = equilibrium(model, np.full(len(model.points.x), 20.0))
    sunk = model.transfer.interpolate(state.u)[:, 1]
    np.testing.assert_allclose(sunk, -3.0 / 0.5 - 3.0 * model.points.x[:, 1] / 20.0, rtol=1e-10)


def test_what_was_made_for_other_ties_is_refused() -> None:
    model = every_tie(tent)
    other = replace(model.body, supports=(*model.body.supports, Spring((1, 1), 1.0, (1, 0))))
    with pytest.raises(InvalidScene, match="other springs or edges"):
        replace(model, body=other)


def test_all_of_them_are_in_the_fingerprint() -> None:
    def fingerprint(*supports: Support | EdgeSupport | Spring | Bed) -> str:
        body = Body(BOX, supports, (PointLoad((8, 2), (0, -1)),))
        return DesignProblem(discretise(body, 1.0), DESIGN).fingerprint

    held = Rectangle((0, 0), (0, 4))
    several = [
        fingerprint(LEFT_CLAMP),
        fingerprint(LEFT_CLAMP, Spring((8, 2), 1.0, (0, 1))),
        fingerprint(LEFT_CLAMP, Spring((8, 2), 2.0, (0, 1))),
        fingerprint(LEFT_CLAMP, Spring((8, 2), 2.0, (1, 1))),
        fingerprint(EdgeSupport(held)),
        fingerprint(LEFT_CLAMP, Bed(Rectangle((8, 0), (8, 4)), 1.0)),
        fingerprint(LEFT_CLAMP, Bed(Rectangle((8, 0), (8, 4)), 2.0)),
        fingerprint(EdgeSupport(held, "normal"), Spring((8, 2), 1.0, (0, 1))),
        fingerprint(replace(LEFT_CLAMP, displacement=(0.1, 0.0))),
        fingerprint(replace(LEFT_CLAMP, displacement=(0.2, 0.0))),
    ]
    assert len(set(several)) == len(several)


WRONG: Any = (1, 2, 3)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Support(LEFT, (True, False), (0.0, 0.1)), "fix what is displaced"),
        (lambda: Support(LEFT, (True, True), WRONG), "displacement of a support .* two finite numbers"),
        (lambda: EdgeSupport(WRONG), "region of an edge support"),
        (lambda: EdgeSupport(LEFT, (0.0, 0.0)), "direction of an edge support is zero"),
        (lambda: EdgeSupport(LEFT, WRONG), "direction of an edge support .* two finite numbers"),
        (lambda: Bed(WRONG, 1.0), "region of a bed"),
        (lambda: Bed(LEFT, -1.0), "stiffness -1.0 of a bed"),
        (lambda: Bed(LEFT, "1"), "stiffness of a bed"),
        (lambda: Bed(LEFT, np.nan), "stiffness of a bed nan"),
        (lambda: Bed(LEFT, 1.0, (0.0, 0.0)), "direction of a bed is zero"),
        (lambda: Bed(LEFT, 1.0, "along"), "direction of a bed .* two finite numbers"),
        (lambda: Spring((0, 0), 0.0, (1, 0)), "stiffness 0.0 of a spring"),
        (lambda: Spring((0, 0), np.inf, (1, 0)), "stiffness of a spring inf"),
        (lambda: Spring((0, 0), 1.0, (0, 0)), "direction of a spring is zero"),
        (lambda: Spring(WRONG, 1.0, (1, 0)), "position of a spring"),
        (lambda: Body(BOX, (LEFT_CLAMP, Spring((9, 0), 1.0, (1, 0)))), "outside the domain"),
    ],
)
def test_bad_input_is_named(make: Any, words: str) -> None:
    with pytest.raises(InvalidScene, match=words):
        make()


def test_what_a_model_cannot_hold_is_named() -> None:
    load = PositionLoad((8, 2), (0.0, -1.0))
    with pytest.raises(UnsupportedBody, match="no boundary of the domain"):
        discretise(Body(BOX, (LEFT_CLAMP, EdgeSupport(Circle((4, 2), 1))), (load,)), 1.0)
    with pytest.raises(UnsupportedBody, match="lies in a bed"):
        discretise(Body(BOX, (LEFT_CLAMP, Bed(Circle((4, 2), 1), 1.0)), (load,)), 1.0)
    points = seed(Rectangle((0, 0), (5, 4)), (0.5, 0.5))
    with pytest.raises(LoadOutsideBody, match="a spring acts at"):
        discretise(Body(BOX, (LEFT_CLAMP, Spring((8, 2), 1.0, (1, 0)))), 1.0, points=points)
    twice = replace(LEFT_CLAMP, displacement=(0.1, 0.0)), LEFT_CLAMP
    with pytest.raises(InvalidScene, match=r"displace the node at .* differently"):
        equilibrium(discretise(Body(BOX, twice), 1.0), np.ones(128))
    sliding = EdgeSupport(Rectangle((0, 0), (0, 4)), "normal")
    model = discretise(Body(BOX, (sliding,), (load,)), 1.0)
    with pytest.raises(UnsupportedBody, match="move without resistance"):
        equilibrium(model, np.ones(len(model.points.x)))


def test_the_plan_names_supports_that_are_no_held_nodes() -> None:
    supports = (
        Support(LEFT),
        Support(BOTTOM, (False, True), (0.0, DELTA)),
        Spring((8, 4), 1.0, (0, 1)),
        EdgeSupport(Rectangle((8, 0), (8, 2)), (1.0, 0.0)),
    )
    body = Body(BOX, supports, (Traction(Rectangle((8, 2), (8, 4)), (1.0, 0.0)),), Material(E, NU))
    (line,) = [line for line in plan(DesignProblem(discretise(body, 1.0), DESIGN)).splitlines() if "supports" in line]
    assert line.startswith("supports: 1 of prescribed displacement") and "1 along the outline" in line
    assert line.endswith("1 springs")
    bare = discretise(Body(BOX, supports[:1], body.loads, Material(E, NU)), 1.0)
    assert "supports" not in plan(DesignProblem(bare, DESIGN))
