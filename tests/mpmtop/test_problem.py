"""Density filter, SIMP and the gradient of compliance through both."""

from dataclasses import replace

import numpy as np
import pytest

from mpmtop.criteria import PNormStress
from mpmtop.filter import density_filter
from mpmtop.loads import PointLoad
from mpmtop.material import simp
from mpmtop.model import discretise
from mpmtop.planning import plan
from mpmtop.points import MaterialPoints
from mpmtop.problem import DesignProblem, design_problem
from mpmtop.shape_functions import ShapeFunction, bspline3, gimp, tent
from tests.scenes import SHAPE_FUNCTIONS, cantilever
from validation.measures.derivatives import adjoint_gap, central_difference, taylor_orders

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # bodies are moved and cut on purpose


def two_levels() -> MaterialPoints:
    """A 4 x 2 body: unit points on the left half, quarter-size ones on the right."""
    coarse = np.stack(np.meshgrid([0.5, 1.5], [0.5, 1.5], indexing="ij"), -1).reshape(-1, 2)
    fine = np.stack(np.meshgrid(2.25 + 0.5 * np.arange(4), 0.25 + 0.5 * np.arange(4), indexing="ij"), -1).reshape(-1, 2)
    half = np.repeat([0.5, 0.25], [4, 16])[:, None] * np.ones(2)
    return MaterialPoints(np.concatenate([coarse, fine]), np.prod(2 * half, axis=1), half)


def test_filter_by_its_definition() -> None:
    points, radius = two_levels(), 1.3
    distance = np.linalg.norm(points.x[:, None] - points.x, axis=-1)
    weight = points.volume * np.maximum(0, radius - distance)
    expected = weight / weight.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(density_filter(points, radius).matrix.toarray(), expected, atol=1e-15)


def test_filter_properties() -> None:
    W = density_filter(two_levels(), 1.3)
    rng = np.random.default_rng(0)
    x, y = rng.random((2, 20))
    np.testing.assert_allclose(W(np.ones(20)), 1, rtol=1e-15)
    assert adjoint_gap(W, W.adjoint, x, y) < 1e-14
    identity = density_filter(two_levels(), 0.4)  # below one spacing
    np.testing.assert_array_equal(identity(x), x)


def test_simp_ends_and_slope() -> None:
    rho = np.array([0.0, 0.5, 1.0])
    value, slope = simp(rho, 3.0, 1e-9)
    np.testing.assert_allclose(value, [1e-9, 0.125 + 0.875e-9, 1], rtol=1e-15)
    difference = central_difference(lambda rho: simp(rho, 3.0, 1e-9)[0], rho[1:2], np.ones(1), 1e-6)
    np.testing.assert_allclose(slope[1:2], difference, rtol=1e-9)


@pytest.mark.parametrize("shape_function", SHAPE_FUNCTIONS, ids=lambda f: f.__name__)
@pytest.mark.parametrize("shift", [0.0, 0.3])
def test_gradient_has_a_second_order_remainder(shape_function: ShapeFunction, shift: float) -> None:
    """Taylor test: J(x + t d) - J(x) - t dJ.d falls as t^2, at a random design and direction, with crossing."""
    points = discretise(cantilever().body, 1.0).points.moved((shift, 0.0))
    problem = design_problem(cantilever(), 1.0, points=points, shape_function=shape_function)
    rng = np.random.default_rng(1)
    x, d = rng.uniform(0.2, 0.8, (2, 128)) - [[0], [0.5]]
    at = problem.evaluate(x)
    dJ, dg = problem.gradient(at)
    order = taylor_orders(lambda x: problem.evaluate(x).objective, x, d, dJ @ d, (1e-2, 1e-3))
    assert order == pytest.approx(2, abs=0.05)  # the third-order term at t = 1e-3
    moved = problem.evaluate(x + d).constraints
    np.testing.assert_allclose(moved, at.constraints + dg @ d, rtol=1e-12)  # the constraint is linear


def test_start_is_feasible_and_uniform() -> None:
    problem = design_problem(cantilever(), 1.0)
    start = problem.evaluate(problem.x0)
    np.testing.assert_allclose(start.rho, 0.4, rtol=1e-14)
    assert abs(start.constraints[0]) < 1e-14


def test_fingerprint_tells_problems_apart() -> None:
    """By the numbers: without crossing GIMP is the standard method, and a name or an integer changes nothing."""

    def fingerprint(shift: float = 0.0, shape_function: ShapeFunction = tent, **changes: object) -> str:
        points = discretise(cantilever().body, 1.0).points.moved((shift, 0.0))
        return design_problem(cantilever(**changes), 1.0, points=points, shape_function=shape_function).fingerprint

    same = {fingerprint(), fingerprint(shape_function=gimp), fingerprint(name="another"), fingerprint(penal=3)}
    assert len(same) == 1
    different = [
        fingerprint(filter_radius=2.0),
        fingerprint(volume_fraction=0.5),
        fingerprint(penal=4.0),
        fingerprint(objective=PNormStress()),
        fingerprint(objective=PNormStress(p=20)),
        fingerprint(objective=PNormStress(measure="von_mises_in_plane")),
        fingerprint(loads=(PointLoad((8.0, 0.0), (0.0, -1.0)),)),
        fingerprint(0.3),
        fingerprint(0.3, gimp),
    ]
    assert len({*same, *different}) == 10


def test_a_last_bit_is_not_in_the_fingerprint(monkeypatch: pytest.MonkeyPatch) -> None:
    """What another BLAS or processor computes is off by a few of them; a power of two then changes its exponent."""
    problem = design_problem(cantilever(), 1.0, shape_function=bspline3)
    before, model = problem.fingerprint, problem.model
    for sign in (1, -1):
        off = 1 + sign * 4e-16
        transfer = replace(model.transfer, grad_N=model.transfer.grad_N * off)
        moved = replace(model, transfer=transfer, points=replace(model.points, volume=model.points.volume * off))
        vars(moved)["f_ext"] = model.f_ext * off
        assert DesignProblem(moved, problem.design).fingerprint == before
    other = replace(model, points=replace(model.points, volume=model.points.volume * (1 + 1e-6)))
    assert DesignProblem(other, problem.design).fingerprint != before
    monkeypatch.setattr("mpmtop.filter.BY_CONVOLUTION", 0)  # other sums of the same numbers
    assert design_problem(cantilever(), 1.0, shape_function=bspline3).fingerprint == before


def test_densities_are_checked() -> None:
    problem = design_problem(cantilever(), 1.0)
    with pytest.raises(ValueError, match="one for each point"):
        problem.analyse(np.ones(3))
    for wrong in (-0.1, 1.1, np.nan):
        with pytest.raises(ValueError, match="physical densities"):
            problem.analyse(np.full(128, wrong))


def test_callers_arrays_are_their_own() -> None:
    """Changing a design that was handed in or out changes nothing of an evaluation."""
    problem = design_problem(cantilever(), 1.0)
    rho = np.full(128, 0.5)
    at = problem.analyse(rho)
    gradient = problem.density_gradient(at)
    rho[:] = 1.0
    np.testing.assert_array_equal(problem.density_gradient(at), gradient)


def test_plan_says_what_is_skipped() -> None:
    text = plan(design_problem(cantilever(), 1.0, shape_function=gimp))
    assert "nodes: 45 of 117" in text  # 9 x 5 of a grid with two cells of margin on every side
    assert "128 of 128 points need no more than the 4" in text  # no domain leaves its cell
    assert "adjoint solve: skipped" in text
    shifted = discretise(cantilever().body, 1.0).points.moved((0.3, 0.0))
    text = plan(design_problem(cantilever(), 1.0, points=shifted, shape_function=gimp))
    assert "64 of 128 points" in text  # one column of two crosses


def test_points_moved_off_the_design_grid_keep_its_filter() -> None:
    on_grid = design_problem(cantilever(), 1.0)
    grid, design = on_grid.model.points, on_grid.design
    shift = np.random.default_rng(4).uniform(-0.2, 0.2, grid.x.shape)
    moved = discretise(cantilever().body, 1.0, points=grid.moved(shift))
    assert abs(DesignProblem(moved, design).filter.matrix - on_grid.filter.matrix).max() > 0
    assert abs(DesignProblem(moved, design, design_grid=grid).filter.matrix - on_grid.filter.matrix).max() == 0
    with pytest.raises(ValueError, match="one for each"):
        DesignProblem(moved, design, design_grid=two_levels())
