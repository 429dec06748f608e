"""The paper's optima, which several studies need: each is made once in a session."""

from itertools import takewhile

from mpmtop.crossing import Crossing
from mpmtop.optimizers import GCMMA, UpdateRule, optimize
from validation.bodies.scenes import cantilever, l_bracket
from validation.harness.shared import shared
from validation.methods.analyser import METHODS, MOVE, SHAPE_FUNCTIONS, Optimisation, material_points

WARM = GCMMA(move=MOVE, warm_start=True)
"""The rule of the bracket: an inner loop starts at half the last curvature."""
CANTILEVERS, BRACKETS = (5, 10, 20, 40), (10, 30, 60, 120)
"""Iterations whose layout is drawn, besides the last."""


@shared
def optimised_cantilever(name: str, crossing: Crossing | None = None) -> Optimisation:
    """The cantilever by one of METHODS or, with points moved by `crossing`, of SHAPE_FUNCTIONS."""
    build = material_points(SHAPE_FUNCTIONS[name], name, crossing) if crossing else METHODS[name]
    return Optimisation.of(build(cantilever()), keep=CANTILEVERS)


@shared
def optimised_bracket(name: str, rule: UpdateRule = WARM, solves: int | None = None) -> Optimisation:
    """The L-bracket by one of METHODS, in at most so many solves."""
    analyser = METHODS[name](l_bracket())
    iterates = optimize(analyser.problem, rule, max_iterations=500)
    within = takewhile(lambda iterate: solves is None or iterate.solves <= solves, iterates)
    return Optimisation.collect(within, analyser, BRACKETS)
