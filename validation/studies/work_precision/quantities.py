"""The quantities of the study with their levels, and the finest ones."""

from collections.abc import Mapping
from dataclasses import replace

from mpmtop.crossing import Periodic
from validation.bodies.beam import beam_elements, beam_points
from validation.bodies.bracket import bracket_elements, bracket_points
from validation.bodies.cook import cook_elements, cook_points
from validation.bodies.manufactured import DeformedWave
from validation.bodies.square import square_elements, square_points
from validation.studies.work_precision.field import field_elements, field_points
from validation.studies.work_precision.quantity import Quantity

SQUARE = Quantity(
    "square",
    square_points,
    square_elements,
    levels=(4, 8, 12, 16, 24),
    element_levels={1: (4, 8, 16, 32, 64), 2: (2, 4, 8, 16, 32)},
    crossings=(Periodic(4), DeformedWave(8)),
    cells=lambda n: (n + 4) ** 2,
    weights=37_000,
)
BEAM = Quantity(
    "beam",
    beam_points,
    beam_elements,
    levels=(2, 4, 6, 8, 12),
    element_levels={1: (2, 4, 8, 16, 32), 2: (2, 4, 6, 8, 12)},
    crossings=(Periodic(4),),
    cells=lambda n: 4 * n**2,
    weights=21_000,
)
COOK = Quantity(
    "cook",
    cook_points,
    cook_elements,
    levels=(4, 8, 12, 16, 24),
    element_levels={1: (4, 8, 16, 32, 64), 2: (2, 4, 8, 16, 32)},
    crossings=(Periodic(4),),
    cells=lambda n: 0.625 * n**2,
    weights=24_000,
    resolved=1e-4,
)
BRACKET = Quantity(
    "bracket",
    bracket_points,
    bracket_elements,
    levels=(5, 10, 15, 20, 30),
    element_levels={1: (10, 15, 20, 30, 50), 2: (5, 10, 15, 20, 30)},
    crossings=(Periodic(4),),
    cells=lambda n: 0.64 * n**2,
    weights=21_000,
    resolved=2e-4,
    admits=lambda n, ppc: n > 5 or ppc > 1,  # a cell around the path's ends leaves the body of five cells
)
FIELD = Quantity(
    "field",
    field_points,
    field_elements,
    levels=(1, 2, 3, 4, 5),
    element_levels={1: (1, 2, 3, 4, 5), 2: (1,)},
    crossings=(Periodic(4),),
    cells=lambda n: 200 * n**2,
    weights=81_000,
    resolved=2e-3,
    admits=lambda n, ppc: n * ppc % 2 == 0,  # points divide the field's squares
)


def finest(quantity: Quantity, levels: tuple[int, ...], element_levels: Mapping[int, tuple[int, ...]]) -> Quantity:
    """The quantity at levels that only --benchmark runs, up to a million weights of points on nodes."""
    return replace(quantity, levels=levels, element_levels=element_levels, weights=1_000_000)


FINEST = {
    "square": finest(SQUARE, (32, 48, 64, 96), {1: (64, 128, 256), 2: (32, 64, 128)}),
    "beam": finest(BEAM, (12, 16, 24, 32), {1: (32, 64, 96), 2: (12, 16, 24)}),
    "cook": finest(COOK, (24, 32, 48, 96), {1: (64, 128, 192), 2: (16, 32, 48)}),
    "bracket": finest(BRACKET, (30, 40, 50, 100), {1: (50, 100, 200), 2: (30, 50, 100)}),
    "field": finest(FIELD, (2, 3, 4, 5, 6, 8), {1: (4, 5, 6), 2: (1,)}),
}
