"""Optimisation of a design: problems and update rules by protocol, MMA and GCMMA, optimality criteria, the loop."""

from mpmtop.optimize.checkpoint import CheckpointError, load_checkpoint
from mpmtop.optimize.gcmma import GCMMA, SingleStepGCMMA
from mpmtop.optimize.loop import (
    PAPER_RULE,
    History,
    Iterate,
    StoppingRule,
    design_change,
    optimize,
    relative_change,
)
from mpmtop.optimize.mma import MMA
from mpmtop.optimize.optimality_criteria import OptimalityCriteria
from mpmtop.optimize.protocols import Evaluation, Problem, State, UpdateRule
from mpmtop.optimize.state import initial_state

__all__ = [
    "GCMMA",
    "MMA",
    "PAPER_RULE",
    "CheckpointError",
    "Evaluation",
    "History",
    "Iterate",
    "OptimalityCriteria",
    "Problem",
    "SingleStepGCMMA",
    "State",
    "StoppingRule",
    "UpdateRule",
    "design_change",
    "initial_state",
    "load_checkpoint",
    "optimize",
    "relative_change",
]
