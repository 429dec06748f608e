"""The file that a run goes on from, bit for bit, after it was killed."""

import os
import zipfile
from dataclasses import fields
from pathlib import Path

import numpy as np

from mpmtop.optimize.protocols import State

# A resumed design is analysed again; an objective off by more than this, far above the rounding of any solver but below
# any physical change, shows that the problem is another in spite of its fingerprint.
RESUMED_OBJECTIVE_RTOL = 1e-6


class CheckpointError(ValueError):
    """A checkpoint is unreadable, or belongs to another problem or update rule; the message says what to do."""


def save_checkpoint(path: Path, run: str, state: State, objectives: list[float], solves: int) -> None:
    """Write all that a run needs to go on; a kill at any moment leaves the old file or the new one, never a part."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".partial")
    with partial.open("wb") as file:
        np.savez(file, run=run, objectives=objectives, solves=solves, **vars(state))
        file.flush()
        os.fsync(file.fileno())  # else a power cut could keep the new name and lose the content
    os.replace(partial, path)


def load_checkpoint(path: Path, run: str) -> tuple[State, list[float], int]:
    """State, objectives of all iterations so far and solves, from a file that must belong to `run`."""
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            content = {name: file[name] for name in file.files}
        written_by = str(content["run"])
        arrays = {field.name: content[field.name] for field in fields(State)}
        objectives, solves = content["objectives"].tolist(), int(content["solves"])
    except (OSError, EOFError, KeyError, TypeError, ValueError, zipfile.BadZipFile) as error:
        raise CheckpointError(f"{path} is not a complete checkpoint ({error}): delete it to start afresh") from error
    if written_by != run:
        raise CheckpointError(
            f"{path} belongs to another problem or update rule\n  in the file: {written_by!r}\n  asked for:   {run!r}\n"
            "give the same ones to resume it, or another file name, or delete it to start afresh"
        )
    arrays |= {"iteration": int(arrays["iteration"]), "scale": float(arrays["scale"])}
    return State(**arrays), objectives, solves
