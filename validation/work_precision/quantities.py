"""The quantities of the study with their levels, and the finest ones."""

from collections.abc import Mapping

from validation.crossing import Periodic
from validation.manufactured import DeformedWave
from validation.work_precision.beam import beam_elements, beam_points
from validation.work_precision.bracket import bracket_elements, bracket_points
from validation.work_precision.cook import cook_elements, cook_points
from validation.work_precision.field import field_elements, field_points
from validation.work_precision.outcome import Quantity
from validation.work_precision.runs import UNCROSSED
from validation.work_precision.square import square_elements, square_points

MOST_WEIGHTS = 1_000_000
"""Weights of points on nodes up to which a level is run with --benchmark."""

SQUARE = Quantity(
    "square",
    square_points,
    square_elements,
    levels=(4, 8, 12, 16, 24),
    element_levels={1: (4, 8, 16, 32, 64), 2: (2, 4, 8, 16, 32)},
    arrangements=(UNCROSSED, Periodic(4), DeformedWave(8)),
    cells=lambda n: (n + 4) ** 2,
    weights=60_000,
)
BEAM = Quantity(
    "beam",
    beam_points,
    beam_elements,
    levels=(2, 4, 6, 8, 12),
    element_levels={1: (2, 4, 8, 16, 32), 2: (2, 4, 6, 8, 12)},
    arrangements=(UNCROSSED, Periodic(4)),
    cells=lambda n: 4 * n**2,
    weights=45_000,
)
COOK = Quantity(
    "cook",
    cook_points,
    cook_elements,
    levels=(4, 8, 12, 16, 24),
    element_levels={1: (4, 8, 16, 32, 64), 2: (2, 4, 8, 16, 32)},
    arrangements=(UNCROSSED, Periodic(4)),
    cells=lambda n: 0.625 * n**2,
    weights=42_000,
)
BRACKET = Quantity(
    "bracket",
    bracket_points,
    bracket_elements,
    levels=(10, 15, 20, 25, 30),
    element_levels={1: (10, 15, 20, 30, 50), 2: (5, 10, 15, 20, 30)},
    arrangements=(UNCROSSED, Periodic(4)),
    cells=lambda n: 0.64 * n**2,
    weights=42_000,
)
FIELD = Quantity(
    "field",
    field_points,
    field_elements,
    levels=(1, 2, 3, 4),
    element_levels={1: (1, 2, 3, 4), 2: (1,)},
    arrangements=(UNCROSSED, Periodic(4)),
    cells=lambda n: 800 * n**2,
    weights=120_000,
    admits=lambda n, ppc: n * ppc % 2 == 0,  # points divide the field's squares
)
FINEST: dict[str, tuple[Quantity, Mapping[int, tuple[int, ...]], tuple[int, ...]]] = {
    "square": (SQUARE, {1: (64, 128, 256), 2: (32, 64, 128)}, (32, 48, 64, 96)),
    "beam": (BEAM, {1: (32, 64, 96), 2: (16, 32, 48)}, (12, 16, 24, 32)),
    "cook": (COOK, {1: (64, 128, 192), 2: (32, 64, 96)}, (24, 32, 48, 96)),
    "bracket": (BRACKET, {1: (50, 100, 200), 2: (30, 50, 100)}, (30, 40, 50, 100)),
}
