"""Sensitivities (Appendix, Fig. 20)

Derivatives by the density of a point, with no filter in between: compliance of the cantilever (3,200 points) and p-norm
stress of the L-bracket (6,400 points, p = 12, q = 0.5). Methods: **standard** MPM and **GIMP**, as seeded and **with
crossing** (all points moved by 0.26h in x), and **FEM**. Fields: uniform 0.4, and random in [0.1, 1].

A perturbed density changes K by a matrix of low rank, so one factorisation serves the perturbations of all variables
(Sherman-Morrison-Woodbury). The **exact derivative** is the direct one, not the adjoint: the displacement's from the
low-rank change of K, those of SIMP, von Mises stress and p-norm by complex step, without step size or cancellation;
a fully complex analysis checks it for a sample. Every variable of every case is verified by it. Every variable is
differenced, but for the p-norm with crossing: there it is 800 of the 6,400, drawn at random, which keeps the study
short. FEM is not differenced, nor is it by the paper.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes

from mpmtop.arrays import Array
from mpmtop.model import Model, discretise
from mpmtop.shape_functions import gimp, tent
from validation import paper
from validation.bodies.scenes import H
from validation.bodies.sketch import CHOSEN, opening
from validation.harness.report import Report
from validation.oracles.woodbury import State, changed_objectives
from validation.studies.sensitivity.subjects import CROSSED, EPS, SCENES, SEEDED, STATED, Key, Stated, Verified

# points are moved off the clamp and over grid lines on purpose
pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

ASKED = "Are the gradients exact, with crossing and without, and what is the error that the paper reports?"


def test_identical_operators(report: Report) -> None:
    """Without crossing standard MPM and GIMP are one method

    A domain inside its cell gives Eq. (7) the values of Eq. (6). What follows is therefore computed once for both.
    """
    sources = {"load": CHOSEN, "filter radius": CHOSEN, "E_min / E0": CHOSEN, "rho_min": CHOSEN}
    opening(report, SCENES["compliance"], sources, note="The other scene is the L-bracket of its own page.")
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
