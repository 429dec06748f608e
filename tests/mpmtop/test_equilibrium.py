"""Equilibrium against independent codes and the identities of linear elasticity."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mpmtop.arrays import Array
from mpmtop.body import Material, Support
from mpmtop.equilibrium import Solution, adjoint, checked_solve, equilibrium, moduli_gradient
from mpmtop.errors import NotConverged
from mpmtop.grid import Grid
from mpmtop.loads import PointLoad, PositionLoad, RegionLoad
from mpmtop.model import Model, discretise
from mpmtop.objectives import COMPLIANCE, compliance
from mpmtop.points import MaterialPoints, to_gauss_points
from mpmtop.region import Rectangle
from mpmtop.shape_functions import ShapeFunction, gimp, tent
from mpmtop.solvers import BandedCholesky, Solve, SuperLU
from tests.mpmtop.solvers.table import DIRECT
from tests.scenes import LEFT_CLAMP, SHAPE_FUNCTIONS, cantilever
from validation.measures.derivatives import central_difference
from validation.oracles.extended import full_stiffness

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # bodies are moved and cut on purpose

DATA = Path(__file__).parents[2] / "validation" / "data" / "ample"
ALL = pytest.mark.parametrize("shape_function", SHAPE_FUNCTIONS, ids=lambda f: f.__name__)


def ample_model(nx: int, ny: int, shift: float, shape_function: ShapeFunction) -> Model:
    last_column = RegionLoad(Rectangle((nx - 0.5 + shift, 0), (nx + shift, ny)), (0.0, -1.0))
    scene = cantilever(nx, ny, shift=shift, load=last_column, material=Material(1e6, 0.3))
    return discretise(scene.body, shape_function=shape_function, grid=Grid((0, 0), (1, 1), (nx + 2, ny)))


@pytest.mark.parametrize("shift", [0.0, 0.3])
@pytest.mark.parametrize(("name", "shape_function"), [("mpm", tent), ("gimp", gimp)])
def test_ample(name: str, shape_function: ShapeFunction, shift: float) -> None:
    """Displacements, stresses and compliance of AMPLE, to 1e-10 of the largest (validation/data/ample/README.md)."""
    model = ample_model(40, 20, shift, shape_function)
    state = equilibrium(model, np.full(3200, 1e6))
    case = f"cantilever40x20_{name}_s{round(100 * shift):03d}"

    nodes = pd.read_csv(DATA / f"{case}_nodes.csv")
    assert len(nodes) == len(model.transfer.nodes)  # the same nodes are active
    position = model.grid.node_positions()[model.transfer.nodes]
    order = nodes.sort_values(["x", "y"])
    np.testing.assert_array_equal(order[["x", "y"]], position)
    theirs = order[["ux_lin", "uy_lin"]].to_numpy()
    np.testing.assert_allclose(state.u.reshape(-1, 2), theirs, rtol=0, atol=1e-10 * np.abs(theirs).max())

    points = pd.read_csv(DATA / f"{case}_points.csv")
    mine = pd.DataFrame(np.round(model.points.x, 9), columns=["x", "y"])
    mine[["ux", "uy"]] = model.transfer.interpolate(state.u)
    mine[["xx", "yy", "xy"]] = model.stress(state.moduli, state.strain)
    both = points.round({"x": 9, "y": 9}).merge(mine, on=["x", "y"])
    assert len(both) == len(points) == 200
    for ours, published in (
        (["ux", "uy"], ["ux_lin", "uy_lin"]),
        (["xx", "yy", "xy"], ["sxx_lin", "syy_lin", "sxy_lin"]),
    ):
        theirs = both[published].to_numpy()
        np.testing.assert_allclose(both[ours], theirs, rtol=0, atol=1e-10 * np.abs(theirs).max())
    np.testing.assert_allclose(0.3 * (both["xx"] + both["yy"]), both["szz_lin"], rtol=0, atol=1e-10)

    published_compliance = {("mpm", 0.3): 3.643223865279e-05, ("gimp", 0.3): 3.590198652812e-05}
    assert compliance(model, state) == pytest.approx(
        published_compliance.get((name, shift), 3.410843591618e-05), rel=1e-10
    )


def test_small_cuts() -> None:
    """A GIMP domain that overlaps the next cell by s = 1e-1 ... 1e-8: AMPLE's compliance, to 1e-10."""
    cuts = pd.read_csv(DATA / "smallcut_gimp20x10.csv")
    for s, theirs in zip(cuts["s"], cuts["compliance"], strict=True):
        model = ample_model(20, 10, s, gimp)
        state = equilibrium(model, np.full(800, 1e6))
        assert compliance(model, state) == pytest.approx(theirs, rel=1e-10)


@ALL
@pytest.mark.parametrize("shift", [0.0, 0.25, 0.3, 0.25 + 1e-12, 0.25 - 1e-12])
def test_clapeyron_and_moduli_identity(shape_function: ShapeFunction, shift: float) -> None:
    """sum V sigma : eps = f.u, and sum E dC/dE = -C since C is homogeneous of degree -1 in the moduli."""
    points = discretise(cantilever().body, 1.0).points.moved((shift, shift))
    model = discretise(cantilever().body, 1.0, points=points, shape_function=shape_function)
    moduli = np.random.default_rng(3).uniform(0.1, 1, len(model.points.x))
    state = equilibrium(model, moduli)
    C = compliance(model, state)
    work = np.sum(model.points.volume[:, None] * model.stress(moduli, state.strain) * state.strain)
    assert work == pytest.approx(C, rel=1e-12)  # backward stable solve of 100 unknowns
    assert moduli @ moduli_gradient(model, state, adjoint(model, state, COMPLIANCE)) == pytest.approx(-C, rel=1e-12)


def interior_residual(points: MaterialPoints | None, shape_function: ShapeFunction) -> float:
    """Largest force of a constant unit stress at nodes all of whose cells are full: zero in equilibrium."""
    model = discretise(cantilever(10, 8).body, 1.0, points=points, shape_function=shape_function)
    stress = np.tile([1.0, 1.0, 1.0], (len(model.points.x), 1))
    position = model.grid.node_positions()[model.transfer.nodes]
    inside = Rectangle((3, 3), (7, 5)).contains(position)  # the cubic B-spline's cells reach two nodes further
    assert np.count_nonzero(inside) == 15
    return float(np.abs(model.internal_force(stress).reshape(-1, 2)[inside]).max())


@ALL
@pytest.mark.parametrize("shift", [0.0, 0.1, 0.25, 0.3])
def test_patch_uniform_points(shape_function: ShapeFunction, shift: float) -> None:
    """Constant stress is in equilibrium in the interior for uniform points at any shift."""
    points = discretise(cantilever(10, 8).body, 1.0).points.moved((shift, shift))
    assert interior_residual(points, shape_function) < 1e-12


def test_patch_uneven_points() -> None:
    """One column pushed over a grid line breaks the patch test of the tent, and far less that of GIMP; domains of
    unequal size that tile the body do not break GIMP at all."""
    points = discretise(cantilever(10, 8).body, 1.0).points
    pushed = points.moved(np.where(np.isclose(points.x[:, :1], 3.75), [[0.26, 0.0]], 0.0))
    assert interior_residual(pushed, tent) > 0.2  # one of the four points of each of two cells sits in the wrong one
    assert interior_residual(pushed, gimp) < 0.6 * interior_residual(pushed, tent)

    edges = np.array([0, 0.3, 1.2, 1.6, 2.5, 3.1, 3.9, 4.7, 5.3, 6.2, 6.9, 7.4, 8.0, 8.9, 9.5, 10.0])
    x = np.stack(np.meshgrid((edges[1:] + edges[:-1]) / 2, np.arange(0.25, 8, 0.5), indexing="ij"), -1).reshape(-1, 2)
    half = np.stack(np.broadcast_arrays(np.repeat(np.diff(edges) / 2, 16), 0.25), axis=-1)
    uneven = MaterialPoints(x, np.prod(2 * half, axis=1), half)
    assert interior_residual(uneven, gimp) < 1e-12
    assert interior_residual(uneven, tent) > 0.01


def test_uniaxial_tension_is_exact() -> None:
    """Patch test of the solution: a consistent end traction gives the linear displacement of uniaxial plane stress."""
    ends = tuple(
        PositionLoad((6.0, float(j)), (1.0 if 0 < j < 3 else 0.5, 0.0)) for j in range(4)
    )  # unit traction on the nodes of the right edge
    rollers = (
        LEFT_CLAMP.__class__(LEFT_CLAMP.region, (True, False)),
        Support(Rectangle((0, 0), (0, 0)), (False, True)),
    )
    scene = cantilever(6, 3, supports=rollers, loads=ends, material=Material(2.0, 0.25, plane="stress"))
    model = discretise(scene.body, 1.0)
    state = equilibrium(model, np.full(len(model.points.x), 2.0))
    x, y = model.grid.node_positions()[model.transfer.nodes].T
    exact = np.stack([x / 2, -0.25 * y / 2], axis=1)
    np.testing.assert_allclose(state.u.reshape(-1, 2), exact, rtol=0, atol=3e-12)
    np.testing.assert_allclose(model.stress(state.moduli, state.strain), [[1, 0, 0]] * len(model.points.x), atol=3e-12)


def test_gauss_points_move() -> None:
    points = to_gauss_points(discretise(cantilever(2, 1).body, 1.0).points)
    offsets = np.abs(points.x - np.floor(points.x) - 0.5)
    np.testing.assert_allclose(offsets, 0.5 / np.sqrt(3), rtol=1e-14)


def test_solvers_agree() -> None:
    """The direct solvers on a half-void design of modulus contrast 1e-9."""
    moduli = np.where(np.random.default_rng(4).random(800) < 0.5, 1e-9, 1.0)
    models = [discretise(cantilever(20, 10).body, 1.0, solver=solver) for solver in DIRECT.values()]
    values = [compliance(model, equilibrium(model, moduli)) for model in models]
    assert values == pytest.approx([values[0]] * len(DIRECT), rel=1e-8)  # condition number 1e9 times eps


def test_many_right_hand_sides() -> None:
    model = discretise(cantilever().body, 1.0)
    solve = equilibrium(model, np.ones(128)).solve
    b = np.random.default_rng(5).normal(size=(len(model.stiffness.dof), 3))
    np.testing.assert_allclose(solve(b), np.stack([solve(c) for c in b.T], axis=1), rtol=1e-12)


def test_void_that_carries_the_load() -> None:
    """The solid end hangs on void, so |K| |u| is 1e9 |f|: rounding keeps |R| above the tolerance, yet the energy is
    right to all digits, and equilibrium is accepted. At a contrast of 1e-12 the energy is not, and that is said."""

    def energy(contrast: float, solver: type) -> float:
        model = discretise(cantilever(12, 6).body, 1.0, solver=solver)
        x = model.points.x[:, 0]
        state = equilibrium(model, np.where((x < 6) | (x > 9), 1.0, contrast))
        assert state.residual > 1e-9
        return compliance(model, state)

    assert energy(1e-9, BandedCholesky) == pytest.approx(energy(1e-9, SuperLU), rel=1e-9)  # the tolerance of the energy
    with pytest.raises(NotConverged, match="raise E_min / E0"):
        energy(1e-12, BandedCholesky)


def test_linear_scene_takes_one_newton_step() -> None:
    state = equilibrium(discretise(cantilever().body, 1.0), np.ones(128))
    assert state.solves == 1
    assert state.residual < 1e-9


def test_checked_solve_mends_a_solver_and_refuses_a_useless_one() -> None:
    model = discretise(cantilever().body, 1.0)
    moduli = np.ones(128)
    exact = equilibrium(model, moduli)

    def solution(factor: float, tol: float | None = None) -> Solution:
        return checked_solve(model, moduli, lambda b: factor * exact.solve(b), model.f_ext, tol=tol)

    assert solution(1.0).solves == 1
    for factor, steps in ((1 + 1e-4, 3), (1 - 1e-6, 2)):  # every step divides the error by 1e4 and 1e6
        mended = solution(factor)
        assert mended.solves == steps
        np.testing.assert_allclose(mended.u, exact.u, rtol=0, atol=1e-8 * np.abs(exact.u).max())  # tol, and a digit
    assert solution(1 + 1e-4, tol=1e-3).solves == 1
    with pytest.raises(NotConverged, match="nearly singular at displacement"):
        solution(1.2)
    for useless in (np.nan, -1.0):
        with pytest.raises(NotConverged, match="nearly singular at displacement"):
            solution(useless)
    with pytest.raises(ValueError, match="choose units"):
        solution(0.0)
    nothing = checked_solve(model, moduli, exact.solve, np.zeros_like(model.f_ext))
    assert nothing.solves == 0
    assert not np.any(nothing.u)


def test_an_adjoint_whose_work_on_the_state_is_off_is_refused() -> None:
    """A solver that misses a part of the state for good: its residual has an energy below the tolerance, and the
    gradient is wrong by that part all the same. A state at rest has no part to miss."""
    model = discretise(cantilever().body, 1.0)
    state = equilibrium(model, np.ones(128))
    free = model.stiffness.dof

    def missing(part: float) -> Solve:
        u = state.u[free]
        return lambda b: state.solve(b) - part * u * (b @ u) / (model.f_ext @ state.u)

    def adjoint(part: float, of: Array) -> Solution:
        return checked_solve(model, state.moduli, missing(part), model.f_ext, state=of, max_solves=1)

    assert adjoint(1e-7, state.u).residual < 1e-6
    with pytest.raises(NotConverged):
        adjoint(3e-5, state.u)
    assert adjoint(0.0, np.zeros_like(state.u)).solves == 1


def test_a_soft_part_that_a_small_residual_misses() -> None:
    """A solver that leaves out the softest of all modes: the residual is below any tolerance, the adjoint wrong."""
    model = discretise(cantilever(6, 2).body, 1.0)
    x = model.points.x[:, 0]
    moduli = np.where((x < 2) | (x > 3), 1.0, 1e-7)
    state = equilibrium(model, moduli)
    K = full_stiffness(model, moduli)
    values, modes = np.linalg.eigh(K)
    softest, hard = modes[:, 0], modes[:, values > 1e-3]
    free = model.stiffness.dof
    load = np.zeros_like(state.u)
    load[free] = hard @ np.random.default_rng(0).normal(size=hard.shape[1]) + 1e-8 * softest

    def blind(b: Array) -> Array:
        u = state.solve(b)
        return u - (softest @ u) * softest

    known = checked_solve(model, moduli, state.solve, load, state=state.u)
    unseen = checked_solve(model, moduli, blind, load)
    assert unseen.residual < 1e-7
    assert abs((unseen.u - known.u) @ model.f_ext) > 0.01 * abs(known.u @ model.f_ext)  # what a gradient is made of
    with pytest.raises(NotConverged):
        checked_solve(model, moduli, blind, load, state=state.u)


@pytest.mark.parametrize("tip", [(0.0, 1.0), (1.0, 0.0)], ids=["along the load", "across it"])
def test_adjoint_of_a_displacement(tip: tuple[float, float]) -> None:
    """d u_tip / dE_p by finite differences. Across the load u_tip is zero, by symmetry, and so is what the adjoint's
    load does on the state: that is no sign of a singular stiffness."""
    model = discretise(cantilever(8, 4).body, 1.0)
    force = replace(model, body=replace(model.body, loads=(PointLoad((8.0, 2.0), tip),))).f_ext
    moduli = np.ones(128)
    state = equilibrium(model, moduli)
    adjoint = checked_solve(model, moduli, state.solve, force, state=state.u)
    assert adjoint.solves == 1
    by_moduli = -model.points.volume * np.sum((adjoint.strain @ model.D) * state.strain, axis=1)
    p, h = 37, 1e-4
    slope = central_difference(lambda moduli: force @ equilibrium(model, moduli).u, moduli, np.eye(128)[p], h)
    assert by_moduli[p] == pytest.approx(slope, rel=1e-6)  # h^2, and rounding over h

    def blind(b: Array) -> Array:  # misses a part of the state
        return state.solve(b) - 1e-4 * state.u[model.stiffness.dof] * (b @ np.ones(len(b)))

    with pytest.raises(NotConverged):
        checked_solve(model, moduli, blind, force, state=state.u, max_solves=1)


@pytest.mark.parametrize("force", [1e-170, 1e-200, 1e160, 1e200])
def test_forces_beyond_double_precision(force: float) -> None:
    """force^2 is: neither a compliance of zero nor an overflow."""
    model = discretise(cantilever(load=PointLoad((8.0, 2.0), (0.0, -force))).body, 1.0)
    with pytest.raises(ValueError, match="choose units"):
        equilibrium(model, np.ones(128))


def test_points_of_no_or_infinite_size() -> None:
    x, one = np.ones((1, 2)), np.ones(1)
    for size in (0.0, -1.0, np.nan, np.inf):
        for volume, half in ((size * one, x), (one, size * x)):
            with pytest.raises(ValueError, match="must be positive and finite"):
                MaterialPoints(x, volume, half)
