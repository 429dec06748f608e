"""One run of one method: optimised, judged and kept, so that it is never made twice, nor anew after it was killed."""

import hashlib
import json
import os
import re
import time
import warnings
import zipfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import mpmtop
from mpmtop.arrays import Array
from mpmtop.comparison.asked import METHODS, NONE, Asked
from mpmtop.comparison.judging import Truth, cut_truth, judge_of
from mpmtop.comparison.methods import Prepared, prepare
from mpmtop.comparison.progress import Progress, say
from mpmtop.criteria import NothingMoves, PlaceInVoid
from mpmtop.errors import NotConverged, PointOutsideGrid, UnsupportedBody
from mpmtop.optimizers import optimize
from mpmtop.optimizers.checkpoint import CheckpointError
from mpmtop.optimizers.loop import Infeasible
from mpmtop.page.numbers import number
from reference_fem.reanalyse import thresholded

EVERY = 5
"""Iterations between two checkpoints: a kill costs at most as many, and writing them next to nothing."""
STOPS = (NotConverged, UnsupportedBody, PointOutsideGrid)
"""What ends a run before its time: the last design that could be analysed stands."""


@dataclass(frozen=True)
class Numbers:
    """What a run came to, beside its arrays: how it ended, its analyses, and the truth of its design, `cut` to black
    and white, too. `error` says what ended it before its time, `remark` what the design warns of, "" for nothing."""

    outcome: str
    solves: int
    truth: float
    violation: float
    cut: float
    cut_violation: float
    error: str = ""
    remark: str = ""


@dataclass(frozen=True, eq=False)
class Run:
    """Densities (p,) of the last design and the histories (k + 1,) of its objective and its largest constraint."""

    rho: Array
    objective: Array
    constraint: Array
    numbers: Numbers

    @property
    def own(self) -> float:
        """The method's own value of the objective of its design."""
        return float(self.objective[-1])

    @property
    def iterations(self) -> int:
        """Updates made."""
        return len(self.objective) - 1


def label(method: str, crossing: str) -> str:
    """A run in words."""
    return METHODS[method] if crossing == NONE else f"{METHODS[method]}, {crossing}"


def slug(method: str, crossing: str) -> str:
    """A run as the name of a file."""
    return method if crossing == NONE else f"{method}-{re.sub(r'[^a-z0-9.]+', '-', crossing).strip('-')}"


def key_of(asked: Asked, prepared: Prepared) -> str:
    """Hash of all that a run depends on."""
    said = (mpmtop.__version__, prepared.problem.fingerprint, repr(asked.rule), asked.iterations, asked.load_steps)
    return hashlib.sha256(repr(said).encode()).hexdigest()[:16]


def run_of(asked: Asked, method: str, crossing: str, folder: Path, live: bool) -> tuple[Run, float]:
    """The run, from where it was left, and the CPU time that it took now [s]; it is kept in the folder."""
    start = time.process_time()
    prepared = prepare(asked, method, crossing)
    name = slug(method, crossing)
    path = folder / f"{name}-{key_of(asked, prepared)}.npz"
    progress = Progress(label(method, crossing), asked.iterations, live)
    run = _judged(asked, prepared, optimised(asked, prepared, path.with_suffix(".checkpoint.npz"), progress))
    keep(path, run)
    path.with_suffix(".checkpoint.npz").unlink(missing_ok=True)
    seconds = time.process_time() - start
    say(
        f"{progress.label}: {number(run.own, 5)} after {run.iterations} iterations ({run.numbers.outcome}), in truth "
        f"{number(run.numbers.truth, 5)}; {seconds:.1f} s of CPU time"
    )
    return run, seconds


class Ended(NamedTuple):
    """What an optimisation came to: densities (p,), histories (k + 1,), analyses, how it ended, the error that ended it
    before its time, and what the last design warns of, "" for none."""

    rho: Array
    objective: Array
    constraint: Array
    solves: int
    outcome: str
    error: str
    remark: str


Follow = Callable[[Iterator[Any]], Iterator[Any]]
"""Passes iterates on, and does what it likes with them."""


def optimised(asked: Asked, prepared: Prepared, checkpoint: Path, progress: Progress, follow: Follow = iter) -> Ended:
    """The method's optimisation as far as it goes, from where the checkpoint left it; a damaged one is left aside."""
    history = _history(checkpoint)
    last: Any = None
    error = ""
    try:
        for last in follow(_iterates(asked, prepared.problem, checkpoint)):
            history[last.iteration] = (last.objective, float(np.max(last.constraints)))
            progress(last)
    except STOPS as stop:
        if last is None:
            raise
        error = str(stop)
    rows = np.array([history[k] for k in range(last.iteration + 1)])
    outcome = "stopped" if error else last.outcome.replace("_", " ")
    remarks = getattr(prepared.problem, "remarks", lambda evaluation: ())(last.evaluation)
    remark = ". ".join(str(each) for each in remarks)
    return Ended(last.evaluation.rho, rows[:, 0], rows[:, 1], last.solves, outcome, error, remark)


def _iterates(asked: Asked, problem: Any, checkpoint: Path) -> Iterator[Any]:
    def again() -> Iterable[Any]:
        return optimize(
            problem, asked.rule, max_iterations=asked.iterations, checkpoint=checkpoint, checkpoint_every=EVERY
        )

    with warnings.catch_warnings():
        for told in (Infeasible, NothingMoves, PlaceInVoid):  # by the outcome, by the remark
            warnings.simplefilter("ignore", told)
        iterates = iter(again())
        try:
            first = next(iterates)
        except CheckpointError as error:
            say(f"{error}; started afresh")
            checkpoint.unlink()
            iterates = iter(again())
            first = next(iterates)
        yield first
        yield from iterates


def _history(checkpoint: Path) -> dict[int, tuple[float, float]]:
    """Objective and largest constraint by iteration, as far as a checkpoint holds them."""
    if not checkpoint.exists():
        return {}
    try:
        with np.load(checkpoint, allow_pickle=False) as file:
            return dict(enumerate(zip(file["objectives"].tolist(), file["largest"].tolist(), strict=True)))
    except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile):
        return {}  # `optimize` says so


def _judged(asked: Asked, prepared: Prepared, ended: Ended) -> Run:
    at = prepared.design_points
    judge = judge_of(asked, at)
    grey, cut = (judge(design) for design in (ended.rho, thresholded(ended.rho, at.volume)))
    cut = cut_truth(asked, grey, cut)
    numbers = Numbers(
        *(ended.outcome, ended.solves, grey.objective, grey.violation, cut.objective, cut.violation),
        *(ended.error, ended.remark),
    )
    return Run(ended.rho, ended.objective, ended.constraint, numbers)


def own_error(asked: Asked, prepared: Prepared, run: Run, split: int) -> float:
    """Relative change of the truth of a run's design when the judge has `split` elements along a point's side."""
    finer: Truth = judge_of(asked, prepared.design_points, split)(run.rho)
    return finer.objective / run.numbers.truth - 1


def keep(path: Path, run: Run) -> None:
    """Write a run, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"{path.name}.{os.getpid()}")
    told = json.dumps(asdict(run.numbers))
    with partial.open("wb") as file:
        np.savez_compressed(file, rho=run.rho, objective=run.objective, constraint=run.constraint, numbers=told)
    os.replace(partial, path)


def kept(path: Path) -> Run | None:
    """A run that was kept; None if there is none that can be read."""
    try:
        with np.load(path, allow_pickle=False) as file:
            numbers = Numbers(**json.loads(str(file["numbers"])))
            return Run(file["rho"], file["objective"], file["constraint"], numbers)
    except (OSError, EOFError, KeyError, TypeError, ValueError, zipfile.BadZipFile):
        return None
