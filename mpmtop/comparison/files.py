"""What a comparison leaves beside its page: designs as VTU, PNG and NPZ, histories and numbers as CSV, and the list of
designs as PVD."""

import csv
import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mpmtop import export
from mpmtop.comparison.entries import Comparison, Entry
from mpmtop.comparison.pictures import design_picture
from mpmtop.problem import DesignProblem
from reference_fem import simp

NUMBERS = "numbers.csv"
DESIGNS = "designs.pvd"
COLUMNS = (
    *("method", "crossing", "same_as", "own", "true", "violation", "true_cut", "violation_cut", "iterations"),
    *("analyses", "unknowns", "outcome", "refusal"),
)


def replace(path: Path, content: bytes) -> None:
    """Write a file whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    partial.write_bytes(content)
    os.replace(partial, path)


def rows(found: Comparison) -> list[dict[str, Any]]:
    """What is told of every entry."""
    told = []
    for entry in found.entries:
        row: dict[str, Any] = {"method": entry.method, "crossing": entry.crossing, "same_as": entry.same_as}
        row["refusal"] = entry.refusal
        if entry.run is not None and entry.prepared is not None:
            n = entry.run.numbers
            row |= {"own": entry.run.own, "true": n.truth, "violation": n.violation, "true_cut": n.cut}
            row |= {"violation_cut": n.cut_violation, "iterations": entry.run.iterations, "analyses": n.solves}
            row |= {"unknowns": entry.prepared.unknowns, "outcome": n.outcome}
        told.append(row)
    return told


def table(found: Sequence[dict[str, Any]], columns: Sequence[str]) -> bytes:
    """Rows as CSV, numbers to ten digits: the last ones are rounding, which the number of threads decides."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(
        {name: f"{value:.10g}" if isinstance(value, float) else value for name, value in row.items()} for row in found
    )
    return text.getvalue().encode()


def write_files(found: Comparison, folder: Path) -> dict[str, bytes]:
    """Write all files of a comparison into a folder; returns the pictures of the designs by the run's name."""
    pictures = {}
    replace(folder / NUMBERS, table(rows(found), COLUMNS))
    for entry in found.found:
        assert entry.run is not None and entry.prepared is not None
        run, at = entry.run, entry.prepared.design_points
        pictures[entry.slug] = design_picture(at, run.rho)
        replace(folder / f"{entry.slug}.png", pictures[entry.slug])
        steps = [{"iteration": k, "objective": o, "constraint": c} for k, (o, c) in enumerate(history(entry))]
        replace(folder / f"{entry.slug}.csv", table(steps, ("iteration", "objective", "constraint")))
        held = io.BytesIO()
        np.savez_compressed(held, x=at.x, half_length=at.half_length, volume=at.volume, rho=run.rho)
        replace(folder / f"{entry.slug}.npz", held.getvalue())
        if has_fields(entry):
            evaluation = entry.prepared.problem.analyse(run.rho)
            export.write_points(folder / f"{entry.slug}.vtu", entry.prepared.model, evaluation.state, run.rho)
    export.collection(folder / DESIGNS, dict(enumerate(f"{e.slug}.vtu" for e in found.found if has_fields(e))))
    return pictures


def history(entry: Entry) -> list[tuple[float, float]]:
    """Objective and largest constraint of every iteration."""
    assert entry.run is not None
    return list(zip(entry.run.objective.tolist(), entry.run.constraint.tolist(), strict=True))


def has_fields(entry: Entry) -> bool:
    """Whether the entry's state can be drawn and exported: of small strain."""
    problem = None if entry.prepared is None else entry.prepared.problem
    return isinstance(problem, DesignProblem | simp.DesignProblem)
