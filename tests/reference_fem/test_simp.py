"""The finite element reference: against scikit-fem itself, published numbers, an independent code, identities."""

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.body import Material
from reference_fem.adjoint import unit_work
from reference_fem.design import density_filter
from reference_fem.simp import DesignProblem, Evaluation, design_problem, simp
from tests.reference_fem.bodies import cantilever, densities, mbb
from validation.bodies.scenes import changed
from validation.measures.derivatives import adjoint_gap, central_difference, taylor_orders


@pytest.mark.parametrize("order", [1, 2])
def test_gradient_by_taylor_remainder(order: int) -> None:
    """Halving the step quarters what the gradient leaves unexplained."""
    problem = design_problem(cantilever(filter_radius=5.0), 2.0, order)
    x, direction = densities(200), densities(200, seed=2) - 0.6
    evaluation = problem.evaluate(x)
    df0, dg = problem.gradient(evaluation)
    order = taylor_orders(lambda x: problem.evaluate(x).objective, x, direction, df0 @ direction, (0.02, 0.01))
    assert order == pytest.approx(2, abs=0.05)  # a third-order term of relative size of the step, 0.02
    # the volume is linear: exact but for rounding
    moved = problem.evaluate(x + 0.04 * direction)
    assert moved.constraints - evaluation.constraints == pytest.approx(0.04 * dg @ direction, abs=1e-14)


def test_simp_law() -> None:
    """Solid and void take their moduli; the derivative is the central difference."""
    scene = cantilever(contrast=1e-6, material=Material(young=5.0))
    assert simp(np.array([0.0, 1.0]), scene.body.material, scene.design)[0] == pytest.approx([5e-6, 5.0], rel=1e-15)
    rho, h = np.linspace(0.1, 0.9, 9), 1e-5
    difference = central_difference(lambda rho: simp(rho, scene.body.material, scene.design)[0], rho, np.ones(9), h)
    assert simp(rho, scene.body.material, scene.design)[1] == pytest.approx(
        difference, rel=1e-7
    )  # h^2 / 0.1^2 = 1e-8 and round-off 1e-11


def test_filter() -> None:
    """Rows sum to one, larger points weigh more, the weights fall linearly, a small radius filters nothing."""
    rng = np.random.default_rng(3)
    x, volume = rng.uniform(0, 10, (300, 2)), rng.uniform(0.5, 2, 300)
    H = density_filter(x, volume, 1.5)
    assert H.sum(axis=1) == pytest.approx(1, abs=1e-14)  # sums of ten numbers
    row = density_filter(np.array([[0.0, 0], [1, 0], [0, 1], [9, 9]]), np.array([1.0, 1, 2, 1]), 2.0).toarray()[0]
    assert row == pytest.approx(np.array([2, 1, 2, 0]) / 5, abs=1e-15)
    assert np.allclose(density_filter(x, volume, 1e-9).toarray(), np.eye(300), rtol=0, atol=1e-15)  # one division


def test_problem_applies_the_adjoint_filter() -> None:
    """A sum of gradients over physical densities is kept: a uniform change of the design is one of rho."""
    problem = design_problem(cantilever(filter_radius=5.0), 2.0)
    evaluation = problem.evaluate(densities(200))
    df0, dg = problem.gradient(evaluation)
    d_young = simp(evaluation.rho, problem.model.body.material, problem.design)[1]
    assert df0.sum() == pytest.approx(
        -d_young @ unit_work(problem.model, evaluation.u, evaluation.u), rel=1e-13
    )  # row sums of one
    y = densities(200, seed=5)
    assert adjoint_gap(problem.H.__matmul__, problem.H.T.__matmul__, evaluation.rho, y) < 1e-14
    assert dg.sum() == pytest.approx(1 / problem.design.volume_fraction, rel=1e-13)


def test_problem_fingerprint() -> None:
    """Equal problems share it; scene, element size and element order change it."""
    scene = cantilever()
    prints = [
        design_problem(s, size, order).fingerprint
        for s, size, order in [(scene, 2.0, 1), (scene, 2.0, 2), (scene, 1.0, 1), (changed(scene, penal=2.0), 2.0, 1)]
    ]
    assert len(set(prints)) == 4
    assert design_problem(cantilever(), 2.0).fingerprint == prints[0]


def published_update(problem: DesignProblem, x: Array, evaluation: Evaluation) -> Array:
    """Optimality criteria with the bisection of the educational codes (Andreassen et al., 2011), coarse as it is."""
    df0, dg = problem.gradient(evaluation)
    benefit = np.sqrt(-df0 / (problem.design.volume_fraction * len(x) * dg[0]))  # by the derivative of the plain sum
    low, high = 0.0, 1e9
    while high - low > 1e-3 * (low + high):
        middle = (low + high) / 2
        new = np.clip(x * benefit / np.sqrt(middle), np.maximum(0, x - 0.2), np.minimum(1, x + 0.2))
        low, high = (middle, high) if (problem.H @ new).mean() > problem.design.volume_fraction else (low, middle)
    return new


def test_published_mbb_beam() -> None:
    """Half MBB beam, 60 x 20, density filter 2.4: 233.71457, the last objective printed by the 165-line Python code.

    It prints the objective of the design before the update that changes no density by more than 0.01.
    """
    problem = design_problem(mbb(), 1.0)
    x, change = problem.x0, 1.0
    first = problem.evaluate(x).objective
    while change > 0.01:
        evaluation = problem.evaluate(x)
        new = published_update(problem, x, evaluation)
        x, change = new, np.abs(new - x).max()
    # half a unit of the last digit given
    assert first == pytest.approx(1007.0221007, abs=5e-8)
    assert evaluation.objective == pytest.approx(233.71457, abs=5e-6)
