"""Cell crossing: L-bracket (Figs. 14, 15)

Stress with induced crossing: the L-bracket of Figs. 10 and 11, its points moved as on the cantilever by the family
calibrated there, the column left of every fourth cell boundary by 0.26 h. p-norm (p = 12, q = 0.5) of the relaxed von
Mises stress of solid material, filter radius 2 point spacings, 40 % of the volume, h = F = E0 = 1. Densities live on
the points' places in the body, before the shift.
"""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from joblib import Parallel, delayed
from scipy.spatial import KDTree

from mpmtop.arrays import Array
from mpmtop.errors import NotConverged
from mpmtop.optimizers import GCMMA
from mpmtop.points import seed
from reference_fem.reanalyse import Judge, build_judge, judge_stress
from validation import paper
from validation.bodies.crossing import Crossing, Periodic
from validation.bodies.scenes import CORNER, SPACING, cantilever, l_bracket
from validation.bodies.sketch import CHOSEN, opening
from validation.harness.lock import Lock
from validation.harness.progress import ShowProgress
from validation.harness.report import Report
from validation.measures.drawing import draw_design, draw_points
from validation.methods.analyser import (
    JOBS,
    METHODS,
    MOVE,
    ROUNDING_RISE,
    SHAPE_FUNCTIONS,
    Analyser,
    DensityField,
    Optimisation,
    material_points,
)
from validation.paper import Compared, compare

# points are moved off the clamp and over grid lines on purpose
pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

ASKED = "What does crossing do to designs of low stress: by the method that makes them, and in truth?"

CROSSING = Periodic(4)
"""The cantilever study's calibration."""
RULE = GCMMA(move=MOVE, warm_start=True)
"""The rule of the bracket without crossing."""
RUNS: dict[str, tuple[str, Crossing | None]] = {
    "standard, no crossing": ("standard", None),
    "standard": ("standard", CROSSING),
    "GIMP": ("GIMP", CROSSING),
}
RTOL_OPTIMUM = 0.03
"""As without crossing: rounding is amplified over 250 iterations of an objective with many near-optima."""
RTOL_ANALYSIS = 1e-8
"""One analysis of a given design, condition number 1e6."""


def build(name: str, crossing: Crossing | None) -> Analyser:
    return material_points(SHAPE_FUNCTIONS[name], name, crossing)(l_bracket())


@pytest.fixture(scope="module")
def analysers() -> dict[str, Analyser]:
    """Every shape function with crossing, standard without, and finite elements."""
    crossed = {name: build(name, CROSSING) for name in SHAPE_FUNCTIONS}
    return {"standard, no crossing": build("standard", None), "FEM": METHODS["FEM"](l_bracket())} | crossed


def optimise(name: str, crossing: Crossing | None) -> Optimisation:
    """One run; a function of the module, for joblib."""
    return Optimisation.of(build(name, crossing), RULE, iterations=500)


@pytest.fixture(scope="module")
def runs(progress: ShowProgress) -> dict[str, Optimisation]:
    done = Parallel(n_jobs=JOBS, return_as="generator")(delayed(optimise)(*case) for case in RUNS.values())
    return dict(zip(RUNS, progress(done, "crossed brackets"), strict=True))


@pytest.fixture(scope="module")
def judge(analysers: dict[str, Analyser]) -> Judge:
    return build_judge(l_bracket(), analysers["FEM"].x, analysers["FEM"].half_length, split=1)


def solid_von_mises(analyser: Analyser) -> Array:
    """Von Mises stress (p,) of the solid bracket, in the order of the lattice of points."""
    lattice = seed(l_bracket().body.domain, (SPACING, SPACING)).x
    field = analyser.solid_von_mises(analyser.problem.analyse(np.ones(len(analyser.x))))
    return analyser.design(field).at(lattice)


@pytest.mark.slow
def test_path(report: Report, lock: Lock, analysers: dict[str, Analyser]) -> None:
    """Stress along two lines from the re-entrant corner (Fig. 14)

    The paper's path Gamma is only drawn there. Here: the row of points just below the horizontal line through the
    corner, over the whole width, and the points on the diagonal from the corner to the outer one. Points are plotted at
    their place in the body. Stress is that of the solid; the finite elements have one element for each point.
    """
    scene = l_bracket()
    lattice = seed(scene.body.domain, (SPACING, SPACING))
    x = lattice.x
    choices = {"filter radius": CHOSEN, "E_min / E0": CHOSEN, "rho_min": CHOSEN}
    moved = CROSSING(lattice, scene.body.domain)
    opening(report, scene, choices, points=moved, note=f"Points as crossed by {CROSSING}.")
    fields = {name: solid_von_mises(a) for name, a in analysers.items()}
    diagonal = np.flatnonzero(np.isclose(x[:, 0], x[:, 1]) & (x[:, 0] < CORNER[0]))
    horizontal = np.flatnonzero(np.isclose(x[:, 1], CORNER[1] - SPACING / 2))
    paths = {"horizontal": horizontal[np.argsort(x[horizontal, 0])], "diagonal": diagonal[np.argsort(-x[diagonal, 0])]}
    norms = {name: p_norm(a) for name, a in analysers.items()}
    still = "standard, no crossing"
    rows = {
        name: {
            "p-norm": norms[name],
            "over no crossing": norms[name] / norms[still] - 1,
            "over FEM": norms[name] / norms["FEM"] - 1,
            "largest von Mises stress": float(field.max()),
        }
        | {
            f"{path}: RMS difference to FEM": float(
                np.linalg.norm((field - fields["FEM"])[on]) / np.linalg.norm(fields["FEM"][on])
            )
            for path, on in paths.items()
        }
        for name, field in fields.items()
    }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("method")
    report.table("path", table, f"The solid bracket; all but the first two rows with {CROSSING}. Stress in F/h.", 4)
    difference = "horizontal: RMS difference to FEM"
    smoother = report.check(
        "RMS difference to FEM on the horizontal line, GIMP over standard",
        rows["GIMP"][difference] / rows["standard"][difference],
        at_most=0.7,
        source=paper.STRESS_OSCILLATES,
        why="our reading: GIMP's difference is clearly the smaller one",
    )
    figure, axes = plt.subplots(2, 1, figsize=(6.0, 6.4))
    shown = ("FEM", "standard", "GIMP", "quadratic B-spline")
    for ax, (path, on) in zip(axes, paths.items(), strict=True):
        distance = x[on, 0] - CORNER[0] if path == "horizontal" else np.linalg.norm(x[on] - CORNER, axis=1)
        for name in shown:
            ax.plot(distance, fields[name][on], linewidth=1.2, label=name)
        ax.set(xlabel="distance from the corner / h", ylabel="von Mises stress [F/h]", title=path, ylim=(0, None))
    axes[0].legend()
    report.figure("path", figure, f"Von Mises stress of the solid bracket along both lines, {CROSSING}.")
    draw_fields(report, analysers["FEM"], {name: fields[name] for name in ("FEM", "standard", "GIMP")})
    lock({f"p-norm of the solid, {name}": norm for name, norm in norms.items()}, rtol=RTOL_ANALYSIS)
    assert smoother


def p_norm(analyser: Analyser) -> float:
    """p-norm of the solid bracket by the method itself."""
    return float(analyser.problem.analyse(np.ones(len(analyser.x))).objective)


def draw_fields(report: Report, lattice: Analyser, fields: dict[str, Array]) -> None:
    figure, axes = plt.subplots(1, 3, figsize=(8.0, 3.2), sharey=True)
    x = seed(l_bracket().body.domain, (SPACING, SPACING))
    limit = float(np.percentile(fields["FEM"], 99.5))
    for ax, (name, field) in zip(axes, fields.items(), strict=True):
        drawn = draw_points(ax, x.x, x.half_length, field, vmin=0, vmax=limit, label="von Mises stress [F/h]")
        ax.set(title=name, ylabel="y / h" if ax is axes[0] else "")
    figure.colorbar(drawn, ax=axes, label=drawn.get_label(), extend="max", shrink=0.8)
    report.figure("fields", figure, f"Von Mises stress of the solid bracket, MPM with {CROSSING}.")


def boundary_length(design: DensityField) -> float:
    """Total variation sum |rho_p - rho_q| over neighbouring points times their spacing: for a black and white design
    the length of its boundary along the axes [h]."""
    p, q = KDTree(design.x).query_pairs(1.01 * SPACING, output_type="ndarray").T
    return float(np.sum(np.abs(design.rho[p] - design.rho[q])) * SPACING)


def relaxed(analyser: Analyser, rho: Array) -> Array:
    """rho^q vm (p,) by the method itself."""
    q = analyser.scene.objective.q  # type: ignore[union-attr]
    return rho**q * analyser.solid_von_mises(analyser.problem.analyse(rho))


@pytest.mark.slow
def test_optimisation(
    report: Report, lock: Lock, analysers: dict[str, Analyser], runs: dict[str, Optimisation], judge: Judge
) -> None:
    """Optimised with crossing (Fig. 15)

    Each design by the method that made it, and on the **fine reference** (biquadratic elements, one for each point).
    Crispness by two measures: grayness 4 mean(rho (1 - rho)) and the length of the boundary. The reference's stress of
    grey or jagged details is singular, its size one of chance: the order of magnitude counts.
    """
    stress = {name: relaxed(analysers[name], run.design.rho) for name, run in runs.items()}
    rows: dict[str, dict[str, Any]] = {}
    for name, run in runs.items():
        rho = run.design.at(analysers["FEM"].x)
        fine = judge_stress(judge, rho, judge(rho))
        rows[name] = {
            "p-norm": run.final,
            "largest rho^q vm": float(stress[name].max()),
            "iterations": run.iterations,
            "grayness": run.design.grayness,
            "boundary length [h]": boundary_length(run.design),
            "p-norm without crossing": analysers["standard, no crossing"].compliance(run.design),
            "p-norm, fine reference": fine.p_norm,
            "largest rho^q vm, fine reference": fine.largest,
            "p-norm, fine reference, cut": cut_norm(judge, run.design.black_and_white().at(analysers["FEM"].x)),
        }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("design of")
    report.table(
        "optimisation",
        table,
        f"Optimised brackets, the last two with {CROSSING}; stress in F/h; cut: to black "
        "and white at the same volume, ∞ if in pieces.",
        4,
    )
    standard, gimp, still = (rows[name] for name in ("standard", "GIMP", "standard, no crossing"))
    holds = [
        report.check(
            "optimised p-norm by its own analysis, standard over GIMP",
            standard["p-norm"] / gimp["p-norm"],
            at_least=1.0,
            source=paper.STRESS_STANDARD_HIGHER,
        ),
        report.check(
            "iterations in which the p-norm rose, standard and GIMP",
            sum(int(np.sum(runs[name].rise > ROUNDING_RISE)) for name in ("standard", "GIMP")),
            0,
            source="acceptance test of GCMMA; the paper speaks of smooth convergence",
        ),
    ]
    report.check(
        "p-norm on the fine reference, design of standard over that of GIMP",
        standard["p-norm, fine reference"] / gimp["p-norm, fine reference"],
        source="for comparison: the details are singular, so that the order of magnitude counts",
    )
    for measure in ("grayness", "boundary length [h]"):
        report.check(
            f"{measure.removesuffix(' [h]')}, standard over GIMP",
            standard[measure] / gimp[measure],
            at_least=1.0,
            source=paper.LESS_CRISP,
        )
    report.check(
        "p-norm on the fine reference, design of GIMP over that without crossing",
        gimp["p-norm, fine reference"] / still["p-norm, fine reference"],
        source="for comparison",
    )
    report.found(
        f"Stress designs of standard MPM report a p-norm of {standard['p-norm']:.2f}, and the fine reference finds "
        f"{standard['p-norm, fine reference']:.2f}; GIMP reports {gimp['p-norm']:.2f}, the reference "
        f"{gimp['p-norm, fine reference']:.2f}.",
        front="Points have crossed cells",
    )
    trusted = [
        f"{name} (the reference finds {row['p-norm, fine reference'] / row['p-norm']:.1f} times its own value)"
        for name, row in (("standard MPM", standard), ("GIMP", gimp))
        if row["p-norm, fine reference"] > 2 * row["p-norm"]
    ]
    report.so(
        f"Do not trust stress designs made with crossed points by {' or '.join(trusted)}."
        if trusted
        else "Stress designs made with crossed points hold to a factor of two.",
        front="What to do",
    )
    own_rise, true_rise = (standard[measure] / still[measure] - 1 for measure in ("p-norm", "p-norm, fine reference"))
    compliance = compliance_rises()
    for analysis, of_stress in {"its own analysis": own_rise, "the fine reference": true_rise}.items():
        report.check(
            f"rise by crossing, standard, by {analysis}: of the optimised p-norm over that of the optimised compliance",
            of_stress / compliance[analysis],
            at_least=1.0,
            source=paper.STRESS_HIT_HARDER,
            why="our reading: the relative rise is the larger one; the same pattern on the cantilever",
            reason=f"by {analysis} the p-norm rises by {of_stress:.1%}, compliance by {compliance[analysis]:.1%}: MPM "
            "does not see the stress in details that its cells cannot resolve, so that its own p-norm rises least",
        )
    for name, shown in {"standard": "MPM, crossed", "GIMP": "GIMP, crossed"}.items():
        run = runs[name]
        report.design(
            f"design_{shown.partition(',')[0]}",
            *(run.design.x, run.design.half_length, run.design.rho),
            body="L-bracket",
            method=shown,
            measure="p-norm of stress [F/h]",
            own=run.final,
            true=rows[name]["p-norm, fine reference"],
            front=True,
        )
    draw_optimisation(report, runs, stress)
    lock({f"optimised p-norm, {name}": run.final for name, run in runs.items()}, rtol=RTOL_OPTIMUM)
    assert all(holds)


def cut_norm(judge: Judge, rho: Array) -> float:
    """p-norm of a design cut to black and white; infinite if the cut leaves the load without a support."""
    try:
        return judge_stress(judge, rho, judge(rho)).p_norm
    except NotConverged:
        return np.inf


def compliance_rises() -> dict[str, float]:
    """Rise of the optimised compliance of the cantilever by the same crossing, standard MPM, by analysis."""
    still = METHODS["standard"](cantilever())
    judge = build_judge(cantilever(), still.x, still.half_length, split=1)
    crossed = material_points(SHAPE_FUNCTIONS["standard"], "standard", CROSSING)(cantilever())
    before, after = Optimisation.of(still), Optimisation.of(crossed)
    true = [judge(run.design.at(still.x)).compliance for run in (before, after)]
    return {"its own analysis": after.final / before.final - 1, "the fine reference": true[1] / true[0] - 1}


def draw_optimisation(report: Report, runs: dict[str, Optimisation], stress: dict[str, Array]) -> None:
    figure, axes = plt.subplots(2, 3, figsize=(8.0, 5.6), sharex=True, sharey=True)
    for (top, bottom), (name, run) in zip(axes.T, runs.items(), strict=True):
        design = run.design
        draw_design(top, design.x, design.half_length, design.rho)
        top.set(title=f"{name}: {run.final:.4g}")
        drawn = draw_points(
            bottom, design.x, design.half_length, stress[name], vmin=0, vmax=1.0, label="rho^q vm [F/h]"
        )
        for ax in (top, bottom):
            ax.label_outer()
    figure.colorbar(drawn, ax=axes[1], label=drawn.get_label(), extend="max")
    report.figure("layouts", figure, "Designs and p-norm, and the relaxed stress, each by the method that made it.")
    figure, ax = plt.subplots()
    for name, run in runs.items():
        ax.semilogy(run.objective, label=name)
    ax.set(xlabel="iteration", ylabel="p-norm [F/h]", yticks=(1, 2, 5, 10), yticklabels=("1", "2", "5", "10"))
    ax.minorticks_off()
    ax.legend()
    report.figure("history", figure, "p-norm by iteration.")


@pytest.mark.slow
def test_numbers_of_the_paper(report: Report, analysers: dict[str, Analyser], runs: dict[str, Optimisation]) -> None:
    """Every number of Sect. 5.2.2

    The paper's force is unknown, so its stresses are known but for a factor. It is taken from one of them, the largest
    stress before optimisation with GIMP; the others follow.
    """
    over_fem = {name: p_norm(analysers[name]) / p_norm(analysers["FEM"]) - 1 for name in ("standard", "GIMP")}
    before = {name: float(solid_von_mises(analysers[name]).max()) for name in ("standard", "GIMP")}
    after = {name: float(relaxed(analysers[name], runs[name].design.rho).max()) for name in ("standard", "GIMP")}
    stated = {"standard": paper.L_BRACKET_CROSSING_STANDARD, "GIMP": paper.L_BRACKET_CROSSING_GIMP}
    scale = stated["GIMP"][0].value / before["GIMP"]
    shift = str(CROSSING)
    force = f"{shift}; force from 2.24 Pa"
    plane = stated["GIMP"][0].value / in_plane(analysers["GIMP"], np.ones_like(runs["GIMP"].design.rho))
    measure = (
        "the paper does not say which von Mises stress: of the components in the plane alone, with the force "
        "fitted alike, "
        "the same designs have "
        + " and ".join(
            f"{plane * in_plane(analysers[name], runs[name].design.rho):.3g} Pa ({name})"
            for name in ("standard", "GIMP")
        )
    )
    share = "5 % of it: the force is fitted to one stress, and peaks of a p-norm optimum are even to about that"
    compare(
        report,
        (
            Compared(
                "p-norm of the solid, standard: excess over FEM",
                paper.L_BRACKET_CROSSING_P_NORM,
                over_fem["standard"],
                shift,
                0.15,
                "“approximately”: 15 % of it",
            ),
            Compared(
                "largest von Mises stress before, GIMP [Pa]",
                stated["GIMP"][0],
                scale * before["GIMP"],
                "fixes the force",
                1e-12,
                "it is the number that the force is taken from",
            ),
            Compared(
                "largest von Mises stress before, standard [Pa]",
                stated["standard"][0],
                scale * before["standard"],
                force,
                0.05,
                share,
            ),
            *(
                Compared(
                    f"largest von Mises stress after, {name} [Pa]",
                    stated[name][1],
                    scale * after[name],
                    force,
                    0.05,
                    share,
                    measure,
                )
                for name in ("standard", "GIMP")
            ),
        ),
    )
    report.check(
        f"p-norm of the solid, GIMP: size of the difference to FEM; {shift}",
        abs(over_fem["GIMP"]),
        at_most=0.02,
        source=paper.STRESS_GIMP_MARGINAL,
        why="our reading of marginal: a fifth of standard's",
    )
    report.table(
        "reductions",
        pd.DataFrame.from_dict(
            {
                name: {
                    "the paper's reduction": 1 - stated[name][1].value / stated[name][0].value,
                    "ours": 1 - after[name] / before[name],
                }
                for name in ("standard", "GIMP")
            },
            orient="index",
        ).rename_axis("method"),
        "Reduction of the largest von Mises stress: follows from the stresses above, so it is no claim of its own.",
        percent=("the paper's reduction", "ours"),
    )


def in_plane(analyser: Analyser, rho: Array) -> float:
    """Largest relaxed stress rho^q vm by the method itself, vm² = sx² + sy² - sx sy + 3 t² without sigma_zz."""
    problem: Any = analyser.problem
    solid = np.full(len(rho), analyser.scene.body.material.young)
    sx, sy, t = problem.model.stress(solid, problem.analyse(rho).state.strain).T
    q = analyser.scene.objective.q  # type: ignore[union-attr]
    return float((rho**q * np.sqrt(sx**2 + sy**2 - sx * sy + 3 * t**2)).max())
