"""A projection that keeps the volume, sharpened by rules that take what move they like."""

from dataclasses import replace

import numpy as np
import pytest

from mpmtop.body import Material
from mpmtop.design import Projection
from mpmtop.optimizers import GCMMA, MMA, OptimalityCriteria, Stage, UpdateRule, continuation
from mpmtop.planning import plan
from mpmtop.problem import design_problem
from mpmtop.projection import project
from reference_fem.simp import design_problem as by_elements
from tests.scenes import cantilever

BETAS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
SCENE = cantilever(60, 30, material=Material(plane="stress"), filter_radius=6.0)


@pytest.mark.parametrize(
    ("rule", "elements"),
    [(MMA(0.1), True), (MMA(0.5), False), (GCMMA(0.2), False), (OptimalityCriteria(0.2), False)],
    ids=["MMA, elements", "MMA", "GCMMA", "optimality criteria"],
)
def test_sharpened_to_the_end(rule: UpdateRule, elements: bool) -> None:
    """Without `largest_move` MMA ends at compliances of 240 and above, at a volume of 88 %, optimality criteria hang
    on void. A fixed threshold comes to 79.0 on finer elements."""
    problem = by_elements(SCENE, 2.0) if elements else design_problem(SCENE, 4.0, 2)
    designs = [replace(SCENE.design, projection=Projection(beta, preserve_volume=True)) for beta in BETAS]
    stages = [Stage(replace(problem, design=design), rule, max_iterations=25) for design in designs]
    best = np.inf
    for iterate in continuation(stages):
        if iterate.outcome != "running":
            assert iterate.objective < best and abs(iterate.constraints[0]) < 1e-3
            best = iterate.objective
    rho = iterate.evaluation.rho
    assert best < 80.0 and 4 * np.mean(rho * (1 - rho)) < 0.12


@pytest.mark.parametrize("beta", [16.0, 64.0])
def test_the_largest_move_is_that_of_the_threshold(beta: float) -> None:
    """By a move of all variables alike a sharp threshold moves by about as much."""
    r = np.random.default_rng(0).uniform(0.3, 0.6, 200)
    volume, projection = np.full(200, 0.5), Projection(beta, preserve_volume=True)
    follows = project(projection, r, volume).threshold_by_r
    assert follows is not None and follows.sum() == pytest.approx(1, abs=0.35)
    assert projection.largest_move == pytest.approx(0.4 / beta)


def test_said_in_the_plan_and_for_this_projection_only() -> None:
    sharp = replace(SCENE, design=replace(SCENE.design, projection=Projection(32.0, preserve_volume=True)))
    assert "threshold that keeps the volume, moves of 0.0125 at most" in plan(design_problem(sharp, 4.0))
    fixed = design_problem(replace(SCENE, design=replace(SCENE.design, projection=Projection(32.0))), 4.0)
    assert fixed.largest_move == 1.0 and "moves of" not in plan(fixed)
