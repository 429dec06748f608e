"""Multigrid against the direct solver, and the properties its convergence rests on."""

from functools import cache, partial

import numpy as np
import pytest

from mpmtop.equilibrium import Equilibrium, Model, discretise, equilibrium
from mpmtop.material import simp
from mpmtop.objectives import compliance, compliance_gradient
from mpmtop.optimize import MMA, optimize
from mpmtop.problem import DesignProblem
from mpmtop.region import Circle, Difference, Rectangle
from mpmtop.scene import Array, Material, NotConverged, Support, UnsupportedBody
from mpmtop.shape_functions import bspline2, bspline3, gimp
from mpmtop.solvers import BandedCholesky, Lattice, MultigridCG, Pattern, SuperLU, choose_solver, multigrid
from mpmtop.solvers.multigrid import coarsening, v_cycle
from mpmtop.solvers.stencil import Blocks, assembled, places
from tests.scenes import LEFT_CLAMP, cantilever

DEEP = partial(MultigridCG, coarsest=2_000)
"""Several levels on small bodies: the last one has 10 nodes across."""
NOTCHED = Difference(Rectangle((0, 0), (40, 20)), Rectangle((16, 8), (40, 20)))
HOLED = Difference(Rectangle((0, 0), (40, 20)), Circle((21.3, 9.2), 6.3))
BODIES: dict[str, tuple[dict, dict]] = {
    "tent": ({}, {}),
    "notch": ({"domain": NOTCHED, "loads": cantilever(40, 6).loads}, {}),
    "gimp across cells": ({}, {"shape_function": gimp, "shift": 0.3}),
    "tent with small cuts": ({"domain": HOLED}, {"shift": 0.3, "ghost": 0.01}),
    "plane stress": ({"material": Material(1.0, 0.3, plane="stress")}, {}),
    "flat cells": ({}, {"h": (1.0, 0.25)}),
    "tall cells": ({}, {"h": (0.25, 1.0)}),
    "quadratic": ({}, {"shape_function": bspline2}),
    "cubic": ({}, {"shape_function": bspline3, "shift": 0.1}),
}


def model_of(name: str, solver: object) -> Model:
    changes, how = BODIES[name]
    how = {"h": 1.0, "shift": 0.0} | how
    scene, h, shift = cantilever(40, 20, **changes), how.pop("h"), how.pop("shift")
    points = discretise(scene, h).points.moved((0.0, shift))
    return discretise(scene, h, points=points, solver=solver, **how)


@cache
def optimised() -> Array:
    """Densities (80, 40) of the small cantilever after 30 iterations: a truss, half of it void."""
    *_, last = optimize(DesignProblem(discretise(cantilever(40, 20), 1.0)), MMA(), max_iterations=30)
    return last.evaluation.rho.reshape(80, 40)


def members(model: Model, contrast: float) -> Array:
    """Moduli (p,) of that design at the model's points."""
    i, j = np.clip(2 * model.points.x.T, 0, [[79], [39]]).astype(int)
    return simp(optimised()[i, j], 3.0, contrast)[0]


def operator(model: Model, moduli: Array) -> tuple[Blocks, Lattice]:
    solver = model.solver
    assert isinstance(solver, MultigridCG)
    at = places(solver.lattice, solver.pattern.row, solver.pattern.col)
    return assembled(at, model.stiffness.data(moduli)), solver.lattice


@pytest.fixture
def cycles(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Grows by one entry for each cycle."""
    called: list[int] = []
    cycle = multigrid.Cycle.__call__

    def counted(self: multigrid.Cycle, f: Array, level: int = 0) -> Array:
        if level == 0:
            called.append(1)
        return cycle(self, f, level)

    monkeypatch.setattr(multigrid.Cycle, "__call__", counted)
    return called


def assert_same(ours: Equilibrium, theirs: Equilibrium, model: Model) -> None:
    """At a residual of 1e-6: compliance to its square, the gradient to the residual, far below what is asked."""
    assert ours.newton_steps == 1
    # rounding of the direct solver: the condition number of void islands times eps
    assert compliance(model, ours) == pytest.approx(compliance(model, theirs), rel=1e-9)
    gradient, expected = (compliance_gradient(model, state) * state.moduli for state in (ours, theirs))
    assert np.linalg.norm(gradient - expected) < 3e-6 * np.linalg.norm(expected)


@pytest.mark.parametrize("name", BODIES)
def test_direct_solver_agrees(name: str, cycles: list[int]) -> None:
    ours, direct = model_of(name, DEEP), model_of(name, BandedCholesky)
    moduli = np.random.default_rng(1).uniform(0.1, 1, len(ours.points.x))
    assert_same(equilibrium(ours, moduli), equilibrium(direct, moduli), direct)
    assert len(cycles) <= 30


@pytest.mark.parametrize("contrast", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("name", ["tent", "notch", "gimp across cells", "flat cells"])
def test_void(name: str, contrast: float, cycles: list[int]) -> None:
    """A design of members, and points solid or void at random."""
    ours, direct = model_of(name, DEEP), model_of(name, BandedCholesky)
    random = np.where(np.random.default_rng(2).random(len(ours.points.x)) < 0.5, contrast, 1.0)
    for moduli in (members(ours, contrast), random):
        assert_same(equilibrium(ours, moduli), equilibrium(direct, moduli), direct)
    assert len(cycles) <= 90  # both together


@pytest.mark.parametrize("design", ["solid", "members"])
def test_iterations_do_not_grow_with_the_grid(design: str, cycles: list[int]) -> None:
    needed = []
    for n in (1, 2, 4):
        model = discretise(cantilever(40, 20), 1 / n, solver=DEEP)
        del cycles[:]
        equilibrium(model, np.ones(len(model.points.x)) if design == "solid" else members(model, 1e-9))
        needed.append(len(cycles))
    assert needed[-1] <= needed[0] + 3
    assert max(needed) <= 30


@pytest.mark.parametrize("name", BODIES)
def test_coarse_stiffness_is_galerkins(name: str) -> None:
    """The stencils of the coarse level against the sparse product P^T K P."""
    model = model_of(name, DEEP)
    K, lattice = operator(model, members(model, 1e-3))
    step = coarsening(K.stencil.lines, lattice.h, 2_000)[0]
    expected = step.PT @ K.matrix @ step.P
    for axis in step.axes:
        K = K.coarse(axis)
    assert abs(K.matrix - expected).max() < 1e-14 * abs(expected).max()
    assert abs(expected - expected.T).max() < 1e-14 * abs(expected).max()


def test_rigid_bodies_and_strains_on_coarse_levels() -> None:
    """Away from the supports a rigid motion costs no force, and a constant strain of a homogeneous body none inside."""
    K, _ = operator(discretise(cantilever(40, 20), 1.0, solver=DEEP), np.ones(3200))
    for spacing in (2.0, 4.0):
        K = K.coarse(0).coarse(1)
        nx, ny = K.stencil.lines
        x, y = np.meshgrid(spacing * np.arange(nx), spacing * np.arange(ny), indexing="ij")
        inside = np.zeros((nx, ny), dtype=bool)
        inside[3:-1, :] = True
        for u in ((1, 0), (0, 1), (-y, x)):
            force = (K.matrix @ np.stack(np.broadcast_arrays(*u, x)[:2]).astype(float).ravel()).reshape(2, nx, ny)
            # entries of order one times 40
            assert np.abs(force[:, inside & (x < 38) & (y < 18)]).max() < 1e-12
        inside[:, [0, -2, -1]] = inside[-2:, :] = False
        strained = np.stack([0.3 * x + 0.2 * y, -0.1 * y]).ravel()
        assert np.abs((K.matrix @ strained).reshape(2, nx, ny)[:, inside]).max() < 1e-12


@pytest.mark.parametrize("name", ["tent", "gimp across cells", "notch"])
def test_cycle_is_symmetric_and_positive(name: str) -> None:
    model = model_of(name, DEEP)
    K, lattice = operator(model, members(model, 1e-6))
    steps = coarsening(K.stencil.lines, lattice.h, 2_000)
    assert len(steps) >= 2
    cycle = v_cycle(K, steps)
    x, y = np.random.default_rng(3).normal(size=(2, K.stencil.size)) * (K.diagonal > 0)
    assert x @ cycle(y) == pytest.approx(cycle(x) @ y, rel=1e-8)  # compliant void: rounding of 1e6 entries
    assert x @ cycle(x) > 0


def test_clapeyron_and_many_right_hand_sides() -> None:
    model = model_of("tent", DEEP)
    moduli = members(model, 1e-6)
    state = equilibrium(model, moduli)
    work = np.sum(model.points.volume[:, None] * model.stress(moduli, state.strain) * state.strain)
    assert work == pytest.approx(compliance(model, state), rel=1e-6)  # the tolerance
    b = np.random.default_rng(5).normal(size=(len(model.stiffness.dof), 2))
    np.testing.assert_array_equal(state.solve(b), np.stack([state.solve(c) for c in b.T], axis=1))
    assert not np.any(state.solve(np.zeros(len(b))))


def test_optimisation() -> None:
    """Twenty iterations by multigrid end where the direct solver's do."""
    ends = []
    for solver in (DEEP, BandedCholesky):
        problem = DesignProblem(discretise(cantilever(32, 16), 1.0, solver=solver))
        *_, last = optimize(problem, MMA(), max_iterations=20, stop=lambda history: False)
        ends.append(last.objective)
    assert ends[0] == pytest.approx(ends[1], rel=1e-6)


def test_mechanisms_are_named() -> None:
    pin, roller = Support(Rectangle((0, 0), (0, 0))), Support(Rectangle((0, 0), (40, 0)), (False, True))
    for support in (pin, roller):
        model = discretise(cantilever(40, 20, supports=(support,)), 1.0, solver=DEEP)
        with pytest.raises((UnsupportedBody, NotConverged), match="support"):
            equilibrium(model, np.ones(3200))
    model = discretise(cantilever(40, 20, supports=(LEFT_CLAMP,)), 1.0, solver=DEEP)
    with pytest.raises(UnsupportedBody, match="node at"):
        equilibrium(model, np.where(np.abs(model.points.x[:, 0] - 20) < 2, 0.0, 1.0))


def test_cells_at_random() -> None:
    """Cells, not points, solid or void: loose pieces. Right at a contrast of 1e-3; a limit, and named, at 1e-6."""
    ours, direct = model_of("tent", DEEP), model_of("tent", BandedCholesky)
    solid = np.random.default_rng(0).random((40, 20))[tuple(np.floor(ours.points.x.T).astype(int))] < 0.5
    moduli = np.where(solid, 1.0, 1e-3)
    assert_same(equilibrium(ours, moduli), equilibrium(direct, moduli), direct)
    with pytest.raises(NotConverged, match="solver=SuperLU"):
        equilibrium(ours, np.where(solid, 1.0, 1e-6))


def test_too_hard_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """The message names the way out."""
    monkeypatch.setattr("mpmtop.solvers.multigrid_cg.MAX_ITERATIONS", 3)
    with pytest.raises(NotConverged, match="solver=SuperLU"):
        equilibrium(model_of("tent", DEEP), np.ones(3200))


def test_choice_by_size() -> None:
    row = col = np.arange(3)
    lattice = Lattice((1.0, 1.0), np.zeros((3, 2), int), np.zeros(3, int))
    assert isinstance(choose_solver(Pattern(79_999, row, col, lattice)), BandedCholesky)
    assert isinstance(choose_solver(Pattern(80_000, row, col, lattice)), MultigridCG)
    assert isinstance(choose_solver(Pattern(80_000, row, col)), BandedCholesky)  # on no lattice
    assert isinstance(discretise(cantilever(), 1.0, solver=SuperLU).solver, SuperLU)
