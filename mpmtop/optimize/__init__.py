"""Optimisation of a design: problems and update rules by protocol, MMA and GCMMA, optimality criteria, the loop."""

from mpmtop.optimize.checkpoint import CheckpointError
from mpmtop.optimize.gcmma import GCMMA, SingleStepGCMMA
from mpmtop.optimize.loop import FEASIBLE, Infeasible, Iterate, Outcome, Stage, continuation, optimize
from mpmtop.optimize.mma import MMA
from mpmtop.optimize.optimality_criteria import OptimalityCriteria
from mpmtop.optimize.protocols import Evaluation, Problem, State, UpdateRule
from mpmtop.optimize.start import Placed, Start, UnresolvedFilter, carried
from mpmtop.optimize.state import initial_state
from mpmtop.optimize.stopping import PAPER_RULE, History, StoppingRule, design_change, relative_change

__all__ = [
    "FEASIBLE",
    "GCMMA",
    "MMA",
    "PAPER_RULE",
    "CheckpointError",
    "Evaluation",
    "History",
    "Infeasible",
    "Iterate",
    "OptimalityCriteria",
    "Outcome",
    "Placed",
    "Problem",
    "SingleStepGCMMA",
    "Stage",
    "Start",
    "State",
    "StoppingRule",
    "UnresolvedFilter",
    "UpdateRule",
    "carried",
    "continuation",
    "design_change",
    "initial_state",
    "optimize",
    "relative_change",
]
