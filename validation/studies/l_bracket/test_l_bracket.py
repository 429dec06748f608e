"""L-bracket (Figs. 10, 11)

Stress without cell crossing. An L-bracket of two arms, clamped at the top, with a force on the corner of the lower arm;
the p-norm of the relaxed von Mises stress rho^q vm is minimised. Units: h = F = E0 = 1, so stress is in F/h. **Our
choices**, beside those in the table above: vm is the stress of solid material under the local strain (the paper does
not say which modulus), sigma_zz of plane strain included.

The optimiser is GCMMA with its conservative inner loop, move limit 0.3, its curvature warm-started, which gets
further with the same solves; the section on update rules shows the others. The **fine reference** is the
cantilever's: biquadratic elements, 2 x 2 for each material point, stress at their centres; each counts as a quarter in
the p-norm, so that it equals the paper's definition with one element for each point.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from mpmtop.arrays import Array
from validation import paper
from validation.bodies.scenes import CORNER, SPACING, l_bracket
from validation.bodies.sketch import CHOSEN, opening
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.measures.drawing import draw_design, draw_points
from validation.measures.history import histories
from validation.methods.analyser import (
    METHODS,
    ROUNDING_RISE,
    Analyser,
    DensityField,
    Optimisation,
    stress_objective,
)
from validation.paper import compare_identical
from validation.studies.l_bracket.rules import RTOL_ANALYSIS, RTOL_OPTIMUM

ASKED = "Without crossing, does MPM find designs of low stress, and are they so in truth?"


def relaxed(analyser: Analyser, rho: Array) -> Array:
    """rho^q vm (p,) by the method itself."""
    return np.sqrt(rho) * analyser.solid_von_mises(analyser.problem.analyse(rho))


def clearance(design: DensityField) -> float:
    """Distance from the re-entrant corner to the nearest point of density 0.5 or more."""
    return float(np.linalg.norm(design.x - CORNER, axis=1)[design.rho >= 0.5].min())


def corner_peak(analyser: Analyser) -> float:
    """Largest von Mises stress of the solid bracket."""
    return float(analyser.solid_von_mises(analyser.problem.analyse(np.ones(len(analyser.x)))).max())


def test_initial_stress(report: Report, lock: Lock, analysers: dict[str, Analyser]) -> None:
    """Before optimisation (Fig. 10)

    No domain leaves its cell, so standard MPM and GIMP are one, as on the cantilever. The corner is singular: its peak
    grows with resolution, and the finite elements, a displacement field twice as fine, see more of it.
    """
    opening(report, l_bracket(), {"filter radius": CHOSEN, "E_min / E0": CHOSEN, "rho_min": CHOSEN})
    standard, gimp = analysers["standard"], analysers["GIMP"]
    holds = [
        report.check(
            "number of material points, L-bracket",
            len(standard.x),
            int(paper.L_BRACKET_POINTS.value),
            source=paper.L_BRACKET_POINTS,
        )
    ]
    start = {name: a.problem.evaluate(a.problem.x0) for name, a in analysers.items()}
    solid = {name: a.problem.analyse(np.ones(len(a.x))) for name, a in analysers.items()}
    vm = {name: a.design(a.solid_von_mises(solid[name])).at(standard.x) for name, a in analysers.items()}
    gradient = [a.problem.gradient(start[a.name])[0] for a in (standard, gimp)]
    identical = {
        "displacement": (solid["standard"].u, solid["GIMP"].u),
        "von Mises stress": (vm["standard"], vm["GIMP"]),
        "p-norm sensitivity": (gradient[0], gradient[1]),
    }
    holds += compare_identical(report, "L-bracket", identical)
    table = pd.DataFrame(
        {
            "p-norm, uniform 0.4": {name: evaluation.objective for name, evaluation in start.items()},
            "p-norm, solid": {name: evaluation.objective for name, evaluation in solid.items()},
            "largest von Mises stress, solid": {name: float(field.max()) for name, field in vm.items()},
        }
    )
    report.table("initial", table.rename_axis("method"), "Stress measures before optimisation [F/h].")
    figure, axes = plt.subplots(1, 3, figsize=(8.0, 3.2), sharey=True)
    limit = float(np.percentile(vm["standard"], 99.5))
    for ax, (name, field) in zip(axes, vm.items(), strict=True):
        drawn = draw_points(
            ax, standard.x, standard.half_length, field, vmin=0, vmax=limit, label="von Mises stress [F/h]"
        )
        ax.set(title=name, ylabel="y / h" if ax is axes[0] else "")
    figure.colorbar(drawn, ax=axes, label=drawn.get_label(), extend="max", shrink=0.8)
    report.figure(
        "initial_stress", figure, "Von Mises stress of the solid bracket; colours end at the 99.5th percentile."
    )
    lock({f"p-norm at uniform 0.4, {name}": e.objective for name, e in start.items()}, rtol=RTOL_ANALYSIS)
    assert all(holds)


@pytest.mark.slow
def test_optimisation(
    report: Report, lock: Lock, analysers: dict[str, Analyser], runs: dict[str, Optimisation]
) -> None:
    """Optimisation (Fig. 11)

    GCMMA accepts no design that is worse than the last. GIMP's problem is standard MPM's, number by number: one run is
    both. The optimum spreads the load so that the stress is nearly even,
    and **keeps material at the re-entrant corner**, where the paper's design avoids it. At points 0.35 h from the
    corner the stress of the solid (table above) is only moderately above the even stress that 40 % of the volume has to
    carry: this p-norm gains little from rounding the corner off. A finer analysis raises the corner's peak, and with it
    what rounding gains.
    """
    done = {name: runs[name] for name in METHODS}
    stress = {name: relaxed(analysers[name], run.design.rho) for name, run in done.items()}
    tabulate(report, done, stress)
    standard = done["standard"]
    holds = [
        report.check(
            "optimised p-norm, standard [F/h]", standard.final, at_most=1.22, source="independent prototype: 1.211"
        ),
        report.check(
            "largest rho^q vm, standard [F/h]", float(stress["standard"].max()), at_most=0.93, source="our bound"
        ),
        report.check(
            "iterations in which the p-norm rose, all methods",
            sum(int(np.sum(run.rise > ROUNDING_RISE)) for run in done.values()),
            0,
            source="acceptance test of GCMMA; the paper: almost monotonic",
        ),
        report.check(
            "excess of the volume fraction over 0.4, all methods",
            max(0.0, *(float(run.volume[-1]) - 0.4 for run in done.values())),
            at_most=1e-6,
            source="our bound on Eq. (8)",
        ),
        report.check(
            "all numbers that an iterate of the L-bracket depends on are those of standard MPM with GIMP, too",
            analysers["standard"].problem.fingerprint == analysers["GIMP"].problem.fingerprint,
            True,
            source=paper.IDENTICAL,
        ),
        report.check(
            "iterations to convergence, standard, curvature warm-started",
            standard.iterations,
            at_least=201,
            source=paper.L_BRACKET_ITERATIONS,
            why="the paper's plain GCMMA has not ended after 500 solves here, so this is weak agreement",
        ),
    ]
    report.check(
        "distance from the re-entrant corner to the nearest material, standard [h]",
        clearance(standard.design),
        at_least=2 * SPACING,
        source=paper.EMPTY_CORNER,
        why="nearer than two points is the corner",
        reason="at the nearest points, 0.35 h away, the solid's stress is only "
        f"{corner_peak(analysers['standard']) / float(stress['standard'].max()):.2g} times the even stress of the "
        "optimum: the p-norm gains little from emptying the corner, and a conservative optimiser ends with it filled; "
        "a single step of GCMMA an iteration, stopped early, leaves it empty (study of open choices)",
    )
    draw_optimisation(report, analysers, done, stress)
    lock({f"optimised p-norm, {name}": run.final for name, run in done.items()}, rtol=RTOL_OPTIMUM)
    assert all(holds)


def tabulate(report: Report, done: dict[str, Optimisation], stress: dict[str, Array]) -> None:
    table = pd.DataFrame.from_dict(
        {
            name: {
                "p-norm": run.final,
                "largest rho^q vm": stress[name].max(),
                "iterations": run.iterations,
                "solves": run.solves[-1],
                "volume fraction": run.volume[-1],
                "grayness": run.design.grayness,
                "corner to material [h]": clearance(run.design),
            }
            for name, run in done.items()
        },
        orient="index",
    )
    report.table(
        "optimisation",
        table.rename_axis("method"),
        "Optimised brackets, each measured by the method that made it. Last column: distance from the re-entrant "
        "corner to the nearest point of density 0.5 or more (0.35 h in the solid).",
    )


def draw_optimisation(
    report: Report, analysers: dict[str, Analyser], done: dict[str, Optimisation], stress: dict[str, Array]
) -> None:
    figure = histories(done, "p-norm [F/h]")
    report.figure("history", figure, "p-norm, its end enlarged, and volume fraction.")

    standard, fem = done["standard"], done["FEM"]
    panels = {f"iteration {k}: {standard.objective[k]:.4g}": design for k, design in standard.designs.items()}
    panels[f"FEM, {fem.iterations}: {fem.final:.4g}"] = fem.design
    figure, axes = plt.subplots(2, 3, figsize=(7.0, 5.2), sharex=True, sharey=True)
    for ax, (title, design) in zip(axes.flat, panels.items(), strict=True):
        draw_design(ax, design.x, design.half_length, design.rho)
        ax.set(title=title)
        ax.label_outer()
    report.figure("layouts", figure, "Densities and p-norm of standard MPM on its way, and of FEM at its end.")

    figure, axes = plt.subplots(1, 2, figsize=(7.0, 3.4), sharey=True)
    limit = float(max(field.max() for field in stress.values()))
    for ax, name in zip(axes, ("standard", "FEM"), strict=True):
        a = analysers[name]
        drawn = draw_points(ax, a.x, a.half_length, stress[name], vmin=0, vmax=limit, label="rho^q vm [F/h]")
        ax.set(title=name)
        ax.label_outer()
    figure.colorbar(drawn, ax=axes, label=drawn.get_label())
    report.figure(
        "final_stress", figure, "Relaxed von Mises stress of the optimised brackets: nearly even along the arch."
    )


@pytest.mark.slow
def test_reduction(
    report: Report, analysers: dict[str, Analyser], runs: dict[str, Optimisation], single_step: Optimisation
) -> None:
    """The paper's "p-norm reduced by 97 %", under five definitions

    The paper gives no initial or final value, and Eq. (9) does not say which modulus the stress is taken with; its two
    lines differ in the exponent of rho^q. From the same start (uniform 0.4) to the same design of ours:
    """
    a = analysers["standard"]
    start, end = np.full(len(a.x), 0.4), runs["standard"].design.rho
    scene = l_bracket()
    objective = stress_objective(scene)
    p, q = objective.p, objective.q

    def norm(s: Array) -> float:
        return float(s.max() * np.sum((s / s.max()) ** p) ** (1 / p))

    def measures(rho: Array) -> dict[str, float]:
        vm = a.solid_von_mises(a.problem.analyse(rho))
        real = (scene.design.contrast + rho**scene.design.penal) * vm
        return {
            "Eq. (9), first line, solid stress (ours)": norm(rho**q * vm),
            "Eq. (9), second line, solid stress": norm(rho ** (q / p) * vm),
            "Eq. (9), first line, stress of the SIMP modulus": norm(rho**q * real),
            "largest relaxed solid stress": float((rho**q * vm).max()),
            "p-norm of unrelaxed solid stress: all points at the start, rho > 0.5 at the end": norm(
                np.where(rho > 0.5, vm, 0)
            )
            if rho.max() > 0.5
            else norm(vm),
        }

    table = pd.DataFrame({"initial": measures(start), "final": measures(end)})
    table["change"] = table["final"] / table["initial"] - 1
    report.table("reduction", table.rename_axis("measure"), "Standard MPM [F/h].", 4)
    report.check(
        "reduction of the p-norm, Eq. (9) first line",
        float(-table["change"].iloc[0]),
        paper.L_BRACKET_REDUCTION.value,
        rtol=0.01,
        source=paper.L_BRACKET_REDUCTION,
        why="two digits are printed",
        reason=f"the start is not stated: the five measures below fall by {-table['change'].max():.0%} to "
        f"{-table['change'].min():.0%} from the uniform one; a rule without an inner loop overshoots in its first "
        f"iterations, and its final value is {1 - single_step.final / single_step.objective.max():.0%} below its own "
        "maximum",
    )
    assert table["final"].iloc[0] < table["initial"].iloc[0]
