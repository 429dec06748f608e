"""Optimised brackets on the fine reference."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from mpmtop.arrays import Array
from mpmtop.errors import NotConverged
from reference_fem.reanalyse import Judge, build_judge, judge_stress
from validation.bodies.scenes import SPACING, l_bracket
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.measures.drawing import draw_points
from validation.methods.analyser import Optimisation


def p_norm_of(judge: Judge, rho: Array) -> float:
    """p-norm of a design on the fine reference."""
    return judge_stress(judge, rho, judge(rho)).p_norm


def cut_norm(judge: Judge, rho: Array) -> float:
    """p-norm of a design cut to black and white; infinite if the cut leaves the load without a support."""
    try:
        return p_norm_of(judge, rho)
    except NotConverged:
        return np.inf


@pytest.mark.slow
def test_fine_reference(report: Report, lock: Lock, runs: dict[str, Optimisation], judge: Judge) -> None:
    """Every final design on the fine reference

    Each method is blind to what its own displacement field cannot resolve. Standard MPM and GIMP optimise four
    densities in each cell over one bilinear displacement: where the optimiser leaves grey details smaller than a cell,
    the points miss the stress there. Finite elements with one element for each density see most of it. The values that
    MPM and FEM report for their own optima are nearly equal; on the reference the designs are far apart, **all of it in
    grey material**: where rho >= 0.5 the largest stresses are alike. The p-norm of a grey, jagged or singular stress
    field grows with refinement (compare 1 x 1 and 2 x 2), so the ratio shows that MPM misses stress, not how much. The
    paper does not re-analyse its designs.
    """
    names = {"standard": "standard and GIMP, GCMMA warm", "FEM": "FEM, GCMMA warm"}
    rows: dict[str, dict[str, Any]] = {}
    fields: dict[str, Array] = {}
    points = runs["standard"].design
    coarse = build_judge(l_bracket(), points.x, points.half_length, split=1)
    for run, name in names.items():
        rho = runs[run].design.at(points.x)  # the points the judges were built on
        stress = judge_stress(judge, rho, judge(rho))
        fields[run] = stress.s
        rows[name] = {
            "p-norm by its method": runs[run].final,
            "p-norm, 1 x 1": p_norm_of(coarse, rho),
            "p-norm, 2 x 2": stress.p_norm,
            "cut to black and white, 1 x 1": cut_norm(coarse, runs[run].design.black_and_white().at(points.x)),
            "largest rho^q vm, 2 x 2": stress.largest,
            "the same where rho >= 0.5": float(stress.s[rho[judge.owner] >= 0.5].max()),
        }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("design")
    report.table(
        "fine_reference",
        table,
        "Stress measures of the final designs [F/h] by their methods and on the fine reference, k x k biquadratic "
        "elements for each point; cut: the densest points solid, the others void, at the same volume, ∞ if in pieces.",
        4,
    )
    fine = {run: rows[name]["p-norm, 2 x 2"] for run, name in names.items()}
    report.check(
        "p-norm on the fine reference (2 x 2), design of standard MPM over that of FEM",
        fine["standard"] / fine["FEM"],
        source="for comparison: the paper gives MPM's own value only",
    )
    close = report.check(
        "p-norm of FEM's design, fine reference (2 x 2) over its own value",
        fine["FEM"] / runs["FEM"].final,
        at_most=1.25,  # the singular corner alone adds 9 % to the p-norm of the uniform start
        source="resolution of one element for each density",
    )
    tell(report, runs, {run: rows[name]["p-norm, 1 x 1"] for run, name in names.items()})
    draw_fine_stress(report, judge, fields)
    # the value of MPM's design hangs on grey details that another rounding places elsewhere: not locked
    lock({"FEM": fine["FEM"]}, rtol=0.1)
    assert close


def tell(report: Report, runs: dict[str, Optimisation], true: dict[str, float]) -> None:
    """What came out, what follows, and the designs; `true` is the p-norm on 1 x 1, the one that the pictures give."""
    own = {run: runs[run].final for run in ("standard", "FEM")}
    hidden = true["standard"] / own["standard"]
    report.found(
        f"For stress, MPM reports a p-norm of {own['standard']:.2f} where the fine reference finds "
        f"{true['standard']:.2f}; FEM reports {own['FEM']:.2f} and the reference {true['FEM']:.2f}.",
        front="Points as seeded",
    )
    report.so(
        "MPM's stress designs hide stress in grey details smaller than a cell: judge them on a finer analysis."
        if hidden > 1.25
        else "MPM's stress designs hold on a finer analysis."
    )
    for run, name in {"FEM": "FEM", "standard": "MPM", "GIMP": "GIMP"}.items():
        design = runs[run].design
        report.design(
            f"design_{name}",
            *(design.x, design.half_length, design.rho),
            body="L-bracket",
            method=name,
            measure="p-norm of stress [F/h]",
            own=runs[run].final,
            true=true["FEM" if run == "FEM" else "standard"],  # GIMP's run is standard's
            front=True,
        )


def draw_fine_stress(report: Report, judge: Judge, fields: dict[str, Array]) -> None:
    figure, axes = plt.subplots(1, 2, figsize=(7.0, 3.4), sharey=True)
    centres = judge.model.centres
    for ax, run in zip(axes, ("standard", "FEM"), strict=True):
        drawn = draw_points(
            ax, centres, np.full_like(centres, SPACING / 4), fields[run], vmin=0, vmax=1.5, label="rho^q vm [F/h]"
        )
        ax.set(title=f"design of {run}")
        ax.label_outer()
    figure.colorbar(drawn, ax=axes, label=drawn.get_label(), extend="max")
    report.figure("fine_reference", figure, "Relaxed stress of the optimised designs on the fine reference.")
