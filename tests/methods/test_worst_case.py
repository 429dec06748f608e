"""The worst of two load cases on a plate: the rules' bound variable is one that is put into the design by hand."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.criteria import Compliance, Worst
from mpmtop.optimizers import GCMMA, MMA, optimize, relative_change
from mpmtop.optimizers.protocols import UpdateRule
from mpmtop.scene import LoadCase
from reference_fem.simp import DesignProblem, Evaluation, design_problem
from validation.studies.tasks.test_tasks import BOTH, SUM

CASES: tuple[LoadCase, ...] = (BOTH[0], replace(BOTH[1], weight=1.5))


@dataclass(frozen=True, eq=False)
class Bounded:
    """z, the volume constraint and w_l C_l / unit - z <= 0 of a design (x, z)."""

    objective: float
    constraints: Array
    inner: Evaluation


@dataclass(frozen=True, eq=False)
class ByHand:
    """Minimise z over (x, z), z <= 2, with both compliances below it, in units of the larger one at the start."""

    problem: DesignProblem
    unit: float
    fingerprint: str = "by hand"

    @property
    def x0(self) -> Array:
        return np.append(self.problem.x0, 1.0)

    @property
    def lower(self) -> Array:
        return np.append(self.problem.lower, 0.0)

    @property
    def upper(self) -> Array:
        return np.append(self.problem.upper, 2.0)

    def evaluate(self, x: Array) -> Bounded:
        inner = self.problem.evaluate(x[:-1])
        return Bounded(float(x[-1]), np.append(inner.constraints, inner.objectives / self.unit - x[-1]), inner)

    def gradient(self, evaluation: Bounded) -> tuple[Array, Array]:
        df, dg = self.problem.gradient(evaluation.inner)
        rows = np.vstack([dg, df / self.unit])
        return np.append(np.zeros(rows.shape[1]), 1.0), np.column_stack([rows, [0.0, -1.0, -1.0]])


@pytest.mark.parametrize("rule", [MMA(0.2), GCMMA(0.2)], ids=["MMA", "GCMMA"])
def test_agrees_with_a_bound_variable_by_hand(rule: UpdateRule) -> None:
    """To 1e-4; and both cases are active."""
    problem = design_problem(replace(SUM, objective=Worst(Compliance()), cases=CASES), 4.0)
    *_, ours = optimize(problem, rule, stop=relative_change(1e-7), max_iterations=400)
    start = problem.evaluate(problem.x0).objective
    *_, hand = optimize(ByHand(problem, start), rule, stop=relative_change(1e-7), max_iterations=400)
    assert ours.objective == pytest.approx(hand.evaluation.inner.objective, rel=1e-4)
    low, high = ours.evaluation.objectives
    assert low == pytest.approx(high, rel=1e-4)
