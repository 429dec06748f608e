"""Optimisation of a design: problems and update rules by protocol, MMA and GCMMA, optimality criteria, the loop."""

from mpmtop.optimizers.checkpoint import CheckpointError
from mpmtop.optimizers.gcmma import GCMMA, SingleStepGCMMA
from mpmtop.optimizers.loop import FEASIBLE, Infeasible, Iterate, Outcome, Stage, continuation, optimize
from mpmtop.optimizers.mma import MMA
from mpmtop.optimizers.optimality_criteria import OptimalityCriteria
from mpmtop.optimizers.protocols import Evaluation, Problem, State, UpdateRule
from mpmtop.optimizers.start import Placed, Start, UnresolvedFilter, carried
from mpmtop.optimizers.state import initial_state
from mpmtop.optimizers.stopping import PAPER_RULE, History, StoppingRule, design_change, relative_change

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
