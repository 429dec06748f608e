"""The drawn patterns of crossing: their colours say what the points do."""

import re

import numpy as np
import pytest

from mpmtop.comparison.pictures import patterns
from mpmtop.crossing import FAMILIES, Crossing, Jitter, Periodic, Uniform, Wave, named
from mpmtop.points import seed
from mpmtop.region import Rectangle
from validation.bodies.manufactured import DeformedWave
from validation.bodies.patterns import in_words


@pytest.mark.parametrize(
    ("crossing", "still", "moved", "crossed"),
    [
        (Periodic(4), 128 - 12, 0, 12),  # four rows of points at each of three boundaries inside the strip
        (Uniform(0.2), 0, 128, 0),  # less than the 1/4 to the boundary
        (Uniform(0.3), 0, 64, 64),
    ],
)
def test_points_are_coloured_by_what_they_do(crossing: Crossing, still: int, moved: int, crossed: int) -> None:
    figure = patterns([crossing])
    seeded, *drawn = figure.axes[0].lines
    assert [len(np.asarray(line.get_xdata())) for line in drawn] == [still, moved, crossed]
    assert len(np.asarray(seeded.get_xdata())) == moved + crossed


@pytest.mark.parametrize("crossing", [Uniform(0.3), Periodic(4), Wave(8), DeformedWave(8), Jitter(0.3)])
def test_every_pattern_has_words_with_its_numbers(crossing: Crossing) -> None:
    words = in_words(crossing)
    assert str(crossing) not in words
    numbers = str(crossing).partition("(")[2].rstrip(")").split(", ")
    assert all(number in words for number in numbers)


@pytest.mark.parametrize("crossing", [member for members in FAMILIES.values() for member in members])
def test_a_pattern_is_the_same_on_cells_of_any_size_anywhere(crossing: Crossing) -> None:
    """Of a body that is scaled and shifted with its grid the points move alike."""
    h, x0 = 0.37, -1.3
    unit = Rectangle((0.0, 0.0), (16.0, 2.0))
    other = Rectangle((x0, 0.0), (x0 + 16 * h, 2 * h))
    ours = crossing(seed(unit, (0.5, 0.5)), unit).x
    theirs = crossing(seed(other, (0.5 * h, 0.5 * h)), other, h, x0).x
    assert np.allclose((theirs - [x0, 0.0]) / h, ours, rtol=0, atol=1e-9)  # rounding of sides of order ten


@pytest.mark.parametrize("crossing", [member for members in FAMILIES.values() for member in members])
def test_a_pattern_is_found_by_what_it_says(crossing: Crossing) -> None:
    assert named(str(crossing)) == crossing


def test_patterns_have_usual_parameters_and_named_errors() -> None:
    assert named("periodic") == Periodic(4) and named("wave(12)") == Wave(12.0)
    for wrong in ("spiral", "periodic(x)", "periodic(2.5)", "uniform(1, 2)", "wave(0)", "periodic(4"):
        with pytest.raises(ValueError, match=re.escape(repr(wrong))):
            named(wrong)
