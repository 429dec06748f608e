"""Array types: real numbers, indices and masks, of any shape; a docstring says which."""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]


def distinct(keys: Index) -> Index:
    """The different numbers >= 0 among `keys` (n,), sorted.

    By sorting: NumPy 2.3's `np.unique` hashes them, which takes ten times as long for the million keys of a pattern.
    """
    keys = np.sort(keys)
    return keys[np.diff(keys, prepend=-1) != 0]
