"""The file that a run goes on from, bit for bit, after it was killed."""

import os
import zipfile
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from mpmtop.arrays import Array
from mpmtop.optimizers.protocols import State

# A resumed design is analysed again; an objective off by more than this, far above the rounding of any solver but below
# any physical change, shows that the problem is another in spite of its fingerprint.
RESUMED_OBJECTIVE_RTOL = 1e-6
SAME_START = 1e-9  # of the largest variable: rounding on another machine, below any change that is meant


class CheckpointError(ValueError):
    """A checkpoint is unreadable, or belongs to another run; the message says in what, and what to do."""


@dataclass(frozen=True, eq=False)
class Run:
    """What tells runs apart: the fingerprints of the problems of all stages, their update rules, the start (n,)."""

    problems: tuple[str, ...]
    updates: tuple[str, ...]
    start: Array


@dataclass(frozen=True, eq=False)
class Progress:
    """How far a run has come: its stage, the state of the rule, the stage's objectives and largest constraints (k+1,)
    up to here, and the solves of all stages."""

    stage: int
    state: State
    objectives: list[float]
    largest: list[float]
    solves: int


def save_checkpoint(path: Path, run: Run, progress: Progress) -> None:
    """Write all that a run needs to go on; a kill at any moment leaves the old file or the new one, never a part."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".partial")
    content = {**vars(progress), **vars(run)}
    state = content.pop("state")
    with partial.open("wb") as file:
        np.savez(file, **content, **vars(state))
        file.flush()
        os.fsync(file.fileno())  # else a power cut could keep the new name and lose the content
    os.replace(partial, path)


def load_checkpoint(path: Path, run: Run) -> Progress:
    """The progress that the file holds, which must belong to `run`."""
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            content = {name: file[name] for name in file.files}
        problems, updates = (tuple(content[name].tolist()) for name in ("problems", "updates"))
        written_by = Run(problems, updates, content["start"])
        arrays = {field.name: content[field.name] for field in fields(State)}
        arrays |= {"iteration": int(arrays["iteration"]), "scale": float(arrays["scale"])}
        objectives, largest = content["objectives"].tolist(), content["largest"].tolist()
        progress = Progress(int(content["stage"]), State(**arrays), objectives, largest, int(content["solves"]))
    except (OSError, EOFError, KeyError, TypeError, ValueError, zipfile.BadZipFile) as error:
        raise CheckpointError(f"{path} is not a complete checkpoint ({error}): delete it to start afresh") from error
    _check_same(path, written_by, run)
    return progress


def _check_same(path: Path, written: Run, asked: Run) -> None:
    remedy = "give the same to resume it, or another file name, or delete it to start afresh"
    for name, there, here in (
        ("update rule", written.updates, asked.updates),
        ("problem (its body, points, material, loads, filter or bounds differ)", written.problems, asked.problems),
    ):
        if there != here:
            raise CheckpointError(
                f"{path} belongs to another {name}\n  in the file: {' then '.join(there)}\n"
                f"  asked for:   {' then '.join(here)}\n{remedy}"
            )
    near = SAME_START * np.max(np.abs(asked.start))
    if written.start.shape != asked.start.shape or not np.all(np.abs(written.start - asked.start) <= near):
        raise CheckpointError(f"{path} belongs to a run from another start: {remedy}")
