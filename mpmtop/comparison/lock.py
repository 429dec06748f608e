"""The lock of a comparison: its objective values kept beside the scene, and what has moved since."""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mpmtop.comparison.entries import relative
from mpmtop.comparison.files import replace, table
from mpmtop.comparison.runs import label
from mpmtop.page.numbers import number

LOCKED = ("own", "true", "true_cut")
COLUMNS = ("method", "crossing", *LOCKED)
TOLERANCE = 2e-3
"""Relative: a hundred iterations amplify another processor's rounding to a few 1e-4."""


def lock_path(scene_file: Path) -> Path:
    """Where the values of a scene are kept."""
    return scene_file.with_suffix(".lock.csv")


def write_lock(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Keep the values of all runs."""
    kept = [{name: row[name] for name in COLUMNS} for row in rows if "own" in row]
    replace(path, table(kept, COLUMNS))


def moved_since(path: Path, rows: Sequence[dict[str, Any]]) -> list[str]:
    """A sentence for each value that is not what was kept, or no longer there. ValueError if the file cannot be
    read."""
    now = {(row["method"], row["crossing"]): row for row in rows if "own" in row}
    try:
        with path.open(newline="") as file:
            reader = csv.DictReader(file)
            read = list(reader)
        if not set(COLUMNS) <= set(reader.fieldnames or ()):
            raise ValueError(f"no columns {', '.join(COLUMNS)}")
        kept = [(row["method"], row["crossing"], {name: float(row[name]) for name in LOCKED}) for row in read]
    except (KeyError, TypeError, ValueError, OSError) as error:
        raise ValueError(f"{path} holds no locked values ({error}): delete it, and lock anew") from error
    said = []
    for method, crossing, values in kept:
        row = now.pop((method, crossing), None)
        if row is None:
            said.append(f"{label(method, crossing)}: was kept and is not among these runs")
            continue
        for name, before in values.items():
            if not np.isclose(row[name], before, rtol=TOLERANCE, atol=0, equal_nan=True):
                change = relative(row[name], before)
                what = name.replace("_", " ")
                said.append(
                    f"{label(method, crossing)}: {what} {number(row[name], 5)} was {number(before, 5)} ({change:+.2%})"
                )
    return said + [f"{label(method, crossing)}: was not kept" for method, crossing in now]
