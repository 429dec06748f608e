"""Cell crossing: L-bracket (Figs. 14, 15)

Stress with induced crossing: the L-bracket of Figs. 10 and 11, its points moved as on the cantilever by the family
calibrated there. p-norm of the relaxed von Mises stress of solid material, h = F = E0 = 1. Densities live on the
points' places in the body, before the shift.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from mpmtop.arrays import Array
from mpmtop.points import seed
from validation import paper
from validation.bodies.patterns import define
from validation.bodies.scenes import CORNER, SPACING, l_bracket
from validation.bodies.sketch import CHOSEN, opening
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.measures.drawing import draw_points
from validation.methods.analyser import Analyser
from validation.studies.crossing.l_bracket.bracket import CROSSING, RTOL_ANALYSIS, p_norm, solid_von_mises

# points are moved off the clamp and over grid lines on purpose
pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

ASKED = "What does crossing do to designs of low stress: by the method that makes them, and in truth?"


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
    define(report.opening, [CROSSING])
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
        at_most=1.0,
        source=paper.STRESS_OSCILLATES,
        why="the direction: GIMP's difference is the smaller one",
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
    drawn = {name: fields[name] for name in ("FEM", "standard", "GIMP")}
    draw_fields(report, drawn, {path: x[on] for path, on in paths.items()})
    lock({f"p-norm of the solid, {name}": norm for name, norm in norms.items()}, rtol=RTOL_ANALYSIS)
    assert smoother


def draw_fields(report: Report, fields: dict[str, Array], paths: dict[str, Array]) -> None:
    figure, axes = plt.subplots(1, 3, figsize=(8.0, 3.2), sharey=True)
    x = seed(l_bracket().body.domain, (SPACING, SPACING))
    limit = float(np.percentile(fields["FEM"], 99.5))
    for ax, (name, field) in zip(axes, fields.items(), strict=True):
        drawn = draw_points(ax, x.x, x.half_length, field, vmin=0, vmax=limit, label="von Mises stress [F/h]")
        ax.set(title=name, ylabel="y / h" if ax is axes[0] else "")
    for path in paths.values():
        axes[0].plot(path[:, 0], path[:, 1], color="white", linewidth=0.8, linestyle=":")
    figure.colorbar(drawn, ax=axes, label=drawn.get_label(), extend="max", shrink=0.8)
    report.figure(
        "fields", figure, f"Von Mises stress of the solid bracket, MPM with {CROSSING}; dotted: the two lines."
    )
