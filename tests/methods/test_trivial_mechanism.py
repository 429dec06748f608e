"""The trivial design of a mechanism, in both solvers: nothing connects the output with the loads."""

import warnings
from typing import Any

import numpy as np
import pytest

from mpmtop.body import Body, Material, Spring, Support
from mpmtop.criteria import Displacement, NothingMoves
from mpmtop.design import Design
from mpmtop.loads import PositionLoad
from mpmtop.optimizers import MMA, optimize
from mpmtop.problem import design_problem
from mpmtop.region import Rectangle
from mpmtop.scene import LoadCase, Scene
from reference_fem.simp import design_problem as of_elements

BOX = Rectangle((0, 0), (8, 4))
SUPPORTS = (
    Support(Rectangle((0, 0), (0, 1))),
    Support(Rectangle((0, 4), (8, 4)), (False, True)),
    Spring((0, 4), 0.1, (1, 0)),
    Spring((8, 4), 0.1, (1, 0)),
)
PUSH = PositionLoad((0, 4), (1.0, 0.0))
SCENE = Scene(
    "inverter",
    Body(BOX, SUPPORTS, (PUSH,), Material(plane="stress")),
    Design(0.5, 1.0, penal=3.0, contrast=1e-9),
    Displacement((8, 4), (1, 0)),
)


@pytest.mark.parametrize("made", [design_problem, of_elements], ids=["points", "elements"])
def test_a_design_that_connects_nothing_is_named(made: Any) -> None:
    """Material at the input only; a connected design is passed over, and so is one of load cases."""
    problem = made(SCENE, 1.0)
    apart = np.where(problem.positions[:, 0] < 3, 1.0, problem.lower)
    rule = MMA(0.2)
    with pytest.warns(NothingMoves, match="nothing connects") as said:
        list(optimize(problem, rule, start=apart, max_iterations=0))
    assert len(said) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        list(optimize(problem, rule, max_iterations=0))
    several = made(Scene("cases", Body(BOX, SUPPORTS), SCENE.design, SCENE.objective, cases=(LoadCase((PUSH,)),)), 1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        list(optimize(several, rule, start=apart, max_iterations=0))
