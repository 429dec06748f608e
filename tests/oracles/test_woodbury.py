"""Derivatives without an adjoint: low-rank perturbations against new analyses, complex steps against dense algebra."""

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from mpmtop.arrays import Array
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.model import discretise
from mpmtop.problem import DesignProblem
from mpmtop.shape_functions import ShapeFunction, gimp, tent
from reference_fem.simp import design_problem
from tests.scenes import SHAPE_FUNCTIONS, cantilever
from validation.oracles.woodbury import (
    BlockTridiagonal,
    State,
    System,
    changed_objectives,
    exact_derivatives,
    finite_elements,
    material_points,
)

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # bodies are moved and cut on purpose

OBJECTIVES = [Compliance(), PNormStress(p=8.0, q=0.5), PNormStress(p=8.0, q=0.5, measure="von_mises_in_plane")]
RTOL = 1e-9
"""Rounding times a condition number of 1e4 and the cancellation of a change against J, with three digits to spare."""


def subject(objective: Compliance | PNormStress, method: str) -> tuple[DesignProblem, System]:
    """A small cantilever, its points moved across cell boundaries; by the method's problem and system."""
    scene = cantilever(8, 4, objective=objective)
    if method == "FEM":
        fem = design_problem(scene, 1.0)
        return fem, finite_elements(fem)  # type: ignore[return-value]
    points = discretise(scene.body, 1.0).points.moved((0.3, 0.0))
    model = discretise(scene.body, 1.0, shape_function=tent if method == "standard" else gimp, points=points)
    problem = DesignProblem(model, scene.design, scene.objective)
    return problem, material_points(problem)


def densities(system: System) -> Array:
    return np.random.default_rng(5).uniform(0.2, 0.8, len(system.F))


METHODS = pytest.mark.parametrize("method", ["standard", "GIMP", "FEM"])
EVERY = pytest.mark.parametrize("objective", OBJECTIVES, ids=["compliance", "p-norm", "in plane"])


@METHODS
def test_the_low_rank_factors_sum_to_the_stiffness(method: str) -> None:
    _, system = subject(Compliance(), method)
    moduli = densities(system)
    n = len(system.f)
    K = np.zeros((n, n))
    k = moduli[:, None, None] * (np.swapaxes(system.F, 1, 2) @ system.F)
    np.add.at(K, (system.unknown[:, :, None], system.unknown[:, None, :]), k)
    expected = system.matrix(moduli).toarray()
    np.testing.assert_allclose(K, expected, atol=1e-14 * np.abs(expected).max())  # rounding of the sums


def test_block_factors_solve_a_band_of_changing_width() -> None:
    rng = np.random.default_rng(0)
    n = 60
    distance = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    pattern = distance <= np.minimum.outer(2 + np.arange(n) // 6, 2 + np.arange(n) // 6)
    K = np.where(pattern, rng.standard_normal((n, n)), 0)
    K = K + K.T + 40 * np.eye(n)  # diagonally dominant
    factors = BlockTridiagonal.factor(sp.csr_array(K))
    assert len(factors.start) > 4
    b = rng.standard_normal((n, 3))
    b[:20] = 0  # the forward sweep starts later
    np.testing.assert_allclose(factors.solve(b), np.linalg.solve(K, b), atol=1e-14)  # condition number 3
    with pytest.raises(np.linalg.LinAlgError):
        BlockTridiagonal.factor(sp.csr_array(K - 60 * np.eye(n)))


@METHODS
@EVERY
def test_state_is_that_of_the_problem(objective: Compliance | PNormStress, method: str) -> None:
    problem, system = subject(objective, method)
    rho = densities(system)
    J, unchanged = changed_objectives(State.at(system, rho), 0.0)
    assert pytest.approx(problem.analyse(rho).objective, rel=RTOL) == J
    np.testing.assert_allclose(unchanged, J, rtol=1e-14)


@METHODS
@EVERY
@pytest.mark.parametrize("change", [0.2, -0.1])
def test_woodbury_is_a_new_analysis(objective: Compliance | PNormStress, method: str, change: float) -> None:
    problem, system = subject(objective, method)
    rho = densities(system)
    J, changed = changed_objectives(State.at(system, rho), change)
    points = np.arange(0, len(rho), 3)
    brute = np.array([problem.analyse(rho + change * (np.arange(len(rho)) == p)).objective for p in points])
    np.testing.assert_allclose(changed[points] - J, brute - J, atol=RTOL * np.abs(brute - J).max())
    part = changed_objectives(State.at(system, rho), change, points)[1]
    np.testing.assert_allclose(part, changed[points], rtol=1e-12)  # fewer loads than unknowns: solved, not inverted


@METHODS
@EVERY
def test_exact_derivative_is_a_dense_complex_step(objective: Compliance | PNormStress, method: str) -> None:
    _, system = subject(objective, method)
    rho = densities(system)
    exact = exact_derivatives(State.at(system, rho))
    for point in (0, 13, 31):
        stepped = rho + 1e-30j * (np.arange(len(rho)) == point)
        u = np.linalg.solve(system.matrix(system.moduli(stepped)).toarray(), system.f)
        match objective:
            case Compliance():
                J = system.f @ u
            case PNormStress(p, q):
                squares = np.sum((system.stress_root @ u).reshape(3, -1) ** 2, axis=0)
                J = np.sum(stepped ** (p * q) * squares ** (p / 2)) ** (1 / p)
        # a small entry beside the largest, whose rounding, by a condition number of 1e4, it has, too
        assert exact[point] == pytest.approx(J.imag / 1e-30, rel=1e-8, abs=1e-12 * np.abs(exact).max())


@METHODS
@EVERY
def test_exact_derivative_is_the_gradient(objective: Compliance | PNormStress, method: str) -> None:
    problem, system = subject(objective, method)
    rho = densities(system)
    gradient = problem.density_gradient(problem.analyse(rho))
    state = State.at(system, rho)
    np.testing.assert_allclose(exact_derivatives(state), gradient, atol=RTOL * np.abs(gradient).max())
    some = np.array([3, 17])
    np.testing.assert_allclose(exact_derivatives(state, some), gradient[some], atol=RTOL * np.abs(gradient).max())


B_BAR, GHOST = {"b_bar": True}, {"ghost": 0.5}


@EVERY
@pytest.mark.parametrize(
    ("function", "how"),
    [(f, B_BAR) for f in SHAPE_FUNCTIONS] + [(f, how) for f in (tent, gimp) for how in (GHOST, GHOST | B_BAR)],
    ids=lambda value: "+".join(value) if isinstance(value, dict) else value.__name__,
)
def test_exact_derivative_with_b_bar_and_ghost_penalty(
    objective: Any, function: ShapeFunction, how: dict[str, Any]
) -> None:
    """Against the adjoint, where it was off by up to 0.76 of the largest entry, and against a change of K itself."""
    scene = cantilever(8, 4, objective=objective)
    points = discretise(scene.body, 1.0).points.moved((0.3, 0.0))
    model = discretise(scene.body, 1.0, shape_function=function, points=points, **how)
    problem = DesignProblem(model, scene.design, scene.objective)
    system = material_points(problem)
    rho = densities(system)
    state = State.at(system, rho)
    exact = exact_derivatives(state)
    gradient = problem.density_gradient(problem.analyse(rho))
    np.testing.assert_allclose(exact, gradient, atol=RTOL * np.abs(gradient).max())
    if isinstance(objective, Compliance):
        stepped = rho + 1e-30j * (np.arange(len(rho)) == 13)
        u = np.linalg.solve(system.matrix(system.moduli(stepped)).toarray(), system.f)
        assert exact[13] == pytest.approx((system.f @ u).imag / 1e-30, rel=1e-8)
    if "ghost" in how:
        with pytest.raises(ValueError, match="ghost"):
            changed_objectives(state, 0.1)


def test_odd_exponents_are_refused() -> None:
    _, system = subject(PNormStress(p=7.0), "standard")
    with pytest.raises(ValueError, match="even"):
        changed_objectives(State.at(system, densities(system)), 0.1)
