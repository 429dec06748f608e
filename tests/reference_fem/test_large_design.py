"""Designs on finite elements in large deformation: gradients by difference quotients, stresses by the points' law."""

from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import meshio
import numpy as np
import pytest

from mpmtop import export, plot
from mpmtop.design import Design, Mirror, Projection
from mpmtop.errors import InvalidScene
from mpmtop.fields import SCALARS, fields
from mpmtop.grid import Grid
from mpmtop.large_deformation.at_points import fields_of_steps
from mpmtop.large_deformation.law import Hencky, Law, NeoHookean
from mpmtop.large_deformation.law import von_mises as von_mises_of_points
from mpmtop.large_deformation.model import discretise as discretise_points
from mpmtop.large_deformation.steps import trajectory
from mpmtop.loads import RegionLoad
from mpmtop.optimizers import GCMMA, optimize
from mpmtop.points import seed, to_gauss_points
from mpmtop.region import Rectangle
from mpmtop.shape_functions import tent
from reference_fem.at_large_elements import LargeState
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


def test_designs_are_drawn_and_written(tmp_path: Path) -> None:
    of = problem(OBJECTIVES[0])
    at = of.evaluate(of.x0)
    for axes in (plot.design(of.model, at), *(plot.field(of.model, at, name) for name in SCALARS)):
        assert axes.get_xlim()[1] >= 20 and axes.get_ylim()[1] >= 10
        plt.close(axes.figure)  # type: ignore[arg-type]
    moved = next(c for c in plot.deformed(of.model, at, scale=1.0).collections if c.get_array() is not None)
    tip = max(path.vertices[:, 0].max() for path in moved.get_paths())
    plt.close(moved.figure)  # type: ignore[arg-type]
    assert tip == pytest.approx(20 + at.u[-1][of.model.basis.nodal_dofs[0]].max(), abs=0.5)
    export.write_nodes(tmp_path / "nodes.vtu", of.model, at.state, at.rho)
    written = meshio.read(tmp_path / "nodes.vtu").point_data
    np.testing.assert_allclose(written["reaction"].sum(axis=0), -written["load"].sum(axis=0), atol=1e-12)
    assert written["load"].sum() == pytest.approx(of.model.fem.f_ext.sum())


@pytest.mark.parametrize(("law", "principal"), LAWS)
def test_fields_are_those_of_points_at_gauss_points(law: Law, principal: PrincipalLaw) -> None:
    """Stress, strain and displacement of the points of the total Lagrangian scheme, in the mean over four: those of an
    element of the same displacements."""
    body = replace(cantilever(0.15), loads=(RegionLoad(Rectangle((18.0, 0.0), (20.0, 10.0)), (0.0, -0.15)),))
    points = to_gauss_points(seed(body.domain, (1.0, 1.0)))
    how = {"steps": 6, "frame": "total", "alpha": 0.0, "law": law, "grid": Grid((0, 0), (2, 2), (10, 5))}
    of_points = discretise_points(body, shape_function=tent, points=points, **how)  # type: ignore[arg-type]
    path = trajectory(of_points, np.ones(200), tol=1e-13)
    expected = fields_of_steps(of_points, path, np.ones(200))
    model = large_model(discretise(body, 2.0), principal)
    node = np.rint(model.basis.mesh.p.T / 2).astype(int)
    nodal = sum(step.u for step in path.increments)[np.ravel_multi_index(node.T, (11, 6))]
    u = np.zeros(model.basis.N)
    u[model.basis.nodal_dofs] = nodal.T
    found = fields(model, LargeState(u, np.ones(50), np.ones(50)), np.ones(50))
    element = np.ravel_multi_index((points.x // 2).astype(int).T, (10, 5))
    order = np.ravel_multi_index((model.fem.centres // 2).astype(int).T, (10, 5))
    for name in ("stress", "strain", "displacement"):
        of = getattr(expected, name)
        mean = np.stack([np.bincount(element, column) / 4 for column in of.T], axis=1)[order]
        np.testing.assert_allclose(getattr(found, name), mean, atol=1e-11 * np.abs(of).max(), err_msg=name)
    assert np.abs(found.strain).max() > 0.05
    np.testing.assert_allclose(found.corner_displacement.mean(axis=1), found.displacement, atol=1e-12 * 20)


@pytest.mark.parametrize("order", [1, 2])
def test_fields_of_small_loads_are_those_of_small_strain(order: int) -> None:
    """Of solid, of void that is linear and of what is between, to first order in strains of 1e-6."""
    fem = discretise(cantilever(1e-6), 2.0, order)
    of = LargeDesignProblem(DesignProblem(fem, Design(0.5, 3.0)), large_model(fem, LAWS[1][1]), LEVELS, OBJECTIVES[0])
    rho = np.random.default_rng(3).uniform(0.1, 1.0, 50)
    large, small = of.analyse(rho), of.linear.analyse(rho)
    found, expected = fields(of.model, large.state, rho), fields(fem, small.state, rho)
    names = ("displacement", "corner_displacement", "nodal_displacement", "reaction")
    for name in (*names, "stress", "strain") if order == 1 else names[1:]:  # a mean of quadratics is not at the centre
        scale = np.abs(getattr(expected, name)).max()
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-4 * scale, err_msg=name)


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
