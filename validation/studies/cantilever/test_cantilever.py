"""Cantilever (Figs. 8, 9)

Compliance without cell crossing. A 40h x 20h cantilever, clamped at its left edge, with a tip force on the right
edge, 3,200 material points (2 x 2 per cell), 40 % of the volume, penalty 3. Units: h = F = E0 = 1, so compliance is
in F²/E0. **Our choices**, where the paper is silent: tip force at mid-height, density filter of radius 1.5h = 3 point
spacings (chosen to meet the paper's 83.57), `rho_min` = 1e-3, E_min = 1e-9 E0. The tables below show what depends on
them.

Three methods run on identical scenes: **standard** MPM (tent functions), **GIMP**, and **FEM** (scikit-fem, bilinear
elements, one for each material point: a displacement field twice as fine as the background grid's). The **fine
reference** judges every design: biquadratic elements, 2 x 2 for each material point.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from joblib import Parallel, delayed

from mpmtop.optimizers import GCMMA, MMA, SingleStepGCMMA, UpdateRule
from reference_fem.reanalyse import Judge, build_judge
from validation import paper
from validation.bodies.scenes import SPACING, TipLoad, cantilever
from validation.bodies.sketch import CALIBRATED, CHOSEN, opening
from validation.harness.lock import Lock
from validation.harness.progress import ShowProgress
from validation.harness.report import Report
from validation.measures.drawing import draw_design, draw_points
from validation.measures.timing import cpu_seconds, iteration
from validation.methods.analyser import METHODS, MOVE, PAPER_RULE, ROUNDING_RISE, Analyser, Optimisation
from validation.methods.plain_fem import PlainProblem

ASKED = "Without crossing, does MPM find the design that finite elements find for compliance?"

RTOL_OPTIMUM = 2e-3
"""Another processor rounds differently, a hundred iterations of a non-convex optimisation amplify that, and the
stopping rule (1e-4 over four iterations) may then end a run earlier: a few times 1e-4 is what that can cost."""
RTOL_ANALYSIS = 1e-8
"""One analysis of a given design: condition number 1e6 times rounding 1e-16, with two digits to spare."""

RADII = (1.5, 2.0, 2.3, 2.5, 3.0, 3.5, 4.0, 5.0)
"""Filter radii of the sweep, in point spacings."""
SHOWN = (5, 10, 20, 40)
"""Iterations whose layout is drawn, besides the last."""
LOADS: tuple[TipLoad, ...] = ("mid-height", "bottom corner")


@pytest.fixture(scope="module")
def analysers() -> dict[str, Analyser]:
    scene = cantilever()
    return {name: build(scene) for name, build in METHODS.items()}


@pytest.fixture(scope="module")
def optimisations(analysers: dict[str, Analyser]) -> dict[str, Optimisation]:
    return {name: Optimisation.of(analyser, keep=SHOWN) for name, analyser in analysers.items()}


@pytest.fixture(scope="module")
def judge(analysers: dict[str, Analyser]) -> Judge:
    points = analysers["standard"]
    return build_judge(cantilever(), points.x, points.half_length)


def test_solid_stress(report: Report, lock: Lock, analysers: dict[str, Analyser], judge: Judge) -> None:
    """The solid body before optimisation (Fig. 8)

    Eq. (7) is the average of Eq. (6) over the point's domain, and Eq. (6) is linear inside a cell: as long as no domain
    leaves its cell, the two are the same function. Here each domain is a quarter of a cell. What is left between
    standard MPM and GIMP is rounding, if anything.
    """
    opening(
        report, cantilever(), {"load": CHOSEN, "filter radius": CALIBRATED, "E_min / E0": CHOSEN, "rho_min": CHOSEN}
    )
    standard, gimp = analysers["standard"], analysers["GIMP"]
    x, half = standard.x, standard.half_length
    cell = np.floor(x)
    leaves = np.any((x - half < cell - 1e-12) | (x + half > cell + 1 + 1e-12), axis=1)
    solid = {name: analyser.problem.analyse(np.ones(len(x))) for name, analyser in analysers.items()}
    vm = {name: a.design(a.solid_von_mises(solid[name])).at(x) for name, a in analysers.items()}
    gradient = [a.problem.gradient(a.problem.evaluate(a.problem.x0))[0] for a in (standard, gimp)]
    identical = {
        "displacement": (solid["standard"].u, solid["GIMP"].u),
        "von Mises stress": (vm["standard"], vm["GIMP"]),
        "compliance sensitivity": (gradient[0], gradient[1]),
    }
    holds = [
        report.check(
            "number of material points, cantilever",
            len(x),
            int(paper.CANTILEVER_POINTS.value),
            source=paper.CANTILEVER_POINTS,
        ),
        report.check("points whose domain leaves its cell", int(leaves.sum()), 0, source=paper.NO_CROSSING),
    ]
    holds += [
        report.check(
            f"{what} of the cantilever, standard against GIMP: largest difference over largest value",
            float(np.abs(a - b).max() / np.abs(a).max()),
            at_most=1e-14,
            source=paper.IDENTICAL,
            why="identical but for the last digits of double precision",
        )
        for what, (a, b) in identical.items()
    ]

    compliance = {name: solid[name].objective for name in solid} | {"fine reference": judge(np.ones(len(x))).compliance}
    table = pd.DataFrame({"compliance = tip displacement": compliance})
    table["against the fine reference"] = table.iloc[:, 0] / compliance["fine reference"] - 1
    table["largest von Mises stress"] = pd.Series({name: field.max() for name, field in vm.items()})
    table["stress difference to FEM (RMS)"] = pd.Series(
        {name: np.sqrt(np.mean((field - vm["FEM"]) ** 2) / np.mean(vm["FEM"] ** 2)) for name, field in vm.items()}
    )
    report.table(
        "solid",
        table.rename_axis("method"),
        "The solid cantilever. As F = 1, compliance is the mean displacement of the six loaded points [F/E0]; stress "
        "[F/h] at points and element centres. The background grid is twice as coarse as the FEM mesh, hence stiffer.",
    )

    figure, axes = plt.subplots(3, 1, figsize=(5.0, 7.4), sharex=True)
    limit = float(np.percentile(vm["standard"], 99.5))
    for ax, (name, field) in zip(axes, vm.items(), strict=True):
        drawn = draw_points(ax, x, half, field, vmin=0, vmax=limit, label="von Mises stress [F/h]")
        ax.set(title=name, xlabel="x / h" if ax is axes[-1] else "")
    figure.colorbar(drawn, ax=axes, label=drawn.get_label(), extend="max", shrink=0.5)
    report.figure("solid_stress", figure, "Von Mises stress of the solid body; colours end at the 99.5th percentile.")
    lock({f"solid compliance, {name}": value for name, value in compliance.items()}, rtol=RTOL_ANALYSIS)
    assert all(holds)


def test_optimisation(report: Report, lock: Lock, optimisations: dict[str, Optimisation]) -> None:
    """Optimisation by GCMMA (Fig. 9)

    GCMMA with its conservative inner loop and move limit 0.3, from a uniform design at the volume fraction, until the
    objective stays within 1e-4 of that of each of the four previous iterations. A solve is one factorisation of K:
    inner iterations of GCMMA cost one each, gradients none.
    """
    standard = optimisations["standard"]
    rows = {
        name: {
            "compliance": done.final,
            "iterations": done.iterations,
            "solves": done.solves[-1],
            "volume fraction": done.volume[-1],
            "grayness": done.design.grayness,
        }
        for name, done in optimisations.items()
    }
    report.table(
        "optimisation",
        pd.DataFrame.from_dict(rows, orient="index").rename_axis("method"),
        "Optimised cantilevers, each measured by the method that made it. Grayness is 4 mean(rho (1 - rho)).",
    )
    report.check(
        "iterations to convergence, standard",
        standard.iterations,
        int(paper.CANTILEVER_ITERATIONS.value),
        rtol=0.1,
        source=paper.CANTILEVER_ITERATIONS,
        why="the path depends on radius, load position and E_min, too, which the paper leaves open",
    )
    same = report.check(
        "optimised design, standard against GIMP: largest difference of a density",
        float(np.abs(standard.design.rho - optimisations["GIMP"].design.rho).max()),
        at_most=1e-12,
        source=paper.IDENTICAL,
        why="bit-identical analyses give bit-identical paths",
    )
    active = report.check(
        "volume constraint active: distance of the volume fraction from 0.4",
        abs(float(standard.volume[-1]) - 0.4),
        at_most=1e-5,
        source=paper.VOLUME_ACTIVE,
        why="a hundredth of what the stopping rule leaves of the objective",
    )
    rise = max(float(done.rise.max()) for done in optimisations.values())
    monotone = report.check(
        "largest relative rise of compliance in an iteration, all methods",
        max(0.0, rise),
        at_most=ROUNDING_RISE,
        source="Svanberg (2002): GCMMA does not rise",
    )
    draw_histories(report, optimisations)
    draw_layouts(report, standard, optimisations)
    lock({f"optimised compliance, {name}": row["compliance"] for name, row in rows.items()}, rtol=RTOL_OPTIMUM)
    assert same and active and monotone


def draw_histories(report: Report, optimisations: dict[str, Optimisation]) -> None:
    figure, (top, bottom) = plt.subplots(2, 1, figsize=(5.0, 5.0), sharex=True, height_ratios=(2, 1))
    for name, done in optimisations.items():
        top.semilogy(done.objective, label=name)
        bottom.plot(done.volume)
    top.axhline(paper.CANTILEVER_COMPLIANCE.value, color="0.4", linewidth=1, linestyle="-", label="paper, final")
    top.set(ylabel="compliance [F²/E0]", yticks=(80, 100, 200, 400), yticklabels=("80", "100", "200", "400"))
    top.minorticks_off()
    top.legend()
    bottom.set(xlabel="iteration", ylabel="volume fraction", ylim=(0.38, 0.42))
    report.figure("history", figure, "Compliance and volume fraction; standard and GIMP are one line.")


def draw_layouts(report: Report, standard: Optimisation, optimisations: dict[str, Optimisation]) -> None:
    panels = {f"iteration {k}: {standard.objective[k]:.5g}": design for k, design in standard.designs.items()}
    done = optimisations["FEM"]
    panels[f"FEM, iteration {done.iterations}: {done.final:.5g}"] = done.design
    figure, axes = plt.subplots(3, 2, figsize=(7.0, 6.0), sharex=True, sharey=True)
    for ax, (title, design) in zip(axes.flat, panels.items(), strict=True):
        draw_design(ax, design.x, design.half_length, design.rho)
        ax.set(title=title)
        ax.label_outer()
    report.figure("layouts", figure, "Densities and compliance of standard MPM on its way, and of FEM at its end.")


def final_compliance(load: TipLoad, radius: float) -> dict[str, float]:
    """One entry of the sweep, by standard MPM; radius in point spacings. A function of the module, for joblib."""
    done = Optimisation.of(METHODS["standard"](cantilever(load, radius * SPACING)))
    return {"compliance": done.final, "iterations": done.iterations, "grayness": done.design.grayness}


@pytest.mark.slow
def test_radius_and_load(report: Report, lock: Lock, progress: ShowProgress) -> None:
    """What 83.57 depends on: filter radius and load position

    The paper states neither the filter's radius nor where on the right edge the force acts, nor the force. Every
    combination is optimised by standard MPM, with F²/E0 = 1. That one of them meets 83.57 is a **calibration**, not a
    prediction: it shows which choices the paper may have made, and fixes the radius of this study.
    """
    cases = [(load, radius) for load in LOADS for radius in RADII]
    # one process unless `joblib.parallel_config` says otherwise: starting workers costs as much as a second one saves
    done = Parallel(return_as="generator")(delayed(final_compliance)(*case) for case in cases)
    results = dict(zip(cases, progress(done, "radius and load sweep"), strict=True))
    frame = pd.DataFrame.from_dict(results, orient="index").rename_axis(["load", "radius / spacing"])
    stated = paper.CANTILEVER_COMPLIANCE.value
    frame["against 83.57"] = frame["compliance"] / stated - 1
    report.table("radius_load", frame.astype({"iterations": int}), "Optimised compliance by load position and radius.")
    nearest = min(results, key=lambda case: abs(results[case]["compliance"] / stated - 1))
    load, radius = nearest
    width = [results[load, r]["compliance"] for r in RADII if 2.5 <= r <= 3.5]
    report.text(
        f"Width of the calibration: over radii of 2.5 to 3.5 spacings with this load the optimum goes from "
        f"{min(width):.5g} to {max(width):.5g}, {min(width) / stated - 1:+.1%} to {max(width) / stated - 1:+.1%} of "
        "what is stated: a number that such a choice can meet proves nothing."
    )
    report.text(
        f"Nearest to {stated}: load at {load}, radius {radius:g} spacings, compliance "
        f"{results[nearest]['compliance']:.5g} after {results[nearest]['iterations']:.0f} iterations."
    )
    near = report.check(
        f"optimised compliance, calibrated: load at {load}, radius {radius:g} spacings [F²/E0]",
        results[nearest]["compliance"],
        stated,
        rtol=0.03,
        source=paper.CANTILEVER_COMPLIANCE,
        why="radii are tried in steps of half a spacing and less, which change the optimum by up to 3 %",
    )

    figure, ax = plt.subplots()
    for load in LOADS:
        ax.plot(RADII, [results[load, r]["compliance"] for r in RADII], marker="o", label=f"load at {load}")
    ax.axhline(stated, color="0.4", linewidth=1, linestyle="-", label="paper")
    ax.set(xlabel="filter radius / point spacing", ylabel="optimised compliance [F²/E0]")
    ax.legend()
    report.figure("radius_load", figure, "Optimised compliance against filter radius: the paper's value crosses both.")
    lock({f"{load}, {radius:g} spacings": r["compliance"] for (load, radius), r in results.items()}, rtol=RTOL_OPTIMUM)
    assert near


@pytest.mark.slow
def test_cross_evaluation(
    report: Report, lock: Lock, analysers: dict[str, Analyser], optimisations: dict[str, Optimisation], judge: Judge
) -> None:
    """Every design in every analyser, and on the fine reference

    A method that judges its own design may flatter it. Rows are designs, columns the analysis; the fine reference
    is nobody's own, and its own error is shown by its change from 1 x 1 to 2 x 2 elements for each point.
    """
    designs = {name: done.design for name, done in optimisations.items()}
    table = pd.DataFrame(
        {
            f"in {name}": {d: analyser.compliance(design) for d, design in designs.items()}
            for name, analyser in analysers.items()
        }
    )
    x = analysers["standard"].x
    coarse = build_judge(cantilever(), x, analysers["standard"].half_length, split=1)
    table["fine reference, 1 x 1"] = {name: coarse(design.at(x)).compliance for name, design in designs.items()}
    table["fine reference, 2 x 2"] = {name: judge(design.at(x)).compliance for name, design in designs.items()}
    report.table(
        "cross_evaluation",
        table.rename_axis("design of"),
        "Compliance of each design in each analyser; k x k: biquadratic elements of the reference for each point.",
    )
    black = {name: judge(design.black_and_white().at(x)).compliance for name, design in designs.items()}
    fine = table["fine reference, 2 x 2"]
    report.table(
        "thresholded",
        pd.DataFrame({"as optimised": fine, "cut to black and white": black}).rename_axis("design of"),
        "Compliance on the fine reference, 2 x 2: the designs, and the same cut to black and white at their volume.",
        4,
    )
    agree = report.check(
        "true compliance (fine reference) of standard MPM's design over that of FEM's",
        float(fine["standard"] / fine["FEM"]),
        1.0,
        rtol=0.02,
        source=paper.ALIGNS_WITH_FEM,
        why="our reading: layouts are alike if neither is truly better by more than local optima differ",
    )
    pictured = table["fine reference, 1 x 1"]  # the one that the pictures give
    ratio = float(pictured["standard"] / pictured["FEM"])
    twins = (
        "standard MPM and GIMP are one method"
        if pictured["standard"] == pictured["GIMP"]
        else "standard MPM and GIMP differ"
    )
    report.found(
        f"{twins[0].upper() + twins[1:]}, and in truth (fine reference) their compliance design is "
        f"{against(ratio)} FEM's: {pictured['standard']:.2f} and {pictured['FEM']:.2f}.",
        front="Points as seeded",
    )
    sound = "a sound" if abs(ratio - 1) < 0.02 else "not a sound"
    report.so(
        f"Without crossing, MPM is {sound} replacement for FEM in compliance design; the paper's 83.57 was calibrated "
        "and proves nothing."
    )
    names = {"FEM": "FEM", "standard": "MPM", "GIMP": "GIMP"}
    for method, shown in names.items():
        design = designs[method]
        report.design(
            f"design_{shown}",
            *(design.x, design.half_length, design.rho),
            body="Cantilever",
            method=shown,
            measure="compliance [F²/E0]",
            own=optimisations[method].final,
            true=float(table["fine reference, 1 x 1"][method]),
            front=True,
        )
    change = float((fine / table["fine reference, 1 x 1"] - 1).abs().max())
    converged = report.check(
        "change of the fine reference under refinement 1 x 1 to 2 x 2", change, at_most=0.005, source="our bound"
    )
    lock(
        {f"{row}, {column}": value for row, values in table.iterrows() for column, value in values.items()},
        rtol=RTOL_OPTIMUM,
    )
    assert agree and converged


def against(ratio: float) -> str:
    """How good a design is whose true compliance is so many times another's."""
    if abs(ratio - 1) < 0.005:
        return "as good as"
    return f"{abs(ratio - 1):.1%} {'worse' if ratio > 1 else 'better'} than"


RULES: dict[str, UpdateRule] = {
    "GCMMA": PAPER_RULE,
    "GCMMA, curvature warm-started": GCMMA(move=MOVE, warm_start=True),
    "single-step GCMMA": SingleStepGCMMA(move=MOVE),
    "MMA": MMA(move=MOVE),
}


def test_update_rules(report: Report, lock: Lock, analysers: dict[str, Analyser]) -> None:
    """Update rules, counted in solves

    The paper says GCMMA. Published codes of that name often leave its inner loop out ("single-step"), so all forms run.
    """
    done = {name: Optimisation.of(analysers["standard"], rule) for name, rule in RULES.items()}
    rows = {
        name: {
            "compliance": optimisation.final,
            "iterations": optimisation.iterations,
            "solves": optimisation.solves[-1],
            "iterations in which compliance rose": int(np.sum(optimisation.rise > ROUNDING_RISE)),
        }
        for name, optimisation in done.items()
    }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("rule")
    report.table("update_rules", table, "Standard MPM, same start and stopping rule.")
    spread = float(table["compliance"].max() / table["compliance"].min() - 1)
    holds = report.check("spread of the optimum over update rules", spread, at_most=0.01, source="our bound")
    lock({name: row["compliance"] for name, row in rows.items()}, rtol=RTOL_OPTIMUM)
    assert holds


def test_modulus_contrast(report: Report, lock: Lock) -> None:
    """Both readings of "E_min = 1e-6"

    Beside E0 = 1e6 Pa the paper's E_min = 1e-6 is a contrast E_min / E0 of 1e-12 if it is in Pa, and of 1e-6 if it is
    relative. The default here is 1e-9, the field's habit.
    """
    contrasts = {"1e-6 (relative)": 1e-6, "1e-9 (ours)": 1e-9, "1e-12 (absolute, in Pa)": 1e-12}
    done = {name: Optimisation.of(METHODS["standard"](cantilever(contrast=c))) for name, c in contrasts.items()}
    table = pd.DataFrame(
        {
            "compliance": {name: optimisation.final for name, optimisation in done.items()},
            "iterations": {name: optimisation.iterations for name, optimisation in done.items()},
        }
    )
    report.table("contrast", table.rename_axis("E_min / E0"), "Standard MPM by modulus contrast.")
    spread = float(table["compliance"].max() / table["compliance"].min() - 1)
    holds = report.check("spread of the optimum over the readings of E_min", spread, at_most=0.01, source="our bound")
    lock({name: optimisation.final for name, optimisation in done.items()}, rtol=RTOL_OPTIMUM)
    assert holds


def test_speed(report: Report, analysers: dict[str, Analyser]) -> None:
    """Cost of one iteration beside a plain scikit-fem loop

    As many design variables, the same filter, the same GCMMA, in one process: CPU time of an iteration, that is one
    solve, its gradient and the update, medians of repeats taken in turn. The plain loop is what scikit-fem's examples
    lead to, a `BilinearForm` assembled each iteration and `condense`. It reproduces the numbers of `reference_fem`.
    """
    plain = PlainProblem(cantilever(), 80, 40)
    fem = analysers["FEM"].problem
    same = report.check(
        "compliance of the start, plain scikit-fem loop over reference_fem",
        plain.evaluate(plain.x0).objective / fem.evaluate(fem.x0).objective,
        1.0,
        rtol=1e-8,  # two factorisations of one matrix
        source="same discretisation",
    )
    problems = {"plain": plain} | {name: analyser.problem for name, analyser in analysers.items()}
    seconds = cpu_seconds({name: iteration(problem) for name, problem in problems.items()})
    for name in analysers:
        at_least = 10.0 if name == "standard" else None
        report.timing(
            f"CPU time of an iteration, plain scikit-fem loop over {name}",
            seconds["plain"] / seconds[name],
            at_least=at_least,
            source="our aim" if at_least else "for comparison",
        )
    assert same
