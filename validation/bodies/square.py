"""The square of the manufactured solution."""

import numpy as np
import scipy.sparse as sp

from mpmtop.crossing import Crossing
from mpmtop.shape_functions import ShapeFunction
from validation.bodies import manufactured
from validation.measures.outcome import Measure, Outcome, of_elements, stored_bytes


def square_points(n: int, shape_function: ShapeFunction, ppc: int, crossing: Crossing) -> Measure:
    """The manufactured solution with n cells per side."""
    done = manufactured.analysis(n, shape_function, crossing, ppc=ppc)

    def outcome() -> Outcome:
        touched = sp.csr_array((done.operators.N_matrix != 0).astype(float))
        inner = touched[:, np.unique(done.inside // 2)]
        # from the pattern: a product of the values could lose an entry to rounding
        nonzeros = 4 * (inner.T @ inner).nnz
        stored = stored_bytes(done.operators, done.VDB)
        return Outcome(done.errors._asdict(), len(done.inside), nonzeros, stored)

    return outcome


def square_elements(n: int, order: int) -> Measure:
    """The manufactured solution with n elements per side."""
    done = manufactured.finite_elements(n, order)
    return lambda: of_elements(done.model, done.errors._asdict())
