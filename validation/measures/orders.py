"""How fast an error falls."""

from typing import Any

import numpy as np


def observed_order(coarse: Any, fine: Any, ratio: float = 2.0) -> Any:
    """Observed order p of errors e = c h^p of one sign on two levels, h_coarse = ratio h_fine:
    log(e_coarse / e_fine) / log(ratio), number by number of floats, arrays or pandas' series.

    It is that of the levels given: check that it is settled by a pair before, or state what the next term leaves.
    Raises ValueError unless ratio > 1.
    """
    if not ratio > 1:
        raise ValueError(f"ratio {ratio:g}: give h of the coarse level over that of the fine one, which is above 1")
    return np.log2(np.divide(coarse, fine)) / np.log2(ratio)
