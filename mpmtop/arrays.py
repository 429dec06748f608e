"""Array types: real numbers, indices and masks, of any shape; a docstring says which; and what is a number at all."""

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]


def number(value: Any) -> float:
    """A real number as a float; NaN, which no interval holds, for what is none: text, a complex number, an array."""
    return float(value) if _kind(value) == "number" else np.nan


def numbers(value: Any, count: int) -> bool:
    """Whether `value` is a sequence of so many finite real numbers."""
    return _kind(value) == f"{count} numbers" and bool(np.all(np.isfinite(value)))


def _kind(value: Any) -> str:
    try:
        given = np.asarray(value)
    except (TypeError, ValueError):  # ragged
        return ""
    if given.dtype.kind not in "biuf" or given.ndim > 1:
        return ""
    return "number" if given.ndim == 0 else f"{len(given)} numbers"


def distinct(keys: Index) -> Index:
    """The different numbers >= 0 among `keys` (n,), sorted.

    By sorting: NumPy 2.3's `np.unique` hashes them, which takes ten times as long for the million keys of a pattern.
    """
    keys = np.sort(keys)
    return keys[np.diff(keys, prepend=-1) != 0]
