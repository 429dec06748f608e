"""Figures: shifts of the body, cuts of its corner, contrast of its moduli."""

import matplotlib.pyplot as plt
import numpy as np

from mpmtop.arrays import Array
from mpmtop.equilibrium import equilibrium
from mpmtop.model import Model
from mpmtop.objectives import compliance
from validation.harness.report import Report
from validation.oracles.extended import condition, plain_condition
from validation.studies.stability.cases import CELLS, DIRECTIONS, GHOST, model_of
from validation.studies.stability.judge import direct

Cuts = dict[tuple[str, float], dict[str, float]]
"""Quantities by remedy and size of the cut."""


def draw_positions(report: Report) -> None:
    shifts = np.concatenate([[0.01, 0.03], np.linspace(0.06, 0.74, 12), [0.7499, 0.7501], np.linspace(0.8, 0.95, 4)])
    figure, axes = plt.subplots(3, 2, figsize=(8.0, 7.0), sharex=True, sharey="row")
    bodies = ("tent", "tent", 0.0), ("GIMP", "GIMP", 0.0), ("GIMP, ghost", "GIMP", GHOST), ("B-spline", "B-spline", 0.0)
    for column, direction in zip(axes.T, ("x", "y"), strict=True):
        for name, function, ghost in bodies:
            kept = shifts if direction == "y" or function == "GIMP" else shifts[shifts < 0.75]  # else an error
            rows = [shifted(function, np.multiply(DIRECTIONS[direction], s), ghost) for s in kept]
            for ax, values in zip(column, np.array(rows).T, strict=True):
                ax.semilogy(kept, values, label=name)
        column[-1].set(xlabel=f"shift in {direction} / h")
    labels = "condition of K", "condition, scaled", "error of the deflection"
    for ax, label in zip(axes[:, 0], labels, strict=True):
        ax.set(ylabel=label)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    report.figure(
        "positions",
        figure,
        "Condition numbers, and error of the deflection under the load, against the shift: its change to the body as "
        "seeded beside that of a Timoshenko beam whose lever arm changes as that of the points that carry the load.",
    )


def shifted(function: str, shift: Array, ghost: float) -> tuple[float, float, float]:
    """Condition numbers, plain and scaled, and error of the deflection of the solid body."""
    still, model = (direct(model_of(function, s, ghost=ghost)) for s in ((0.0, 0.0), shift))
    solid = np.ones(len(model.points.x))
    ratio = compliance(model, equilibrium(model, solid)) / compliance(still, equilibrium(still, solid))
    error = ratio * deflection(lever(still)) / deflection(lever(model)) - 1
    return plain_condition(model, solid), condition(model, solid), abs(error)


def lever(model: Model) -> float:
    """Distance from the clamp of the points that carry the load."""
    (load,) = model.body.loads
    acts = load.act(model.points.x, model.points.volume, 1e-9)
    return float(-acts.carried[:, 1] @ model.points.x[acts.points, 0])


def deflection(arm: float) -> float:
    """Of a Timoshenko beam of height 2 under a unit force, plane strain, nu = 0.3, E = 1."""
    nu, height = 0.3, CELLS[1]
    return float(4 * (1 - nu**2) * arm**3 / height**3 + arm * 2 * (1 + nu) / (5 / 6 * height))


def column(rows: Cuts, remedy: str) -> dict[str, list[float]]:
    """The numbers of one remedy, by quantity, in the order of the cuts; the cuts themselves as "cut"."""
    part = {s: row for (name, s), row in rows.items() if name == remedy}
    return {key: [row[key] for row in part.values()] for key in next(iter(part.values()))} | {"cut": list(part)}


def draw_cuts(report: Report, rows: Cuts) -> None:
    figure, axes = plt.subplots(1, 3, figsize=(8.0, 3.2))
    for remedy in ("none", "ghost penalty"):
        part = column(rows, remedy)
        axes[0].loglog(part["cut"], part["condition"], label=remedy)
        axes[0].loglog(part["cut"], part["condition, scaled"], label=f"{remedy}, scaled")
        color = axes[0].get_lines()[-2].get_color()
        axes[1].loglog(part["cut"], part["points, change"], color=color)
        axes[2].loglog(part["cut"], part["nodes over points"], color=color)
    titles = ("condition number", "change at points", "nodes over points")
    for ax, title in zip(axes, titles, strict=True):
        ax.set(xlabel="cut / h", title=title)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    report.figure("small_cuts", figure, "Condition numbers and displacements against the size of a cut at a corner.")


def draw_contrast(report: Report, rows: list[tuple[str, float, float, float]]) -> None:
    figure, axes = plt.subplots(1, 2, figsize=(8.0, 3.4), sharey=True)
    for ax, i, quantity in zip(axes, (2, 3), ("compliance", "gradient of the p-norm"), strict=True):
        for name in dict.fromkeys(row[0] for row in rows):
            part = [(row[1], max(row[i], 1e-17)) for row in rows if row[0] == name]
            ax.loglog(*zip(*part, strict=True), label=name)
        ax.set(xlabel="E_min / E0", title=quantity)
    axes[0].set(ylabel="relative error")
    axes[0].legend(fontsize="x-small")
    report.timed.figure("contrast_errors", figure, "Errors against the contrast: loaded end on void.")
