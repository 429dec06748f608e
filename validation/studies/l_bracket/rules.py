"""Update rules of the bracket, and tolerances of the study's locks."""

from mpmtop.optimizers import MMA, SingleStepGCMMA, UpdateRule
from validation.methods.analyser import MOVE, PAPER_RULE

SOLVES = 500
"""Solves each update rule is given for the comparison."""
RULES: dict[str, UpdateRule] = {
    "GCMMA": PAPER_RULE,
    "single-step GCMMA": SingleStepGCMMA(move=MOVE),
    "MMA": MMA(move=MOVE),
}
RTOL_OPTIMUM = 0.03
"""Rounding of another processor is amplified over 250 iterations of an objective with p = 12 and many near-optima,
whose values differ by one to two per cent."""
RTOL_ANALYSIS = 1e-8
"""One analysis of a given design, condition number 1e6."""
