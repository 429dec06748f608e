"""Designs on finite elements in large deformation: gradients by difference quotients, stresses by the points' law."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest

from mpmtop import plot
from mpmtop.design import Design, Mirror, Projection
from mpmtop.errors import InvalidScene
from mpmtop.large_deformation.law import Hencky, Law, NeoHookean
from mpmtop.large_deformation.law import von_mises as von_mises_of_points
from mpmtop.loads import RegionLoad
from mpmtop.optimizers import GCMMA, optimize
from mpmtop.region import Rectangle
from reference_fem.elasticity import discretise
from reference_fem.large_deformation import LogarithmicLaw, NeoHookeanLaw, PrincipalLaw, large_model, von_mises
from reference_fem.large_design import (
    EndStress,
    LargeDesignProblem,
    PathObjective,
    WeightedCompliance,
    nonlinear_fraction,
)
from reference_fem.simp import DesignProblem
from tests.mpmtop.large_deformation.cases import cantilever

LEVELS = (0.5, 1.0)
OBJECTIVES: tuple[PathObjective, ...] = (
    WeightedCompliance((0.0, 1.0)),
    WeightedCompliance((1.0, 0.5)),
    EndStress(8.0, 0.5),
)
LAWS = [(Hencky(0.3), LogarithmicLaw(0.3)), (NeoHookean(0.3), NeoHookeanLaw(0.3))]


def problem(objective: PathObjective, law: PrincipalLaw = LAWS[0][1], load: float = 4e-3) -> LargeDesignProblem:
    fem = discretise(cantilever(load), 2.0)
    return LargeDesignProblem(DesignProblem(fem, Design(0.5, 3.0)), large_model(fem, law), LEVELS, objective)


@pytest.mark.parametrize("law", [law for _, law in LAWS], ids=lambda law: type(law).__name__)
@pytest.mark.parametrize("objective", OBJECTIVES, ids=lambda o: type(o).__name__)
def test_gradient_is_that_of_difference_quotients(objective: PathObjective, law: PrincipalLaw) -> None:
    """Densities about the step of the nonlinear fraction, too, where void begins."""
    of = problem(objective, law)
    rng = np.random.default_rng(0)
    rho, d = rng.uniform(0.4, 1.0, 50), rng.standard_normal(50)
    rho[:10] = rng.uniform(0.18, 0.26, 10)
    exact = of.density_gradient(of.analyse(rho)) @ d
    h = 1e-6
    J = [of.analyse(rho + t * h * d).objective for t in (-2, -1, 1, 2)]
    quotient = (J[0] - 8 * J[1] + 8 * J[2] - J[3]) / (12 * h)
    assert exact == pytest.approx(quotient, rel=1e-7)  # 1e-16 / h of J, whose slope along d is of its size


def test_designs_are_drawn() -> None:
    of = problem(OBJECTIVES[0])
    axes = plot.design(of.model, of.evaluate(of.x0))
    plt.close(axes.figure)  # type: ignore[arg-type]
    assert axes.get_xlim()[1] >= 20 and axes.get_ylim()[1] >= 10


@pytest.mark.parametrize(("law", "principal"), LAWS)
def test_stress_is_that_of_the_points_law(law: Law, principal: PrincipalLaw) -> None:
    """Two ways: by principal stretches, and by the invariants of F."""
    rng = np.random.default_rng(1)
    F = np.eye(2) + 0.3 * rng.standard_normal((200, 2, 2))
    F = F[np.linalg.det(F) > 0.2]
    vm, by_F = von_mises(principal, F)
    expected, expected_by_F = von_mises_of_points(law, F)
    np.testing.assert_allclose(vm, expected, rtol=1e-11)
    np.testing.assert_allclose(by_F, expected_by_F, rtol=1e-9, atol=1e-10)


def test_void_is_linear_and_may_be_turned_inside_out() -> None:
    """A flange pressed through another one, in the way of which is void alone."""
    g, slope = nonlinear_fraction(np.array([0.0, 0.1, 0.3, 1.0]), 3.0)
    np.testing.assert_allclose(g, [0, 0, 1, 1], atol=2e-4)
    assert np.all(slope >= 0)
    tip = RegionLoad(Rectangle((18.0, 8.0), (20.0, 10.0)), (0.0, -0.01))
    fem = discretise(replace(cantilever(), loads=(tip,)), 2.0)
    of = LargeDesignProblem(DesignProblem(fem, Design(0.8, 3.0)), large_model(fem, LAWS[0][1]), LEVELS, OBJECTIVES[0])
    void = (fem.centres[:, 1] > 2) & (fem.centres[:, 1] < 6)
    at = of.analyse(np.where(void, 1e-3, 1.0))
    J = np.linalg.det(of.model.grad(at.u[-1]) + np.eye(2))
    assert J[void].min() < 0 < 0.5 < J[~void].min()


def test_small_loads_are_those_of_the_linear_problem() -> None:
    of = problem(OBJECTIVES[0], load=1e-9)
    rho = np.random.default_rng(2).uniform(0.0, 1.0, 50)
    large, small = of.analyse(rho), of.linear.analyse(rho)
    assert large.objective == pytest.approx(small.objective, rel=1e-5)
    assert large.constraints == pytest.approx(small.constraints, abs=1e-14)
    np.testing.assert_allclose(of.density_gradient(large), of.linear.density_gradient(small), rtol=1e-4, atol=1e-15)


def test_optimisation_lowers_the_objective() -> None:
    found = list(optimize(problem(OBJECTIVES[0]), GCMMA(), max_iterations=5))
    assert found[-1].objective < 0.6 * found[0].objective
    assert found[-1].constraints[0] <= 1e-9


def test_what_elements_do_not_have_is_refused() -> None:
    of = problem(OBJECTIVES[0])
    with pytest.raises(InvalidScene, match="other elements"):
        LargeDesignProblem(of.linear, large_model(discretise(cantilever(), 2.0), LAWS[0][1]), LEVELS, OBJECTIVES[0])
    averaged = DesignProblem(of.model.fem, Design(0.5, 3.0), filtered="sensitivity")
    with pytest.raises(InvalidScene, match="filtered='density'"):
        LargeDesignProblem(averaged, of.model, LEVELS, OBJECTIVES[0])
    for asked in ({"projection": Projection(2.0)}, {"symmetry": (Mirror((0.0, 5.0), (0.0, 1.0)),)}):
        other = DesignProblem(of.model.fem, replace(Design(0.5, 3.0), **asked))
        with pytest.raises(InvalidScene, match="no projection, symmetry"):
            LargeDesignProblem(other, of.model, LEVELS, OBJECTIVES[0])
