"""What an analysis yields and costs, and what a quantity is that both methods compute."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from mpmtop.model import Model
from mpmtop.shape_functions import ShapeFunction
from reference_fem.elasticity import FemModel
from validation.bodies.crossing import Crossing


class Outcome(NamedTuple):
    """Errors by name, unknowns, nonzeros of K (both triangles) and bytes of the operators an analysis reads: weights of
    the points and the map from moduli to K, or element matrices and that map; the factor is not among them."""

    errors: dict[str, float]
    unknowns: int
    nonzeros: int
    stored: int


Measure = Callable[[], Outcome]
"""Takes the errors of an analysis that has been made: what it costs is no part of the method."""


MpmAnalysis = Callable[[int, ShapeFunction, int, Crossing], Measure]


FemAnalysis = Callable[[int, int], Measure]


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


@dataclass(frozen=True)
class Quantity:
    """What is computed by both methods: levels n of the grids and of the elements of both orders.

    `crossings` move the points as seeded; `cells` are those of the grid at a level, and the level `admits` some
    numbers of points per cell and direction. A level is run while points times nodes of a point are at most `weights`.
    Errors below what the reference has `resolved` are counted as that much.
    """

    name: str
    points: MpmAnalysis
    elements: FemAnalysis
    levels: tuple[int, ...]
    element_levels: Mapping[int, tuple[int, ...]]
    crossings: tuple[Crossing, ...]
    cells: Callable[[int], float]
    weights: int
    resolved: float = 0.0
    admits: Callable[[int, int], bool] = lambda n, ppc: True
