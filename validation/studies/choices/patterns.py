"""Patterns of crossing: tips and optima of every member of every family, distances to the paper's four numbers."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from mpmtop.crossing import FAMILIES, Crossing
from validation import paper
from validation.harness.report import Report
from validation.studies.choices import cantilever
from validation.studies.choices.cantilever import Base

NAMES = ("standard", "GIMP")


class Numbers(NamedTuple):
    """The paper's four: rise of both tips, and both optima."""

    tip_standard: float
    tip_gimp: float
    standard: float
    gimp: float

    @property
    def distance(self) -> float:
        """Root mean square of the relative differences of the four displacements to the paper's; no difference for
        GIMP's tip where it keeps the bound."""
        ours = np.array([1 + self.tip_standard, max(1 + self.tip_gimp, 1 + STATED.tip_gimp), self.standard, self.gimp])
        theirs = np.array([1 + STATED.tip_standard, 1 + STATED.tip_gimp, STATED.standard, STATED.gimp])
        return float(np.sqrt(np.mean((ours / theirs - 1) ** 2)))


STATED = Numbers(
    paper.CANTILEVER_CROSSING_TIP_STANDARD.value,
    paper.CANTILEVER_CROSSING_TIP_GIMP.value,
    paper.CANTILEVER_CROSSING_STANDARD.value,
    paper.CANTILEVER_CROSSING_GIMP.value,
)
Patterns = Mapping[tuple[Base, str, Crossing], Numbers]
"""By cantilever, family and member."""


def computed(bases: Iterable[Base]) -> tuple[Patterns, dict[Base, float]]:
    """Every member of every family on every cantilever, uniform start; and the optima without crossing."""
    bases = list(bases)
    members = [(base, family, member) for base in bases for family in FAMILIES for member in FAMILIES[family]]
    still = {base: {name: cantilever.tip(base, name) for name in NAMES} for base in bases}
    rises = {
        (base, member, name): cantilever.tip(base, name, member) / still[base][name] - 1
        for base, _, member in members
        for name in NAMES
    }
    cases = [(base, name, member, 0) for base, _, member in members for name in NAMES]
    runs = cantilever.optima([*cases, *((base, "standard", None, 0) for base in bases)])
    final = {case[:3]: run.final for case, run in zip(cases, runs, strict=False)}
    found = {
        (base, family, member): Numbers(
            *(rises[base, member, name] for name in NAMES), *(final[base, name, member] for name in NAMES)
        )
        for base, family, member in members
    }
    return found, {base: run.final for base, run in zip(bases, runs[len(cases) :], strict=True)}


def calibrated(found: Patterns, base: Base, family: str) -> Crossing:
    """The member of a family whose tip by standard MPM is nearest to the paper's, as the study of crossing has it."""
    rises = {member: numbers.tip_standard for (b, f, member), numbers in found.items() if (b, f) == (base, family)}
    return min(rises, key=lambda member: abs(rises[member] - STATED.tip_standard))


def said(base: Base) -> str:
    """The cantilever in words."""
    return f"load at {base.load}, radius {base.radius:g}"


def tabulate(report: Report, found: Patterns, still: Mapping[Base, float]) -> None:
    rows: dict[tuple[str, str], dict[str, float]] = {}
    labels = ("tip, standard", "tip, GIMP", "optimum, standard", "optimum, GIMP")
    rows["the paper", "not stated"] = dict(zip(labels, STATED, strict=True)) | {
        f"over uncrossed, {name}": value / paper.CANTILEVER_COMPLIANCE.value - 1
        for name, value in zip(NAMES, STATED[2:], strict=True)
    }
    for (base, _, member), numbers in found.items():
        rows[said(base), str(member)] = dict(zip(labels, numbers, strict=True)) | {
            "over uncrossed, standard": numbers.standard / still[base] - 1,
            "over uncrossed, GIMP": numbers.gimp / still[base] - 1,
            "distance": numbers.distance,
        }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis(["cantilever", "member"])
    caption = (
        "Every member of every family on both cantilevers: rise of the solid's tip, optimum [F²/E0] by its own "
        "analysis, its rise over the optimum without crossing, and the distance to the paper's four numbers: the root "
        "mean square of their relative differences, as displacements, none where GIMP's tip keeps its bound."
    )
    percent = [column for column in table.columns if column.split(",")[0] in ("tip", "over uncrossed", "distance")]
    report.table("patterns", table, caption, 4, percent=percent)


def draw(report: Report, found: Patterns) -> None:
    bases = list(dict.fromkeys(base for base, _, _ in found))
    figure, axes = plt.subplots(1, 1 + len(bases), figsize=(8.4, 3.4))
    of_base = [{key[1:]: n for key, n in found.items() if key[0] == base} for base in bases]
    for family, marker in zip(FAMILIES, "osv^", strict=True):
        scatter(
            axes[0], family, marker, [(n.tip_standard, n.tip_gimp) for (f, _), n in of_base[0].items() if f == family]
        )
        for ax, of in zip(axes[1:], of_base, strict=True):
            scatter(ax, family, marker, [(n.standard, n.gimp) for (f, _), n in of.items() if f == family])
    axes[0].plot(STATED.tip_standard, STATED.tip_gimp, "k*", markersize=9, label="the paper")
    axes[0].set(xlabel="rise of the tip, standard", ylabel="rise of the tip, GIMP", title="solid", ylim=(-0.005, 0.16))
    for ax, base in zip(axes[1:], bases, strict=True):
        ax.plot(STATED.standard, STATED.gimp, "k*", markersize=9)
        ax.set(xlabel="optimum, standard", ylabel="optimum, GIMP", title=said(base), xlim=(80, 112), ylim=(80, 112))
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    report.figure(
        "patterns",
        figure,
        "Tips and optima of all members; beyond the frame on the left: uniform shifts of 0.7 h and more.",
    )


def scatter(ax: Axes, family: str, marker: str, values: list[tuple[float, float]]) -> None:
    """One family's members as markers."""
    ax.plot(*np.transpose(values), linestyle="none", marker=marker, markersize=4, fillstyle="none", label=family)
