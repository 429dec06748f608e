"""Cell crossing: cantilever (Figs. 12, 13)

Compliance with induced crossing. The paper shifts points in x by amounts it does not give. Here four families of
shifts are each **calibrated on one number of the paper**, the tip displacement of the solid with standard MPM (+13.8
%), and **predict the other three**: GIMP's tip displacement and both optimised compliances. Everything else is the
cantilever without crossing, h = F = E0 = 1.

Densities live on the points' places in the body, before the shift; there the filter measures, and there a design is
drawn and judged. A shift disturbs the analysis only. So every design can be analysed again without crossing, and on the
**fine reference**: what it has lost in truth, beside what its own analysis claims.
"""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from mpmtop.arrays import Array
from mpmtop.crossing import Crossing
from mpmtop.points import seed
from reference_fem import elasticity
from reference_fem.reanalyse import Judge
from validation import paper
from validation.bodies.patterns import define
from validation.bodies.scenes import SPACING, H, cantilever
from validation.bodies.sketch import CALIBRATED, CHOSEN, opening
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.measures.drawing import draw_points
from validation.methods.analyser import SHAPE_FUNCTIONS, Analyser, Optimisation, material_points
from validation.studies.crossing.cantilever.calibration import NAMES, REPRODUCTION, Calibration

# points are moved off the clamp and over grid lines on purpose
pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

ASKED = "What does crossing do to designs of low compliance: by the method that makes them, and in truth?"
RTOL_ANALYSIS = 1e-8
"""One analysis of a given design: condition number 1e5 times rounding 1e-16, with three digits to spare."""


@pytest.mark.slow
def test_calibration(
    report: Report,
    lock: Lock,
    calibrations: dict[str, Calibration],
    still: Optimisation,
    runs: dict[tuple[str, str], Optimisation],
) -> None:
    """One parameter calibrated, three numbers predicted

    In each family the member is chosen whose tip displacement with standard MPM comes nearest to +13.8 %; the numbers
    of columns and waves are whole, so the calibration is met to about a per cent of the displacement. The optima are
    relative to the uncrossed optimum of the same scene, in the paper as here. All members of all families, and why some
    give both tips, are on the page of open choices. Random shifts are left to the study of shape functions: their
    scatter exceeds what is to be predicted.
    """
    stated = {
        "tip, GIMP": paper.CANTILEVER_CROSSING_TIP_GIMP.value,
        "optimum, standard": paper.CANTILEVER_CROSSING_STANDARD.value / paper.CANTILEVER_COMPLIANCE.value - 1,
        "optimum, GIMP": paper.CANTILEVER_CROSSING_GIMP.value / paper.CANTILEVER_COMPLIANCE.value - 1,
    }
    target = paper.CANTILEVER_CROSSING_TIP_STANDARD.value
    rows: dict[str, dict[str, Any]] = {"paper": {"member": "not stated", "tip, standard (calibrated)": target} | stated}
    for family, (crossing, rise) in calibrations.items():
        predicted = {"tip, GIMP": rise["GIMP"]}
        predicted |= {f"optimum, {name}": runs[family, name].final / still.final - 1 for name in NAMES}
        error = np.sqrt(np.mean([(predicted[key] - stated[key]) ** 2 for key in stated]))
        rows[family] = {"member": str(crossing), "tip, standard (calibrated)": rise["standard"]} | predicted
        rows[family]["prediction error (RMS)"] = float(error)
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("family")
    report.table("calibration", table, "Rises by crossing, of the solid's tip displacement and of the optimum.", 3)
    errors = table["prediction error (RMS)"].astype(float)
    ratios = [float(rows[f]["optimum, standard"] / rows[f]["tip, standard (calibrated)"]) for f in calibrations]
    report.text(
        f"Least prediction error: {errors.idxmin()}, {errors.min():.3f}. GIMP's tip displacement below +1.8 % together "
        "with +13.8 % for standard MPM is met where neighbouring points move almost alike (wave, bump), so that their "
        "domains leave hardly a gap; where single columns jump, GIMP counts the gap they leave and the overlap they "
        f"make. In the paper standard's optimum rises by {stated['optimum, standard'] / target:.2f} of its tip "
        f"displacement; here by {min(ratios):.2f} to {max(ratios):.2f}."
    )
    scene = cantilever()
    domain = scene.body.domain
    moved = calibrations[REPRODUCTION].crossing(seed(domain, (SPACING, SPACING)), domain)
    choices = {"load": CHOSEN, "filter radius": CALIBRATED, "E_min / E0": CHOSEN, "rho_min": CHOSEN}
    note = f"Points as crossed by {calibrations[REPRODUCTION].crossing}: one column in every so many cells."
    opening(report, scene, choices, points=moved, note=note)
    define(report.opening, [calibrated.crossing for calibrated in calibrations.values()])
    met = report.check(
        "calibrated tip displacement, standard, furthest of any family with a whole number: distance from +13.8 %",
        max(abs(calibrations[f].rise["standard"] - target) for f in (REPRODUCTION, "wave(n, 0.26)")),
        at_most=0.02,
        source="our bound on the calibration",
    )
    lock({f"{f}, {name}": c.rise[name] for f, c in calibrations.items() for name in NAMES}, rtol=1e-6)
    assert met


def solid_stress(name: str, crossing: Crossing | None) -> tuple[Analyser, Array]:
    """Method and von Mises stress (p,) of the solid."""
    analyser = material_points(SHAPE_FUNCTIONS[name], name, crossing)(cantilever())
    return analyser, analyser.solid_von_mises(analyser.problem.analyse(np.ones(len(analyser.x))))


@pytest.mark.slow
def test_stress_field(
    report: Report, lock: Lock, calibrations: dict[str, Calibration], uncrossed: Analyser, judge: Judge
) -> None:
    """Periodic overshoots of the stress (Fig. 12)

    In the cell that keeps one column of points the tent's stiffness is halved, so strain and stress there rise; the
    cell with three columns is too stiff. GIMP spreads what has crossed over both cells.
    """
    crossing = calibrations[REPRODUCTION].crossing
    fields = {name: solid_stress(name, crossing)[1] for name in SHAPE_FUNCTIONS}
    still = solid_stress("standard", None)[1]
    x = uncrossed.x
    exact = elasticity.von_mises(
        elasticity.stress(judge.model, judge(np.ones(len(x))).u, np.ones(len(judge.owner)))
    ).ravel()
    exact = np.bincount(judge.owner, exact) / np.bincount(judge.owner)  # mean over the elements of each point
    inner = (x[:, 0] > 4 * H) & (x[:, 0] < 36 * H)
    # the row nearest to the upper edge, where bending stress is largest and varies slowly
    top = np.flatnonzero(np.isclose(x[:, 1], x[:, 1].max()) & inner)
    top = top[np.argsort(x[top, 0])]
    rows = {
        name: {
            "RMS error": np.sqrt(np.sum((field - exact)[inner] ** 2) / np.sum(exact[inner] ** 2)),
            "largest overshoot, top row": (field / exact)[top].max() - 1,
            "largest undershoot, top row": (field / exact)[top].min() - 1,
        }
        for name, field in fields.items()
    }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("shape function")
    report.table("stress", table, "Von Mises stress over the fine reference's, more than 4 h from clamp and load.", 3)
    over = "largest overshoot, top row"
    holds = [
        report.check(
            "largest overshoot of the von Mises stress in the top row, standard",
            rows["standard"][over],
            at_least=float((still / exact)[top].max() - 1),
            source=paper.OVERSHOOTS,
            why="the direction: more than without crossing",
        ),
        report.check(
            "largest overshoot of the von Mises stress in the top row, GIMP over standard",
            rows["GIMP"][over] / rows["standard"][over],
            at_most=1.0,
            source=paper.OVERSHOOTS_MITIGATED,
            why="the direction: less than standard's",
        ),
    ]
    figure, axes = plt.subplots(3, 1, figsize=(5.4, 8.4))
    limit = float(np.percentile(fields["GIMP"], 99.5))
    for ax, name in zip(axes, NAMES, strict=False):
        drawn = draw_points(
            ax, x, uncrossed.half_length, fields[name], vmin=0, vmax=limit, label="von Mises stress [F/h]"
        )
        ax.set(title=name)
        figure.colorbar(drawn, ax=ax, label="[F/h]", extend="max")
    for name in SHAPE_FUNCTIONS:
        axes[2].plot(x[top, 0], fields[name][top], linewidth=1.2, label=name)
    axes[2].plot(x[top, 0], exact[top], color="0.5", linestyle="-", linewidth=1, label="fine reference")
    axes[2].set(xlabel="x / h", ylabel="von Mises stress [F/h]", title="top row of points", ylim=(0, None))
    axes[2].legend(fontsize="x-small")
    report.figure(
        "stress", figure, f"Von Mises stress of the solid, {crossing}; points drawn at their place in the body."
    )
    lock({f"{name}, {k}": float(v) for name, row in rows.items() for k, v in row.items()}, rtol=1e-6)
    assert all(holds)
