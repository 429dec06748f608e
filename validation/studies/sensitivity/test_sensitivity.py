"""Sensitivities (Appendix, Fig. 20)

Derivatives by the density of a point, with no filter in between: compliance of the cantilever (3,200 points) and p-norm
stress of the L-bracket (6,400 points, p = 12, q = 0.5). Methods: **standard** MPM and **GIMP**, as seeded and **with
crossing** (all points moved by 0.26h in x), and **FEM**. Fields: uniform 0.4, and random in [0.1, 1].

A perturbed density changes K by a matrix of low rank, so one factorisation serves the perturbations of all variables
(Sherman-Morrison-Woodbury). The **exact derivative** is the direct one, not the adjoint: the displacement's from the
low-rank change of K, those of SIMP, von Mises stress and p-norm by complex step, without step size or cancellation;
a fully complex analysis checks it for a sample. Every variable of every case is verified by it. Every variable is
differenced, but for the p-norm with crossing: there it is 800 of the 6,400, drawn at random, which keeps the study
within 20 s. FEM is not differenced, nor is it by the paper.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import scipy.sparse as sp
from joblib import Parallel, delayed
from matplotlib.axes import Axes
from scipy.sparse.linalg import splu

from mpmtop.arrays import Array, Index
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.model import Model, discretise
from mpmtop.problem import DesignProblem
from mpmtop.scene import Scene
from mpmtop.shape_functions import gimp, tent
from reference_fem.simp import design_problem
from validation import paper
from validation.bodies.scenes import SPACING, H, cantilever, l_bracket
from validation.harness.claims import Statement
from validation.harness.report import Report
from validation.methods.analyser import JOBS
from validation.oracles.woodbury import (
    STEP,
    State,
    System,
    changed_objectives,
    exact_derivatives,
    finite_elements,
    material_points,
)

# points are moved off the clamp and over grid lines on purpose
pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

ASKED = "Are the gradients exact, with crossing and without, and what is the error that the paper reports?"


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


@pytest.fixture(scope="module")
def subjects() -> dict[tuple[str, str], Subject]:
    every = {}
    for objective, scene in SCENES.items():
        for method, model in ({SEEDED: discretise(scene.body, H, 2)} | crossing_models(scene)).items():
            problem = DesignProblem(model, scene.design, scene.objective)
            every[objective, method] = Subject(objective, method, problem, material_points(problem))
        fem = design_problem(scene, SPACING)
        every[objective, "FEM"] = Subject(objective, "FEM", fem, finite_elements(fem))
    return every


@pytest.fixture(scope="module")
def uniform(subjects: dict[tuple[str, str], Subject]) -> dict[str, State]:
    """Uniform fields without crossing, which several sections use."""
    return {objective: subjects[objective, SEEDED].state("uniform") for objective in SCENES}


@pytest.fixture(scope="module")
def verified(subjects: dict[tuple[str, str], Subject], uniform: dict[str, State]) -> dict[Key, Verified]:
    def case(objective: str, method: str, field: str) -> Verified:
        shared = method == SEEDED and field == "uniform"
        subject = subjects[objective, method]
        return verify(subject, field, uniform[objective] if shared else subject.state(field))

    keys = [(*key, field) for key in subjects for field in ("uniform", "random")]
    # threads suffice, most of it is matrix products; the longest cases first
    done = Parallel(n_jobs=JOBS, prefer="threads")(delayed(case)(*key) for key in reversed(keys))
    return dict(zip(keys, reversed(done), strict=True))


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


def test_identical_operators(report: Report) -> None:
    """Without crossing standard MPM and GIMP are one method

    A domain inside its cell gives Eq. (7) the values of Eq. (6). What follows is therefore computed once for both.
    """
    holds = [
        report.check(
            f"operators and load of standard and GIMP are equal bit for bit, {scene.name}",
            equal(discretise(scene.body, H, 2, tent), discretise(scene.body, H, 2, gimp)),
            True,
            source=paper.IDENTICAL,
        )
        for scene in SCENES.values()
    ]
    assert all(holds)


def equal(a: Model, b: Model) -> bool:
    operators = [
        (a.transfer.B, b.transfer.B),
        (a.transfer.N_matrix, b.transfer.N_matrix),
        (a.stiffness.data_map, b.stiffness.data_map),
    ]
    arrays = [(getattr(x, part), getattr(y, part)) for x, y in operators for part in ("data", "indices", "indptr")]
    return all(np.array_equal(x, y) for x, y in [*arrays, (a.f_ext, b.f_ext), (a.stiffness.dof, b.stiffness.dof)])


@pytest.mark.slow
def test_forward_difference(report: Report, verified: dict[Key, Verified]) -> None:
    """The paper's check: forward differences (Fig. 20)

    Eqs. (A.1) and (A.2) with a step of 1e-4 in the density: error in percent of the analytic gradient.
    """
    rows = [
        {
            "objective": objective,
            "method": method,
            "field": field,
            "variables": len(v.differenced),
            "bound [%]": STATED[objective].bound,
            "share below [%]": round(100 * float(np.mean(v.percent < STATED[objective].bound)), 1),
            "median error [%]": float(np.median(v.percent)),
        }
        for (objective, method, field), v in verified.items()
        if method != "FEM"
    ]
    report.table("difference", pd.DataFrame(rows), "Errors of the forward difference, and the paper's bound.", 3)

    figure, axes = plt.subplots(2, 1, figsize=(5.0, 5.8))
    holds = []
    for ax, (objective, stated) in zip(axes, STATED.items(), strict=True):
        cases = {method: verified[objective, method, "uniform"].percent for method in (SEEDED, *CROSSED)}
        share = float(np.mean(cases[SEEDED] < stated.bound))
        draw_histogram(ax, cases, stated)
        ax.set(title=f"{objective}: {100 * share:.1f} % under {stated.bound} % (paper {100 * stated.share:.2f} %)")
        claim = f"share of {objective} variables under {stated.bound} %, uniform 0.4, no crossing"
        report.check(claim, round(share, 3), at_least=stated.share, source=stated.statement, why="the paper's share")
        if objective == "compliance":
            holds.append(report.check(f"{claim}: our bound", round(share, 3), at_least=0.99, source="our bound"))
    axes[0].legend(loc="upper left")
    axes[1].set(xlabel="error of the forward difference [%]")
    report.figure(
        "histogram",
        figure,
        "Errors at uniform 0.4. The grey line is the paper's bound, the share in the title that without crossing.",
    )
    assert all(holds)


def draw_histogram(ax: Axes, cases: dict[str, Array], stated: Stated) -> None:
    bins = (stated.bound * np.logspace(-4 if stated.bound > 0.1 else -2, 1, 61)).tolist()
    for (name, percent), style in zip(cases.items(), ("-", "--", ":"), strict=True):
        weights = np.full(len(percent), 100 / len(percent))
        ax.hist(
            np.clip(percent, bins[0], bins[-1]), bins, weights=weights, histtype="step", label=name, linestyle=style
        )
    ax.axvline(stated.bound, color="0.4", linewidth=1, linestyle="-")
    ax.set(xscale="log", ylabel="variables [%]")


@pytest.mark.slow
def test_truncation(report: Report, verified: dict[Key, Verified], uniform: dict[str, State]) -> None:
    """Whose error it is: the quotient's

    **Compliance.** Expanded in eps, the quotient's error is (eps/rho) |1 - 3x|, where x, between 0 and 1, is the part
    of the stiffness against the point's strain that is its own: less than 2 eps/rho for every variable, however
    small its gradient. At rho = 0.4 eps/rho is 0.025 %, at 0.1 it is 0.1 %: hence the lower shares of the random field.
    The shape function's gradient, which the paper's appendix blames, has no part in it.

    **p-norm.** The derivative passes through zero between points that relieve the peak stress and points that raise it.
    The second derivative need not vanish there, so that the error, eps J''/2J', has no bound. The few variables above
    0.3 % with a larger gradient lie next to the re-entrant corner, where the p-norm is most curved. At the random field
    the smallest gradients differ because J is rounded, the others by truncation.
    """
    draw_gradient_size(report, verified)
    errors = [
        (v.percent / 100 * v.rho / EPS)[v.relative > 1e-6]
        for (objective, method, _), v in verified.items()
        if objective == "compliance" and method != "FEM"
    ]
    bounded = report.check(
        "compliance: largest error over eps/rho of entries above 1e-6 of the largest, all fields, crossing or not",
        round(float(max(error.max() for error in errors)), 2),
        at_most=2.0,
        source="expansion of the quotient",
    )

    v = verified["p-norm", SEEDED, "uniform"]
    above = np.flatnonzero(v.percent >= STATED["p-norm"].bound)
    report.check("p-norm: variables above 0.3 %, of 6,400", len(above), source="uniform 0.4, no crossing")
    small = report.check(
        "p-norm: share of these whose gradient is below 1e-4 of the largest",
        round(float(np.mean(v.relative[above] < 1e-4)), 2),
        at_least=0.9,
        source="gradient nearly zero",
    )
    report.check(
        "p-norm: largest gradient among them over the largest of all",
        round(float(v.relative[above].max()), 3),
        source="gradient nearly zero",
    )
    J, changed = changed_objectives(uniform["p-norm"], 10 * EPS, above)
    coarse = 100 * np.abs((changed - J) / (10 * EPS) / v.gradient[above] - 1)
    falls = report.check(
        "p-norm: factor by which their error falls from step 1e-3 to 1e-4 (median)",
        round(float(np.median(coarse / v.percent[above])), 1),
        10.0,
        rtol=0.05,  # the next order of the expansion at 1e-3
        source="truncation is proportional to the step",
    )
    exact = report.check(
        "p-norm: their analytic and exact derivatives agree to 1e-5 of their own size",
        bool(np.all(np.abs(v.gradient / v.exact - 1)[above] <= 1e-5)),
        True,
        source="complex step",
    )
    assert bounded and small and falls and exact


def draw_gradient_size(report: Report, verified: dict[Key, Verified]) -> None:
    figure, axes = plt.subplots(2, 1, figsize=(5.0, 6.2))
    for ax, (objective, stated) in zip(axes, STATED.items(), strict=True):
        v = verified[objective, SEEDED, "uniform"]
        ax.loglog(v.relative, v.percent, ".", markersize=2.5, rasterized=True)
        ax.axhline(stated.bound, color="0.4", linewidth=1, linestyle="-", label=f"paper's bound, {stated.bound} %")
        ax.set(title=objective, ylabel="error [%]")
        ax.legend(loc="upper right")
    axes[0].set(ylim=(1e-3, 1e-1))
    axes[1].set(xlabel="gradient over the largest gradient")
    report.figure(
        "gradient_size",
        figure,
        "Error of the forward difference by size of the gradient, uniform 0.4, no crossing: bounded for compliance; "
        "for the p-norm large where the gradient is nearly zero.",
    )


ERRORS: dict[str, Callable[[Verified], float]] = {
    "relative to the largest entry": lambda v: v.error,
    "entry by entry, above 1e-6 of the largest": lambda v: v.entry_error,
}


@pytest.mark.slow
def test_exact_derivative(report: Report, verified: dict[Key, Verified]) -> None:
    """Analytic against exact derivative

    Both with the discretisation's own K, each with a factorisation of its own.
    """
    table = pd.DataFrame.from_dict(
        {
            key: {"variables": len(v.points)} | {of: bound_met(error(v)) for of, error in ERRORS.items()}
            for key, v in verified.items()
        },
        orient="index",
    )
    report.table(
        "exact",
        table.rename_axis(["objective", "method", "field"]),
        "Decade that bounds the largest difference of analytic and exact derivative.",
    )
    worst = {of: max(error(v) for v in verified.values()) for of, error in ERRORS.items()}
    report.found(
        "All gradients are exact: the largest difference to the complex step is "
        f"{bound_met(max(worst.values()))}, "
        "with crossing and without."
        if max(worst.values()) <= AGREEMENT
        else f"Gradients differ from the complex step by {max(worst.values()):.1e}."
    )
    report.so("The errors that the paper reports are those of its finite differences.")
    holds = [
        report.check(
            f"{objective}: analytic and exact derivative within 1e-8, {of}, all methods and fields",
            all(error(v) <= AGREEMENT for key, v in verified.items() if key[0] == objective),
            True,
            source="complex step",
        )
        for objective in SCENES
        for of, error in ERRORS.items()
    ]
    assert all(holds)


def bound_met(error: float) -> str:
    """A bound rather than the number, which is rounding and differs from machine to machine."""
    return "below 1e-8" if error <= AGREEMENT else f"above 1e-8: {error:.0e}"


def test_step_size(report: Report, subjects: dict[tuple[str, str], Subject], uniform: dict[str, State]) -> None:
    """Error against step size

    Forward differences as anyone would compute them, with a new analysis for each, of six variables drawn at random.
    What cancels is the rounding of two factorisations; the quotients above, of one, are spared most of it.
    """
    steps = 10.0 ** -np.arange(1, 13)
    figure, ax = plt.subplots(figsize=(5.0, 4.4))
    holds = []
    for objective, marker in zip(SCENES, "os", strict=True):
        problem, rho = subjects[objective, SEEDED].problem, uniform[objective].rho
        at = problem.analyse(rho)
        points = np.random.default_rng(12).choice(len(rho), 6, replace=False)
        gradient = problem.density_gradient(at)[points, None]
        changed = np.array([[reanalysed(problem, rho, p, step) for step in steps] for p in points])
        error = np.median(np.abs((changed - at.objective) / steps / gradient - 1), axis=0)
        ax.loglog(steps, error, marker=marker, label=f"{objective}, forward difference")
        holds += [
            report.check(
                f"{objective}: order of the forward difference's error in the step, 1e-2 to 1e-3",
                round(float(np.log10(error[1] / error[2])), 2),
                1.0,
                rtol=0.05,  # the next order of the expansion at 1e-2
                source="Taylor",
            ),
            report.check(
                f"{objective}: the median error of six variables stays above 1e-8 at every step",
                bool(error.min() > AGREEMENT),
                True,
                source="truncation meets cancellation",
            ),
        ]
    ax.axhline(AGREEMENT, color="0.4", linewidth=1, linestyle="-", label="bound met by the exact derivative")
    ax.axvline(EPS, color="0.4", linewidth=1, linestyle=":", label="the paper's step")
    ax.set(xlabel="step in the density", ylabel="relative error (median)")
    figure.legend(loc="outside upper center")
    report.figure(
        "step_size",
        figure,
        "Truncation falls with the step until cancellation takes over; the exact derivative has neither.",
    )
    assert all(holds)


def reanalysed(problem: Any, rho: Array, point: int, change: float) -> float:
    """J after one density has grown by `change`, by a new analysis."""
    changed = rho.copy()
    changed[point] += change
    return float(problem.analyse(changed).objective)


def test_identities(report: Report, subjects: dict[tuple[str, str], Subject]) -> None:
    """Identities: Euler's and Taylor's

    Compliance is homogeneous of degree -1 in the moduli, so sum E_p dC/dE_p = -C. Along a direction d the remainder
    J(rho + t d) - J - t dJ.d of a correct gradient is of order 2 in t; d is random, towards lower densities.
    """
    rng = np.random.default_rng(3)
    euler, order = [], {}
    for (objective, method), subject in subjects.items():
        rho = subject.densities("random")
        at = subject.problem.analyse(rho)
        gradient = subject.problem.density_gradient(at)
        if objective == "compliance":
            moduli = subject.system.moduli(rho + 1j * STEP)
            euler.append(abs(float(moduli.real / (moduli.imag / STEP) @ gradient) / at.objective + 1))
        direction = -rho * rng.random(len(rho))
        steps = np.array([1e-2, 1e-3])
        moved = np.array([subject.problem.analyse(rho + t * direction).objective for t in steps])
        remainder = np.abs(moved - at.objective - steps * (gradient @ direction))
        order[objective, method] = {"order": round(float(np.log10(remainder[0] / remainder[1])), 2)}
    table = pd.DataFrame.from_dict(order, orient="index").rename_axis(["objective", "method"])
    report.table("taylor", table, "Order of the Taylor remainder between t = 1e-2 and 1e-3, random field.")
    holds = [
        report.check(
            "sum E_p dC/dE_p = -C to 1e-9, all methods, random field",
            max(euler) <= 1e-9,  # rounding times condition number; a sum averages it
            True,
            source="compliance is homogeneous",
        ),
        report.check(
            "largest distance of the Taylor remainder's order from 2, all methods and objectives",
            round(float(np.abs(table["order"] - 2).max()), 2),
            at_most=0.1,  # the third order at t = 1e-2
            source="Taylor",
        ),
    ]
    assert all(holds)


@pytest.mark.slow
def test_woodbury(
    report: Report, subjects: dict[tuple[str, str], Subject], uniform: dict[str, State], verified: dict[Key, Verified]
) -> None:
    """One factorisation for all variables, against one each

    A random sample: the change of J after a density has grown from 0.4 to 0.9, by a new analysis of that design (20
    variables); and the complex step by a complex K, its LU factors, complex stresses and p-norm (8 variables).
    """
    holds = []
    for objective, state in uniform.items():
        problem, v = subjects[objective, SEEDED].problem, verified[objective, SEEDED, "uniform"]
        points = np.random.default_rng(8).choice(len(state.rho), 20, replace=False)
        J, changed = changed_objectives(state, 0.5, points)
        start = time.process_time()
        brute = np.array([reanalysed(problem, state.rho, p, 0.5) for p in points])
        seconds = (time.process_time() - start) / len(points)
        difference = np.abs(changed - J - (brute - problem.analyse(state.rho).objective)) / np.abs(brute - J).max()
        stepped = np.array([complex_step(state, p) for p in points[:8]])
        holds += [
            report.check(
                f"{objective}: change by Woodbury is that of a new analysis, to 1e-8 of the largest",
                bool(np.all(difference <= AGREEMENT)),
                True,
                source="new factorisation",
            ),
            report.check(
                f"{objective}: exact derivative is the complex step of a complex analysis, to 1e-8 of the largest",
                bool(np.all(np.abs(stepped - v.exact[points[:8]]) <= AGREEMENT * np.abs(stepped).max())),
                True,
                source="new factorisation",
            ),
        ]
        report.timing(
            f"{objective}: CPU time of a variable's difference, new analysis over Woodbury",
            seconds / (v.seconds / len(v.differenced)),
            source="for comparison",
        )
    assert all(holds)


def complex_step(state: State, point: int) -> float:
    """dJ/drho_p by a complex analysis of the design with rho_p + ih."""
    system = state.system
    rho = state.rho + 1j * STEP * (np.arange(len(state.rho)) == point)
    u = splu(sp.csc_array(system.matrix(system.moduli(rho)))).solve(system.f.astype(complex))
    match system.objective:
        case Compliance():
            return float(np.imag(system.f @ u)) / STEP
        case PNormStress(p, q):
            s = rho**q * system.solid_von_mises((system.strain @ u).reshape(3, -1).T)
            largest = s.real.max()
            return float(np.imag(largest * np.sum((s / largest) ** p) ** (1 / p))) / STEP
