"""What an analysis yields and costs."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from mpmtop.model import Model
from reference_fem.elasticity import FemModel


class Outcome(NamedTuple):
    """Errors by name, unknowns, nonzeros of K (both triangles) and bytes of the operators an analysis reads: weights of
    the points and the map from moduli to K, or element matrices and that map; the factor is not among them."""

    errors: dict[str, float]
    unknowns: int
    nonzeros: int
    stored: int


Measure = Callable[[], Outcome]
"""Takes the errors of an analysis that has been made: what it costs is no part of the method."""


def stored_bytes(*held: Any) -> int:
    """Bytes of all arrays and sparse matrices in the objects, which may be nested dataclasses."""
    total = 0
    for item in held:
        if isinstance(item, np.ndarray):
            total += item.nbytes
        elif sp.issparse(item):
            total += item.data.nbytes + item.indices.nbytes + item.indptr.nbytes
        elif hasattr(item, "__dataclass_fields__"):
            total += stored_bytes(*vars(item).values())
    return total


def of_points(model: Model, errors: dict[str, float]) -> Outcome:
    """Outcome of an analysis by material points."""
    K = model.stiffness
    stored = stored_bytes(model.transfer, K, model.ghost)
    return Outcome(errors, len(K.dof), 2 * len(K.row) - len(K.dof), stored)


def of_elements(model: FemModel, errors: dict[str, float]) -> Outcome:
    """Outcome of an analysis by finite elements."""
    stored = stored_bytes(model.stiffness, model.matrices, model.shape)
    return Outcome(errors, len(model.free), len(model.stiffness.indices), stored)
