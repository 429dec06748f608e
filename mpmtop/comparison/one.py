"""One design by one method: optimised from where it was left, and written."""

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from mpmtop import export, plot
from mpmtop.comparison.asked import Asked
from mpmtop.comparison.files import replace, table
from mpmtop.comparison.methods import Prepared, prepare
from mpmtop.comparison.pictures import design_picture
from mpmtop.comparison.progress import Progress, say
from mpmtop.comparison.runs import Ended, key_of, label, optimised, slug
from mpmtop.page.numbers import number


def optimise(asked: Asked, folder: Path, *, every: int | None, live: bool) -> str:
    """Optimise by the one method asked for and write design.vtu, .png, .npz and history.csv; with `every` also a
    picture and a VTU of each so many iterations. Returns the sentence that says what came out."""
    ((method, crossing),) = asked.runs
    prepared = prepare(asked, method, crossing)
    for finding in prepared.findings:
        say(f"warning, {finding}")
    checkpoint = folder / f"{slug(method, crossing)}-{key_of(asked, prepared)}.checkpoint.npz"
    progress = Progress(label(method, crossing), asked.iterations, live)

    def followed(iterates: Iterator[Any]) -> Iterator[Any]:
        if every is None or asked.load_steps:
            return iterates
        drawn = plot.live(folder / "frames", prepared.model, iterates, every)
        return export.series(folder / "run.pvd", prepared.model, drawn, every)

    ended = optimised(asked, prepared, checkpoint, progress, followed)
    _write(asked, prepared, ended, folder)
    if ended.remark:
        say(f"warning, {ended.remark}")
    return (
        f"{label(method, crossing)}: {number(ended.objective[-1], 6)} after {len(ended.objective) - 1} iterations "
        f"({ended.outcome}){f'; {ended.error}' if ended.error else ''}. Written to {folder}"
    )


def _write(asked: Asked, prepared: Prepared, ended: Ended, folder: Path) -> None:
    at, rho = prepared.design_points, ended.rho
    replace(folder / "design.png", design_picture(at, rho))
    steps = zip(ended.objective.tolist(), ended.constraint.tolist(), strict=True)
    rows = [{"iteration": k, "objective": o, "constraint": c} for k, (o, c) in enumerate(steps)]
    replace(folder / "history.csv", table(rows, ("iteration", "objective", "constraint")))
    held = io.BytesIO()
    np.savez_compressed(held, x=at.x, half_length=at.half_length, volume=at.volume, rho=rho)
    replace(folder / "design.npz", held.getvalue())
    if asked.load_steps is None:
        state = prepared.problem.analyse(rho).state
        export.write_points(folder / "design.vtu", prepared.model, state, rho)
