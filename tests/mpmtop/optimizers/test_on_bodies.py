"""The whole loop on real problems: a published optimum, and a killed run that goes on bit for bit."""

from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from mpmtop.body import Body, Material, Support
from mpmtop.design import Design
from mpmtop.errors import InvalidScene
from mpmtop.loads import PointLoad, PositionLoad
from mpmtop.optimizers import (
    GCMMA,
    MMA,
    CheckpointError,
    OptimalityCriteria,
    SingleStepGCMMA,
    UnresolvedFilter,
    UpdateRule,
    carried,
    design_change,
    optimize,
)
from mpmtop.problem import DesignProblem
from mpmtop.problem import design_problem as points_problem
from mpmtop.region import Rectangle
from mpmtop.scene import Scene
from reference_fem.simp import Filtered, design_problem
from tests.scenes import cantilever


def half_mbb(radius: float = 2.4) -> Scene:
    body = Body(
        Rectangle((0, 0), (60, 20)),
        (Support(Rectangle((0, 0), (0, 20)), (True, False)), Support(Rectangle((60, 0), (60, 0)), (False, True))),
        (PositionLoad((0, 20), (0, -1)),),
        Material(1.0, 0.3, "stress"),
    )
    return Scene("half MBB beam", body, Design(0.5, radius, rho_min=0.0))


@pytest.mark.parametrize(
    ("filtered", "published", "updates"), [("density", 233.71457, 144), ("sensitivity", 216.81366, 106)]
)
def test_half_mbb_beam_by_the_published_optimality_criteria(filtered: Filtered, published: float, updates: int) -> None:
    """60 x 20, filter 2.4, move 0.2, bisection to 1e-3, stop at change 0.01, to half a unit of the last digit given.

    The codes print the objective of the design before the last update. Another implementation of them, SciPy's sparse
    solver under the published element matrix, has the same number of updates and agrees to 3e-11 in each.
    """
    rule, stop = OptimalityCriteria(0.2, bisection=1e-3), design_change(0.01)
    *_, before, last = optimize(design_problem(half_mbb(), 1.0, filtered=filtered), rule, stop=stop)
    assert last.converged
    assert last.iteration == updates
    assert before.objective == pytest.approx(published, abs=5e-6)


def test_half_mbb_beam_with_an_exact_multiplier() -> None:
    """The published codes stop their bisection at 1e-3, hence 3e-5 here, by the density filter."""
    iterates = list(optimize(design_problem(half_mbb(), 1.0), OptimalityCriteria(0.2), stop=design_change(0.01)))
    assert iterates[0].objective == pytest.approx(1007.0221007, abs=5e-8)
    assert iterates[-1].converged
    assert iterates[-1].objective == pytest.approx(233.71457, rel=3e-5)
    np.testing.assert_allclose(iterates[-1].constraints, 0, atol=1e-9)  # the multiplier is exact


def test_the_sensitivity_filter_averages_the_derivative() -> None:
    """At a uniform design it is the row average of x dJ/drho over x; densities are the design. Refusals are named."""
    scene = half_mbb()
    problem, density = design_problem(scene, 1.0, filtered="sensitivity"), design_problem(scene, 1.0)
    at = problem.evaluate(problem.x0)
    np.testing.assert_array_equal(at.rho, problem.x0)
    df, dg = problem.gradient(at)
    d_rho = problem.density_gradient(at)
    np.testing.assert_allclose(df, problem.H @ d_rho, rtol=1e-12)  # rounding
    assert dg.sum() == pytest.approx(1 / scene.design.volume_fraction, rel=1e-12)
    assert problem.fingerprint != density.fingerprint
    for wrong in ({"filtered": "both"}, {"filtered": "sensitivity", "filter_passive": True}):
        with pytest.raises(InvalidScene, match="filter"):
            design_problem(scene, 1.0, **wrong)  # type: ignore[arg-type]


def test_levels_end_at_the_fine_problem_and_resolve_the_filter() -> None:
    """Coarse designs go over by position: uniform refinement keeps the mean; too coarse a level is refused."""
    scene = cantilever(20, 10, load=PointLoad((20, 5), (0, -1)), filter_radius=1.5)
    coarse, fine = (points_problem(scene, h) for h in (2.0, 1.0))
    x = np.random.default_rng(0).uniform(0.2, 0.6, len(coarse.x0))
    there = carried(coarse, x, fine)
    np.testing.assert_allclose(there.mean(), x.mean(), rtol=1e-12)  # rounding
    quarter = np.all(np.abs(fine.positions - coarse.positions[7]) < 0.5, axis=1)  # the fine ones of a coarse one's cell
    assert np.count_nonzero(quarter) == 4
    np.testing.assert_array_equal(there[quarter], x[7])
    iterates = list(optimize(fine, MMA(), levels=[coarse], max_iterations=15))
    first = next(i for i in iterates if i.stage == 1)
    ends = [i for i in iterates if i.outcome != "running"]
    assert [i.stage for i in ends] == [0, 1]
    np.testing.assert_array_equal(first.x, carried(coarse, ends[0].x, fine))
    straight = list(optimize(fine, MMA(), max_iterations=15))
    assert first.objective < 0.5 * straight[0].objective  # most is done before
    assert [i.solves for i in iterates] == list(range(1, len(iterates) + 1))
    with pytest.raises(UnresolvedFilter, match=r"level 0.*1\.5 of its spacings 2"):
        optimize(fine, MMA(), levels=[points_problem(scene, 2.0, 1)])
    with pytest.raises(UnresolvedFilter):  # 1.5 spacings are enough, 1.4 are not
        optimize(fine, MMA(), levels=[points_problem(cantilever(20, 10, filter_radius=1.4), 2.0)])


def test_a_start_may_be_a_function_of_position() -> None:
    problem = points_problem(cantilever(), 1.0)
    first = next(optimize(problem, MMA(), start=lambda x: 0.2 + 0.02 * x[:, 0]))
    np.testing.assert_array_equal(first.x, 0.2 + 0.02 * problem.model.points.x[:, 0])


RULES = [GCMMA(), GCMMA(warm_start=True), SingleStepGCMMA(), MMA(), OptimalityCriteria()]


@pytest.mark.parametrize("rule", RULES, ids=repr)
def test_resumed_cantilever_is_the_same_bit_for_bit(rule: UpdateRule, tmp_path: Path) -> None:
    """Interrupted after iterations 1, 4 and 9, each time with all objects built anew, as after a kill."""

    def problem() -> DesignProblem:
        return points_problem(cantilever(), 1.0)

    whole = list(optimize(problem(), rule, max_iterations=14))
    file = tmp_path / "run.npz"
    for iterations in (2, 4, 6):
        list(islice(optimize(problem(), rule, max_iterations=14, checkpoint=file), iterations))
    *_, last = optimize(problem(), rule, max_iterations=14, checkpoint=file)
    assert (last.iteration, last.solves) == (whole[-1].iteration, whole[-1].solves)
    assert last.objective == whole[-1].objective
    np.testing.assert_array_equal(last.x, whole[-1].x)
    other = points_problem(cantilever(filter_radius=2.0), 1.0)
    with pytest.raises(CheckpointError, match="another problem"):
        next(iter(optimize(other, rule, checkpoint=file)))
