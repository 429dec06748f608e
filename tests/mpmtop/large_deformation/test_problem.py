"""The design problem: gradient through filter and SIMP, optimisation, checkpoints, bad designs by name."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpmtop.design import Design, Mirror, Projection
from mpmtop.errors import InvalidScene, LoadOutsideBody
from mpmtop.grid import Grid
from mpmtop.large_deformation.law import NeoHookean
from mpmtop.large_deformation.model import discretise
from mpmtop.large_deformation.objectives import EndCompliance, EndStress, PathCompliance, PathObjective
from mpmtop.large_deformation.problem import LoadStepProblem
from mpmtop.optimizers import GCMMA, optimize
from mpmtop.region import Rectangle
from mpmtop.shape_functions import tent
from tests.mpmtop.large_deformation.cases import cantilever
from validation.measures.derivatives import taylor_orders

OBJECTIVES: tuple[PathObjective, ...] = (EndCompliance(), PathCompliance(), EndStress(8.0, 0.5))


DESIGN = Design(volume_fraction=0.5, filter_radius=3.0, passive_solid=Rectangle((18, 2), (20, 8)))


MIDDLE = Mirror((0.0, 5.0), (0.0, 1.0))


def problem(objective: PathObjective | None = None, **how: object) -> LoadStepProblem:
    """The cantilever, solid at its tip, under a load that moves the tip by a tenth of the length at first."""
    box = Grid((-8.0, -20.0), (2.0, 2.0), (20, 23))
    model = discretise(cantilever(4e-3), **({"steps": 2, "grid": box} | how))  # type: ignore[arg-type]
    return LoadStepProblem(model, DESIGN, objective or EndCompliance())


@pytest.mark.parametrize("objective", OBJECTIVES, ids=lambda o: type(o).__name__)
def test_taylor_remainder_is_of_second_order(objective: PathObjective) -> None:
    of = problem(objective, domains="stretched")
    rng = np.random.default_rng(0)
    x, d = rng.uniform(0.4, 0.8, len(of.x0)), rng.standard_normal(len(of.x0))
    at = of.evaluate(x)
    dJ, dg = of.gradient(at)
    assert np.all(taylor_orders(lambda x: of.evaluate(x).objective, x, d, dJ @ d, (1e-3, 5e-4, 2.5e-4)) > 1.9)
    there = of.evaluate(x + 1e-3 * d)
    assert there.constraints[0] - at.constraints[0] == pytest.approx(1e-3 * dg[0] @ d, rel=1e-9)


def test_projection_and_symmetry_have_their_part_in_the_gradient() -> None:
    design = replace(DESIGN, projection=Projection(3.0, preserve_volume=True), symmetry=(MIDDLE,))
    of = LoadStepProblem(problem().model, design)
    rng = np.random.default_rng(1)
    x, d = rng.uniform(0.4, 0.8, len(of.x0)), rng.standard_normal(len(of.x0))
    at = of.evaluate(x)
    dJ, _ = of.gradient(at)
    assert 2 * len(x) == len(of.space.active)
    assert np.all(taylor_orders(lambda x: of.evaluate(x).objective, x, d, dJ @ d, (1e-3, 5e-4, 2.5e-4)) > 1.9)
    points = of.grid_points.x
    image = np.hypot(*(points[:, None] - MIDDLE.image(points)).transpose(2, 0, 1)).argmin(axis=1)
    np.testing.assert_allclose(at.rho, at.rho[image], rtol=0, atol=1e-14)


def test_optimisation_lowers_the_objective_and_resumes_bit_for_bit(tmp_path: Path) -> None:
    of = problem()
    straight = list(optimize(of, GCMMA(), max_iterations=6))
    assert straight[-1].objective < 0.6 * straight[0].objective
    assert straight[-1].constraints[0] <= 1e-9
    file = tmp_path / "run.npz"
    list(optimize(of, GCMMA(), max_iterations=3, checkpoint=file))
    resumed = list(optimize(problem(), GCMMA(), max_iterations=6, checkpoint=file))
    assert resumed[-1].objective == straight[-1].objective
    np.testing.assert_array_equal(resumed[-1].x, straight[-1].x)


def test_fingerprint_tells_problems_apart() -> None:
    model = problem().model
    others = [
        problem(),
        problem(PathCompliance()),
        problem(steps=3),
        problem(domains="stretched"),
        problem(frame="total"),
        problem(alpha=1e-4),
        problem(law=NeoHookean(0.3)),
        LoadStepProblem(replace(model, shape_function=tent), DESIGN),
        LoadStepProblem(replace(model, force=2 * model.force), DESIGN),
        LoadStepProblem(model, replace(DESIGN, filter_radius=2.0)),
        LoadStepProblem(model, replace(DESIGN, penal=2.0)),
        LoadStepProblem(model, replace(DESIGN, projection=Projection(2.0))),
        LoadStepProblem(model, replace(DESIGN, symmetry=(MIDDLE,))),
        LoadStepProblem(model, replace(DESIGN, passive_solid=None)),
    ]
    assert len({p.fingerprint for p in others}) == len(others)
    assert problem().fingerprint == problem().fingerprint


def test_start_meets_the_constraint() -> None:
    of = problem()
    assert of.evaluate(of.x0).constraints[0] == pytest.approx(0, abs=1e-12)
    assert np.all(of.filter(of.x0)[of.space.solid] == 1)


@pytest.mark.parametrize(
    ("change", "error", "match"),
    [
        ({"passive_solid": Rectangle((0, 0), (14, 10))}, InvalidScene, "passive solid"),
        ({"passive_solid": None, "passive_void": Rectangle((18, 0), (20, 4))}, LoadOutsideBody, "passive void"),
    ],
)
def test_impossible_designs_are_named(change: dict[str, Rectangle | None], error: type, match: str) -> None:
    with pytest.raises(error, match=match):
        LoadStepProblem(problem().model, replace(DESIGN, **change))  # type: ignore[arg-type]


@pytest.mark.parametrize(("rho", "match"), [(np.ones(3), "one for each"), (np.full(200, 1.2), "outside 0 to 1")])
def test_densities_that_are_none_are_refused(rho: np.ndarray, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        problem().analyse(rho)


def test_load_on_void_names_the_cure() -> None:
    rho = np.where(problem().model.points.x[:, 0] > 18, 0.0, 1.0)
    with pytest.raises(LoadOutsideBody, match="passive_solid"):
        problem().analyse(rho)
