"""Methods on scenes whose gradients are verified, and how one is."""

import time
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mpmtop.arrays import Array, Index
from mpmtop.model import Model, discretise
from mpmtop.scene import Scene
from mpmtop.shape_functions import gimp, tent
from validation import paper
from validation.bodies.scenes import H, cantilever, l_bracket
from validation.harness.claims import Statement
from validation.oracles.woodbury import State, System, changed_objectives, exact_derivatives


class Stated(NamedTuple):
    """The paper's share of variables whose error is below a bound in percent."""

    bound: float
    share: float
    statement: Statement


SCENES = {"compliance": cantilever(), "p-norm": l_bracket()}
STATED = {
    "compliance": Stated(
        paper.SENSITIVITY_COMPLIANCE_ERROR,
        paper.SENSITIVITY_COMPLIANCE_SHARE.value,
        paper.SENSITIVITY_COMPLIANCE_SHARE,
    ),
    "p-norm": Stated(
        paper.SENSITIVITY_P_NORM_ERROR, paper.SENSITIVITY_P_NORM_SHARE.value, paper.SENSITIVITY_P_NORM_SHARE
    ),
}
SEEDED, CROSSED = "standard and GIMP", ("standard, crossing", "GIMP, crossing")
EPS = paper.SENSITIVITY_STEP.value
SAMPLE = 800
AGREEMENT = 1e-8
"""Rounding 1e-16 times a condition number of 1e6, two digits to spare: the bound of every agreement below."""

Key = tuple[str, str, str]
"""Objective, method, field."""


@dataclass(frozen=True, eq=False)
class Subject:
    """A method on a scene: the problem whose gradient is verified, and the system that verifies it."""

    objective: str
    method: str
    problem: Any
    system: System

    def densities(self, field: str) -> Array:
        """0.4 everywhere, or random in [0.1, 1] (p,)."""
        p = len(self.system.F)
        return np.full(p, 0.4) if field == "uniform" else np.random.default_rng(20).uniform(0.1, 1.0, p)

    def state(self, field: str) -> State:
        """Equilibrium at a field of densities."""
        return State.at(self.system, self.densities(field))


@dataclass(frozen=True, eq=False)
class Verified:
    """Analytic and exact gradient (m,) of the `points` (m,) of a field, and the paper's difference quotients (k,).

    The quotients are those of the points at `differenced` (k,), positions in `points`; none for FEM.
    """

    rho: Array  # (p,)
    points: Index
    gradient: Array
    exact: Array
    largest: float  # |entry| of the whole analytic gradient
    differenced: Index
    quotients: Array
    seconds: float  # of CPU time for the quotients

    @property
    def relative(self) -> Array:
        """|gradient| of the differenced points over the largest entry (k,)."""
        return np.abs(self.gradient[self.differenced]) / self.largest

    @property
    def percent(self) -> Array:
        """Error of the quotients in percent (k,), Eq. (A.2)."""
        return np.abs(self.quotients / self.gradient[self.differenced] - 1) * 100

    @property
    def error(self) -> float:
        """Largest difference of analytic and exact gradient, over the largest entry."""
        return float(np.abs(self.gradient - self.exact).max() / self.largest)

    @property
    def entry_error(self) -> float:
        """Largest relative difference of entries above 1e-6 of the largest one."""
        counted = np.abs(self.exact) > 1e-6 * self.largest
        return float(np.max(np.abs(self.gradient[counted] / self.exact[counted] - 1)))


def crossing_models(scene: Scene) -> dict[str, Model]:
    moved = discretise(scene.body, H, 2).points.moved((0.26 * H, 0.0))
    return {
        name: discretise(scene.body, H, shape_function=f, points=moved)
        for name, f in zip(CROSSED, (tent, gimp), strict=True)
    }


def verify(subject: Subject, field: str, state: State) -> Verified:
    points = np.arange(len(state.rho))
    stress = subject.objective == "p-norm"
    differenced = sample(points) if stress and subject.method in CROSSED else np.arange(len(points))
    if subject.method == "FEM":
        differenced, quotients, seconds = np.array([], int), np.array([]), 0.0
    else:
        start = time.thread_time()
        J, changed = changed_objectives(state, EPS, differenced)
        quotients, seconds = (changed - J) / EPS, time.thread_time() - start
    gradient = subject.problem.density_gradient(subject.problem.analyse(state.rho))
    return Verified(
        rho=state.rho,
        points=points,
        gradient=gradient[points],
        exact=exact_derivatives(state, points),
        largest=float(np.abs(gradient).max()),
        differenced=differenced,
        quotients=quotients,
        seconds=seconds,
    )


def sample(points: Index) -> Index:
    return np.sort(np.random.default_rng(4).choice(points, SAMPLE, replace=False))
