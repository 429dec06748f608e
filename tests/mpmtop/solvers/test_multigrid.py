"""Multigrid against the direct solver, and the properties its convergence rests on."""

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.body import Material
from mpmtop.criteria import PNormStress
from mpmtop.equilibrium import Equilibrium, adjoint, equilibrium, moduli_gradient
from mpmtop.material import simp
from mpmtop.model import Model, discretise
from mpmtop.objectives import COMPLIANCE, compliance
from mpmtop.optimizers import MMA, optimize
from mpmtop.planning import plan
from mpmtop.problem import DesignProblem, design_problem
from mpmtop.region import Circle, Difference, Rectangle
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3, gimp, tent
from mpmtop.solvers import MAX_ITERATIONS, BandedCholesky, Lattice, MultigridCG, SparseCholesky, multigrid
from mpmtop.solvers.multigrid import coarsening, coarsest_of, v_cycle
from mpmtop.solvers.multigrid_cg import IteratedSolve
from mpmtop.solvers.stencil import Blocks, assembled, places
from tests.scenes import cantilever

DEEP = partial(MultigridCG, tolerance=1e-6, coarsest=200)
"""Several levels on small bodies: the last one has 10 nodes across; a tolerance for what is compared to 1e-6."""
NOTCHED = Difference(Rectangle((0, 0), (40, 20)), Rectangle((16, 8), (40, 20)))
HOLED = Difference(Rectangle((0, 0), (40, 20)), Circle((21.3, 9.2), 6.3))
BODIES: dict[str, tuple[dict, dict]] = {
    "tent": ({}, {}),
    "notch": ({"domain": NOTCHED, "loads": cantilever(40, 6).body.loads}, {}),
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
    points = discretise(scene.body, h).points.moved((0.0, shift))
    return discretise(scene.body, h, points=points, solver=solver, **how)


@cache
def optimised() -> Array:
    """Densities (80, 40) of the small cantilever after 30 iterations: a truss, half of it void."""
    *_, last = optimize(design_problem(cantilever(40, 20), 1.0), MMA(), max_iterations=30)
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


def matrix_of(K: Blocks) -> Array:
    return np.stack([K @ column for column in np.eye(K.stencil.size)], axis=1)


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


def by_logarithm(model: Model, state: Equilibrium) -> Array:
    """dC/dlnE (p,)."""
    return moduli_gradient(model, state, adjoint(model, state, COMPLIANCE)) * state.moduli


def assert_same(ours: Equilibrium, theirs: Equilibrium, model: Model) -> None:
    """At a residual of 1e-6: compliance to its square, the gradient to the residual, far below what is asked."""
    assert ours.solves == 1
    # rounding of the direct solver: the condition number of void islands times eps
    assert compliance(model, ours) == pytest.approx(compliance(model, theirs), rel=1e-9)
    gradient, expected = (by_logarithm(model, state) for state in (ours, theirs))
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
        model = discretise(cantilever(40, 20).body, 1 / n, solver=DEEP)
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
    step = coarsening(K.stencil.lines, lattice.h, 200)[0]
    expected = step.PT @ matrix_of(K) @ step.P
    for axis in step.axes:
        K = K.coarse(axis)
    assert abs(matrix_of(K) - expected).max() < 1e-14 * abs(expected).max()
    assert abs(expected - expected.T).max() < 1e-14 * abs(expected).max()


def test_one_coarse_level_at_least() -> None:
    """Also below the unknowns that a coarsest level may have: an exact solution there would be that of K itself."""
    assert [step.P.shape for step in coarsening((81, 41), (1.0, 1.0))] == [(2 * 81 * 41, 2 * 41 * 21)]
    assert len(coarsening((81, 41), (1.0, 1.0), coarsest=2_000)) == 1
    assert len(coarsening((81, 41), (1.0, 1.0), coarsest=1_000)) == 2


@pytest.mark.parametrize(("shape_function", "depth"), [(tent, 1), (bspline2, 1), (bspline2, 2), (bspline3, 1)])
def test_narrower_than_the_stencil(shape_function: ShapeFunction, depth: int) -> None:
    """A bar of one or two rows of cells: the lattice has fewer lines than the functions couple."""
    scene = cantilever(24, depth)
    ours, direct = (discretise(scene.body, 1.0, 2, shape_function, solver=solver) for solver in (DEEP, BandedCholesky))
    moduli = np.random.default_rng(1).uniform(0.1, 1, len(ours.points.x))
    assert_same(equilibrium(ours, moduli), equilibrium(direct, moduli), direct)
    K, _ = operator(ours, moduli)
    u = np.random.default_rng(2).normal(size=len(direct.f_ext))
    u[np.setdiff1d(np.arange(len(u)), direct.stiffness.dof)] = 0
    at = places(ours.solver.lattice, ours.solver.pattern.row, ours.solver.pattern.col).unknown  # type: ignore[attr-defined]
    whole = np.zeros(K.stencil.size)
    whole[at] = u[ours.stiffness.dof]
    np.testing.assert_allclose((K @ whole)[at], direct.resistance(moduli, u)[ours.stiffness.dof], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("name", "levels"), [("tent", 2), ("notch", 1)])
def test_what_is_empty_does_not_count(name: str, levels: int) -> None:
    """The first coarse lattice of 21 x 11 nodes has 462 unknowns if the body fills it, two thirds of them if not."""
    model = model_of(name, partial(MultigridCG, coarsest=400))
    solve = model.solver.factor(model.stiffness.data(np.ones(len(model.points.x))))
    assert isinstance(solve, IteratedSolve)
    assert len(solve.cycle.levels) == levels


def test_rigid_bodies_and_strains_on_coarse_levels() -> None:
    """Away from the supports a rigid motion costs no force, and a constant strain of a homogeneous body none inside."""
    K, _ = operator(discretise(cantilever(40, 20).body, 1.0, solver=DEEP), np.ones(3200))
    for spacing in (2.0, 4.0):
        K = K.coarse(0).coarse(1)
        nx, ny = K.stencil.lines
        x, y = np.meshgrid(spacing * np.arange(nx), spacing * np.arange(ny), indexing="ij")
        inside = np.zeros((nx, ny), dtype=bool)
        inside[3:-1, :] = True
        for u in ((1, 0), (0, 1), (-y, x)):
            force = (K @ np.stack(np.broadcast_arrays(*u, x)[:2]).astype(float).ravel()).reshape(2, nx, ny)
            # entries of order one times 40
            assert np.abs(force[:, inside & (x < 38) & (y < 18)]).max() < 1e-12
        inside[:, [0, -2, -1]] = inside[-2:, :] = False
        strained = np.stack([0.3 * x + 0.2 * y, -0.1 * y]).ravel()
        assert np.abs((K @ strained).reshape(2, nx, ny)[:, inside]).max() < 1e-12


@pytest.mark.parametrize("name", ["tent", "gimp across cells", "notch"])
def test_cycle_is_symmetric_and_positive(name: str) -> None:
    model = model_of(name, DEEP)
    K, lattice = operator(model, members(model, 1e-6))
    steps = coarsening(K.stencil.lines, lattice.h, 200)
    assert len(steps) >= 2
    cycle = v_cycle(K, steps, coarsest_of(K, steps))
    x, y = np.random.default_rng(3).normal(size=(2, K.stencil.size)) * (K.diagonal > 0)
    assert x @ cycle(y) == pytest.approx(cycle(x) @ y, rel=1e-6)  # rounding of single precision, 6e-8
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
    for solver in (partial(MultigridCG, coarsest=200), BandedCholesky):
        problem = design_problem(cantilever(32, 16), 1.0, solver=solver)
        *_, last = optimize(problem, MMA(), max_iterations=20, stop=lambda history: False)
        ends.append(last.objective)
    assert ends[0] == pytest.approx(ends[1], rel=1e-6)


def cells_at_random(model: Model, contrast: float) -> Array:
    """Moduli (p,) of cells, not points, solid or void: loose pieces."""
    solid = np.random.default_rng(0).random((40, 20))[tuple(np.floor(model.points.x.T).astype(int))] < 0.5
    return np.where(solid, 1.0, contrast)


@pytest.mark.parametrize("contrast", [1e-3, 1e-6, 1e-9])
def test_cells_at_random(contrast: float, cycles: list[int]) -> None:
    """Loose pieces that hang on void alone have modes that no coarse level holds: the direct solver takes over."""
    ours, direct = model_of("tent", DEEP), model_of("tent", BandedCholesky)
    moduli = cells_at_random(ours, contrast)
    state, expected = equilibrium(ours, moduli), equilibrium(direct, moduli)
    # one solve is held to the tolerance, 1e-6; the band's is refined
    assert compliance(ours, state) == pytest.approx(compliance(direct, expected), rel=1e-6)
    by_log = [by_logarithm(direct, at) for at in (state, expected)]
    assert np.linalg.norm(by_log[0] - by_log[1]) < 3e-6 * np.linalg.norm(by_log[1])
    assert len(cycles) <= MAX_ITERATIONS + 1


def test_direct_solver_takes_over(monkeypatch: pytest.MonkeyPatch, cycles: list[int]) -> None:
    """After the iterations that it is given, once for all right sides, with the direct solver's own answer."""
    model = model_of("tent", DEEP)
    data, b = model.stiffness.data(np.ones(3200)), model.f_ext[model.stiffness.dof]
    monkeypatch.setattr("mpmtop.solvers.multigrid_cg.MAX_ITERATIONS", 3)
    solve = model.solver.factor(data)
    assert isinstance(model.solver, MultigridCG)
    expected = SparseCholesky(model.solver.pattern).factor(data)
    np.testing.assert_array_equal(solve(b), expected(b))
    np.testing.assert_array_equal(solve(np.stack([b, b])[:, ::-1].T), expected(b[::-1])[:, None] * [1, 1])
    assert len(cycles) == 4
    assert "sparse Cholesky where 40 iterations" in plan(DesignProblem(model, cantilever().design))


def test_one_point_for_a_cell() -> None:
    """Its hourglass modes have next to no stiffness, which no coarse level sees: answered as by the band."""
    ours, direct = (discretise(cantilever(40, 20).body, 1.0, 1, solver=solver) for solver in (DEEP, BandedCholesky))
    assert_same(equilibrium(ours, np.ones(800)), equilibrium(direct, np.ones(800)), direct)


def test_stress_objective_sees_no_more_than_rounding(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten iterations for the p-norm by the solver that is chosen for it keep its objective to 1e-6 of the band's."""
    monkeypatch.setattr("mpmtop.solvers.MULTIGRID_FROM", 0)
    scene = cantilever(40, 20)
    chosen = discretise(scene.body, 1.0)
    assert isinstance(chosen.solver, MultigridCG)
    ends = []
    for solver in (replace(chosen.solver, coarsest=200), BandedCholesky(chosen.solver.pattern)):
        problem = DesignProblem(replace(chosen, solver=solver), scene.design, PNormStress(12, 0.5))
        *_, last = optimize(problem, MMA(move=0.05), max_iterations=10, stop=lambda history: False)
        ends.append(last.objective)
    assert ends[0] == pytest.approx(ends[1], rel=1e-6)


@pytest.mark.slow
def test_sixty_iterations() -> None:
    """Of 20,000 points: every objective to 1e-6 of the direct solver's, whose own rounding leaves 1e-12 (1e-8 seen)."""
    runs = []
    for solver in (partial(MultigridCG, coarsest=1_000), SparseCholesky):
        problem = design_problem(cantilever(100, 50), 1.0, solver=solver)
        run = optimize(problem, MMA(), max_iterations=60, stop=lambda history: False)
        runs.append([iterate.objective for iterate in run])
    np.testing.assert_allclose(*runs, rtol=1e-6)
