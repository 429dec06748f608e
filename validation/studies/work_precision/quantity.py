"""What a quantity is that both methods compute, at many levels."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from mpmtop.crossing import Crossing
from mpmtop.shape_functions import ShapeFunction
from validation.measures.outcome import Measure

MpmAnalysis = Callable[[int, ShapeFunction, int, Crossing], Measure]


FemAnalysis = Callable[[int, int], Measure]


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
