"""Update rules of the bracket, a run by one of them, and tolerances of the study's locks."""

from itertools import takewhile

from mpmtop.optimizers import GCMMA, MMA, SingleStepGCMMA, UpdateRule, optimize
from validation.bodies.scenes import l_bracket
from validation.methods.analyser import METHODS, MOVE, PAPER_RULE, Optimisation

WARM = GCMMA(move=MOVE, warm_start=True)
SOLVES = 500
"""Solves each update rule is given for the comparison."""
RULES: dict[str, UpdateRule] = {
    "GCMMA": PAPER_RULE,
    "single-step GCMMA": SingleStepGCMMA(move=MOVE),
    "MMA": MMA(move=MOVE),
}
SHOWN = (10, 30, 60, 120)
RTOL_OPTIMUM = 0.03
"""Rounding of another processor is amplified over 250 iterations of an objective with p = 12 and many near-optima,
whose values differ by one to two per cent."""
RTOL_ANALYSIS = 1e-8
"""One analysis of a given design, condition number 1e6."""


def optimise(method: str, rule: UpdateRule, solves: int | None) -> Optimisation:
    """One run, of at most so many solves; a function of the module, for joblib."""
    analyser = METHODS[method](l_bracket())
    iterates = optimize(analyser.problem, rule, max_iterations=500)
    return Optimisation.collect(takewhile(lambda i: solves is None or i.solves <= solves, iterates), analyser, SHOWN)
