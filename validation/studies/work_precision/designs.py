"""Optimised designs: what each costs, and its true objective."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from mpmtop.arrays import Array
from mpmtop.problem import design_problem as points_problem
from mpmtop.shape_functions import tent
from reference_fem.reanalyse import Judge, build_judge
from reference_fem.simp import design_problem
from validation.measures.outcome import of_elements, of_points
from validation.measures.timing import measured
from validation.methods.analyser import DensityField
from validation.studies.work_precision.field import optimised, tip_scene


class Optimised(NamedTuple):
    """An optimisation's design, the unknowns and nonzeros of K of its analyses, and its objective as it sees it."""

    design: DensityField
    unknowns: int
    nonzeros: int
    objective: float


def optimised_points(per_h: float, ppc: int) -> Optimised:
    """40 iterations by the tent on cells of size h / per_h with ppc x ppc points each, filter radius 1.5h."""
    problem = points_problem(tip_scene(), 1 / per_h, ppc, tent)
    model = problem.model
    rho = optimised(problem)
    cost = of_points(model, {})
    design = DensityField(model.points.x, model.points.half_length, rho)
    return Optimised(design, cost.unknowns, cost.nonzeros, float(problem.analyse(rho).objective))


def optimised_elements(size: float) -> Optimised:
    """40 iterations by bilinear elements of a size [h], one density for each."""
    problem = design_problem(tip_scene(), size)
    rho = optimised(problem)
    cost = of_elements(problem.model, {})
    design = DensityField(problem.model.centres, np.full_like(problem.model.centres, size / 2), rho)
    return Optimised(design, cost.unknowns, cost.nonzeros, float(problem.analyse(rho).objective))


def true_compliance(designs: Mapping[Any, DensityField], pitch: float = 0.5) -> dict[Any, float]:
    """Compliance of each design by biquadratic elements no wider than `pitch` [h], one judge for each spacing."""
    judges: dict[float, Judge] = {}
    positions: dict[float, Array] = {}
    found = {}
    for name, design in designs.items():
        spacing = round(2 * float(design.half_length.min()), 9)
        if spacing not in judges:
            split = int(np.ceil(spacing / pitch - 1e-9))
            judges[spacing] = build_judge(tip_scene(), design.x, design.half_length, split)
            positions[spacing] = design.x
        found[name] = judges[spacing](design.at(positions[spacing])).compliance
    return found


def optimisations(routes: Mapping[str, tuple[float, tuple[int, ...]]], sizes: Sequence[float]) -> pd.DataFrame:
    """Optimised designs by method, cells and points per cell: cost, own and true objective."""
    runs = {}
    for cells, (per_h, all_ppc) in routes.items():
        for ppc in all_ppc:
            runs["standard", cells, ppc] = measured(partial(optimised_points, per_h, ppc))
    for size in sizes:
        runs["FEM Q1", f"elements {size:g}h", 0] = measured(partial(optimised_elements, size))
    true = true_compliance({case: run.design for case, (run, _) in runs.items()})
    frame = pd.DataFrame.from_dict(
        {
            case: {
                "variables": len(run.design.rho),
                "unknowns": run.unknowns,
                "nonzeros": run.nonzeros,
                "own compliance": run.objective,
                "true compliance": true[case],
                "seconds": seconds,
            }
            for case, (run, seconds) in runs.items()
        },
        orient="index",
    ).astype(dict.fromkeys(("variables", "unknowns", "nonzeros"), int))
    frame.index = pd.MultiIndex.from_tuples(runs, names=["method", "cells", "ppc"])
    return frame


def design_name(method: str, cells: str, ppc: int) -> str:
    return f"{method}, {cells}" + (f", {ppc} x {ppc} points" if ppc else "")
