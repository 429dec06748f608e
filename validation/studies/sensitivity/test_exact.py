"""Analytic gradients beside exact ones, identities, and the oracle's own check."""

import time
from collections.abc import Callable
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from mpmtop.arrays import Array
from mpmtop.criteria import Compliance, PNormStress
from validation.harness.report import Report
from validation.measures.derivatives import taylor_orders
from validation.measures.orders import observed_order
from validation.oracles.woodbury import STEP, State, changed_objectives
from validation.studies.sensitivity.subjects import AGREEMENT, EPS, SCENES, SEEDED, Key, Subject, Verified

# points are moved off the clamp and over grid lines on purpose
pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

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
                round(float(observed_order(error[1], error[2], steps[1] / steps[2])), 2),
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

        def J(rho: Array, analyse: Callable[[Array], Any] = subject.problem.analyse) -> float:
            return float(analyse(rho).objective)

        (found,) = taylor_orders(J, rho, direction, float(gradient @ direction), (1e-2, 1e-3))
        order[objective, method] = {"order": round(float(found), 2)}
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
