"""Load steps: Newton's order, symmetry, rotation, the limit of small loads, and bad input by name."""

from dataclasses import replace
from functools import partial
from itertools import islice

import numpy as np
import pytest

from mpmtop.body import Body, EdgeSupport, Material, Spring, Support
from mpmtop.equilibrium import equilibrium
from mpmtop.errors import InvalidScene, LoadOutsideBody, NotConverged, PointOutsideGrid, UnsupportedBody
from mpmtop.grid import Grid
from mpmtop.large_deformation.kinematics import WIDEST
from mpmtop.large_deformation.law import Hencky, NeoHookean, jacobian, stress, tangent
from mpmtop.large_deformation.model import discretise
from mpmtop.large_deformation.newton import Failure, Problem, newton
from mpmtop.large_deformation.objectives import EndCompliance
from mpmtop.large_deformation.step import moved, operators, start
from mpmtop.large_deformation.steps import load_steps, trajectory
from mpmtop.loads import PositionLoad, RegionLoad, Traction, Weight
from mpmtop.model import discretise as discretise_small
from mpmtop.points import seed
from mpmtop.region import Rectangle
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3, gimp, tent
from tests.mpmtop.large_deformation.cases import INF, METHODS, ample, cantilever, model, moduli
from validation.bodies.large import beam, points_of
from validation.measures.derivatives import central_difference

EVERY = pytest.mark.parametrize("method", METHODS)
BOX = Grid((-8.0, -20.0), (2.0, 2.0), (20, 23))


@EVERY
def test_tangent_is_the_derivative_of_the_residual_and_symmetric(method: str) -> None:
    body = model(METHODS[method], steps=2)
    state = trajectory(body, moduli()).states[1]
    ops = operators(body, state)
    problem = Problem(body, ops, state.F, moduli(), 1.0, 1e-11)
    rng = np.random.default_rng(0)
    q, dq = rng.standard_normal((2, ops.assembly.pattern.m)) * 0.05
    trial, stepped = problem.trial(q), problem.trial(q + 1e-30j * dq)
    assert trial is not None and stepped is not None
    K = ops.assembly.full(problem.tangent(tangent(body.law, trial.F)[1]))
    np.testing.assert_allclose(K @ dq, stepped.R.imag / 1e-30, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(
        K @ ops.assembly.factor(problem.tangent(tangent(body.law, trial.F)[1]))(dq), dq, atol=1e-9
    )
    slope = central_difference(lambda q: problem.energy(problem.trial(q)), q, dq, 1e-5)  # type: ignore[arg-type]
    assert slope == pytest.approx(trial.R @ dq, rel=1e-6)


def test_newton_is_quadratic() -> None:
    """AMPLE's beam: |R| of each step is at most 30 |R|^2 of the one before, once below 3e-4 and down to rounding."""
    beam = ample(gimp)
    for _, increment in islice(load_steps(beam, np.full(640, beam.young)), 4):
        r = np.array(increment.residuals)
        last = np.flatnonzero(r[:-1] < 3e-4)
        assert len(last) >= 1
        assert np.all(r[last + 1] < np.maximum(30 * r[last] ** 2, 1e-12))


def test_linearised_stresses_bend_a_beam_in_few_newton_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """To 80 % of its length in ten steps: six at most, where Newton's own tangent takes half as many again; the answer
    is the same."""
    bent = points_of(beam(10.0, 0.2, 10.0, 0.5), 0.5, 2, 10, "total Lagrange")
    few = trajectory(bent, np.ones(len(bent.points.x)))
    monkeypatch.setattr("mpmtop.large_deformation.newton._change", lambda F, A, dF, S: stress_change(bent.law, F, dF))
    many = trajectory(bent, np.ones(len(bent.points.x)))
    assert max(few.newton_steps) <= 6 and max(many.newton_steps) >= 9
    np.testing.assert_allclose(few.states[-1].x, many.states[-1].x, atol=1e-8)


def stress_change(law: Hencky, F: np.ndarray, dF: np.ndarray) -> np.ndarray:
    """Of the second Piola-Kirchhoff stress, what the displacements say."""
    after, before = (np.linalg.solve(at, stress(law, at)) for at in (F + dF, F))
    return after - before


def test_assemblies_that_are_not_remembered_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    remembers, forgets = (model(METHODS["GIMP"], steps=3) for _ in range(2))
    there = trajectory(remembers, moduli())
    monkeypatch.setattr("mpmtop.large_deformation.model.REMEMBERED", 0)
    here = trajectory(forgets, moduli())
    np.testing.assert_array_equal(here.states[-1].x, there.states[-1].x)
    assert len(remembers._recent) == 3 and len(forgets._recent) == 1


@EVERY
def test_indefinite_tangents_are_solved(method: str) -> None:
    """Past a limit point no Cholesky factorisation exists: a tangent less half of its diagonal."""
    body = model(METHODS[method], steps=2)
    ops = operators(body, start(body))
    problem = Problem(body, ops, start(body).F, moduli(), 1.0, 1e-11)
    lower = problem.tangent(tangent(body.law, start(body).F)[1])
    lower = np.where(ops.assembly.pattern.row == ops.assembly.pattern.col, lower / 2, lower)
    K = ops.assembly.full(lower)
    assert np.linalg.eigvalsh(K.toarray()).min() < 0
    b = np.random.default_rng(0).standard_normal(len(K.indptr) - 1)
    np.testing.assert_allclose(K @ ops.assembly.factor(lower)(b), b, atol=1e-9)


@EVERY
def test_a_small_tangent_is_factored_whole_with_the_same_answer(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    body = model(METHODS[method], steps=2)
    whole = trajectory(body, moduli()).states[-1].x
    monkeypatch.setattr("mpmtop.large_deformation.assembly.DENSE", 0)
    np.testing.assert_allclose(trajectory(body, moduli()).states[-1].x, whole, rtol=0, atol=1e-11)


@pytest.mark.parametrize("domains", ["fixed", "stretched"])
@pytest.mark.parametrize("shape_function", [tent, gimp, bspline2], ids=lambda s: s.__name__)
def test_rotation_by_90_degrees_leaves_no_stress(shape_function: ShapeFunction, domains: str) -> None:
    """Ten increments of 9 degrees, as nodal displacements; the half-lengths stay by either rule, though a domain of
    unequal sides would have to change them over: U knows no rotation."""
    if domains == "stretched" and shape_function is not gimp:
        return
    box = Grid((-30, -30), (2, 1), (40, 80))
    body = discretise(cantilever(), shape_function=shape_function, domains=domains, grid=box)  # type: ignore[arg-type]
    a = np.pi / 20
    turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    nodes = body.grid.node_positions()
    state = start(body)
    for _ in range(10):
        ops = operators(body, state)
        u = nodes @ (turn - np.eye(2)).T
        state = moved(body, state, ops.at_points(u), state.F + ops.gradient(u))
    np.testing.assert_allclose(state.x, body.points.x[:, ::-1] * [-1, 1], atol=1e-12)
    for law in (Hencky(0.3), NeoHookean(0.3)):
        assert np.abs(stress(law, state.F)).max() < 1e-12
    np.testing.assert_allclose(state.half_length, body.points.half_length, rtol=1e-12)


@pytest.mark.parametrize("method", ["total", "tent", "GIMP, free"])
def test_small_loads_are_those_of_linear_elasticity(method: str) -> None:
    """The compliance of a load of 1e-6 of the usual is that of `mpmtop.equilibrium`, to the order of the strain."""
    body = model(METHODS[method] | {"alpha": 0.0}, load=6e-8, steps=1)
    path = trajectory(body, moduli())
    scene = cantilever(6e-8)
    small = discretise_small(scene, 2.0, 2, METHODS[method]["shape_function"])
    linear = float(small.f_ext @ equilibrium(small, moduli()).u)
    assert EndCompliance().value(body, path, moduli()) == pytest.approx(linear, rel=1e-5)


def test_clamped_spline_is_zero_at_the_clamp_and_near_gimp() -> None:
    body = model(METHODS["bspline2"], load=6e-8, steps=1)
    found = trajectory(body, moduli())
    u = found.increments[0].u.reshape(*body.grid.nodes, 2)
    clamp = 4  # the line x = 0 of the box from -8
    assert np.abs(u[clamp - 1] + 6 * u[clamp] + u[clamp + 1]).max() == 0
    compliance = EndCompliance().value(body, found, moduli())
    other = model(METHODS["GIMP"], load=6e-8, steps=1)
    assert compliance == pytest.approx(EndCompliance().value(other, trajectory(other, moduli()), moduli()), rel=0.08)


def test_background_changes_little() -> None:
    """By 0.14 % at alpha = 1e-5 in designs; here, in a solid body, by less."""
    with_it, without = (model(METHODS[m]) for m in ("GIMP", "GIMP, free"))
    J = [EndCompliance().value(m, trajectory(m, moduli()), moduli()) for m in (with_it, without)]
    assert 0 < 1 - J[0] / J[1] < 2e-3


def test_where_newton_fails_a_descent_finds_the_branch_of_small_steps() -> None:
    """One step of a load that turns the tip down: full Newton steps invert points. In the total frame the answer does
    not depend on the steps."""
    body = model(METHODS["total"], load=1.2, steps=1)
    ops = operators(body, start(body))
    problem = partial(Problem, body, ops, start(body).F, np.ones(200), tol=1e-11)
    q = np.zeros(ops.assembly.pattern.m)
    with pytest.raises(Failure, match="a point inverts"):
        newton(problem(level=1.0), q, descent=False, polish=0)
    path, steps = trajectory(body, np.ones(200)), trajectory(replace(body, steps=16), np.ones(200))
    assert path.parts == (1,)
    np.testing.assert_allclose(path.states[-1].x, steps.states[-1].x, atol=1e-8)


def test_load_in_parts_is_the_same_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    """With few Newton steps allowed, the load has to be cut; the weights stay, and so does the answer."""
    body = model(METHODS["GIMP"], steps=4)
    whole = trajectory(body, moduli())
    monkeypatch.setattr("mpmtop.large_deformation.newton.MAX_NEWTON", 3)
    monkeypatch.setattr("mpmtop.large_deformation.newton.MAX_DESCENT", 3)
    parts = trajectory(body, moduli())
    assert whole.parts == (1,) * 4 and max(parts.parts) > 1
    np.testing.assert_allclose(parts.states[-1].x, whole.states[-1].x, atol=1e-8)


@pytest.mark.parametrize(
    "of", [lambda E: E.astype(int), lambda E: E.astype(np.float32), list], ids=["int", "32", "list"]
)
def test_moduli_of_any_type_are_numbers(of) -> None:  # type: ignore[no-untyped-def]
    """Whole ones must not make whole positions."""
    body = model(METHODS["GIMP"], steps=2)
    expected = trajectory(body, np.ones(200)).states[-1].x
    np.testing.assert_array_equal(trajectory(body, of(np.ones(200))).states[-1].x, expected)
    for state, _ in islice(load_steps(body, of(np.ones(200))), 1, None):
        np.testing.assert_array_equal(state.x, expected)


def test_steps_one_by_one_are_the_trajectory() -> None:
    body = model(METHODS["GIMP"], steps=3)
    path = trajectory(body, moduli())
    for (state, _), expected in zip(load_steps(body, moduli()), path.states[1:], strict=True):
        np.testing.assert_array_equal(state.x, expected.x)
    assert path.clipped == (0, 0, 0)


def test_domains_wider_than_a_cell_are_clipped_and_counted() -> None:
    """Domains of 0.94 of a cell, on points pulled by 0.06 E along x."""
    scene = replace(cantilever(), loads=(RegionLoad(Rectangle((19, 0), (20, 10)), (0.6, 0.0)),))
    points = seed(scene.domain, (1.0, 1.0))
    points = replace(points, half_length=np.full_like(points.x, 0.94))
    path = trajectory(discretise(scene, 2.0, domains="stretched", steps=4, points=points), np.ones(200))
    last = path.states[-1]
    assert 50 < path.clipped[-1] < 200
    assert path.clipped[-1] == np.count_nonzero(np.any(last.half_length == WIDEST * 2.0, axis=1))
    assert last.half_length.max() == WIDEST * 2.0


def hanging(**change: object) -> Body:
    return replace(cantilever(), **change)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("make", "error", "match"),
    [
        (partial(discretise, hanging(material=Material(1, 0.3, "stress")), 2.0), InvalidScene, "plane stress"),
        (partial(discretise, cantilever(), 2.0, 2, bspline3), InvalidScene, "bspline3"),
        (partial(discretise, cantilever(), 2.0, steps=0), InvalidScene, "load steps"),
        (partial(discretise, cantilever(), 2.0, frame="Euler"), InvalidScene, "frame"),
        (partial(discretise, cantilever(), 2.0, domains="round"), InvalidScene, "domains"),
        (partial(discretise, cantilever(), 2.0, 2, tent, domains="stretched"), InvalidScene, "only GIMP"),
        (partial(discretise, cantilever(), 2.0, alpha=-1), InvalidScene, "alpha"),
        (partial(discretise, cantilever(), 2.0, law=Hencky(0.2)), InvalidScene, "Poisson"),
        (partial(discretise, cantilever(0.0), 2.0), LoadOutsideBody, "zero"),
        (partial(discretise, cantilever(), 2.0, 0), ValueError, "points per cell"),
        (partial(discretise, cantilever()), InvalidScene, "size h or a `grid`"),
        (partial(discretise, cantilever(), 2.0, grid=BOX), InvalidScene, "size h or a `grid`"),
        (
            partial(discretise, cantilever(), 2.0, 2, points=seed(cantilever().domain, (1.0, 1.0))),
            InvalidScene,
            "2 points per cell beside `points`",
        ),
        (
            partial(discretise, hanging(loads=(PositionLoad((20, 5), (0, -1)),)), 2.0),
            InvalidScene,
            "only points carry loads",
        ),
        (partial(discretise, hanging(loads=(Weight((0, -1)),)), 2.0), InvalidScene, "of small strain"),
        (
            partial(
                discretise, hanging(loads=(*cantilever().loads, Traction(Rectangle((0, 10), (20, 10)), (0, -1)))), 2.0
            ),
            InvalidScene,
            "of small strain",
        ),
        (
            partial(discretise, hanging(supports=(*cantilever().supports, Spring((20, 5), 1.0, (0, 1)))), 2.0),
            InvalidScene,
            "prescribed displacements",
        ),
        (
            partial(
                discretise, hanging(supports=(EdgeSupport(Rectangle((0, 10), (20, 10))), *cantilever().supports)), 2.0
            ),
            InvalidScene,
            "prescribed displacements",
        ),
        (
            partial(
                discretise,
                hanging(supports=(Support(Rectangle((-np.inf, -np.inf), (0.0, np.inf)), (True, True), (1.0, 0.0)),)),
                2.0,
            ),
            InvalidScene,
            "prescribed displacements",
        ),
        (
            partial(discretise, hanging(supports=(Support(Rectangle((500, 0), (501, 1))),)), 2.0),
            UnsupportedBody,
            "holds no node",
        ),
        (partial(trajectory, model(METHODS["GIMP"]), np.ones(3)), ValueError, "one for each"),
        (partial(trajectory, model(METHODS["GIMP"]), np.full(200, np.nan)), ValueError, "finite"),
        (
            partial(trajectory, model(METHODS["GIMP"], load=5.0), np.ones(200)),
            PointOutsideGrid,
            "load step . of 8.*box",
        ),
    ],
)
def test_bad_input_is_named(make: partial, error: type, match: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(error, match=match):
        make()


def test_load_on_void_is_named() -> None:
    body = model(METHODS["GIMP"])
    E = np.where(np.any(body.force != 0, axis=1), 1e-9, 1.0)
    with pytest.raises(LoadOutsideBody, match=r"8 of the 8 points.*passive_solid"):
        trajectory(body, E)


def test_body_that_nothing_holds_is_named() -> None:
    scene = hanging(supports=(Support(Rectangle((-INF, -INF), (0, INF)), (True, False)),))
    body = discretise(scene, 2.0, alpha=0.0)
    with pytest.raises(NotConverged, match="load step 1 of 8"):
        trajectory(body, np.ones(200))


def test_everything_held_is_named() -> None:
    body = discretise(hanging(supports=(Support(Rectangle((-INF, -INF), (INF, INF))),)), 2.0, alpha=0.0)
    with pytest.raises(UnsupportedBody, match="every node"):
        trajectory(body, np.ones(200))


def test_points_keep_their_orientation() -> None:
    path = trajectory(model(METHODS["GIMP"], load=0.3), moduli())
    assert all(np.all(jacobian(s.F) > 0) for s in path.states)
