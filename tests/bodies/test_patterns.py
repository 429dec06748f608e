"""The drawn patterns of crossing: their colours say what the points do."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from validation.bodies.crossing import Crossing, Jitter, Periodic, Uniform, Wave
from validation.bodies.manufactured import DeformedWave
from validation.bodies.patterns import in_words, strip


@pytest.mark.parametrize(
    ("crossing", "still", "moved", "crossed"),
    [
        (Periodic(4), 128 - 12, 0, 12),  # four rows of points at each of three boundaries inside the strip
        (Uniform(0.2), 0, 128, 0),  # less than the 1/4 to the boundary
        (Uniform(0.3), 0, 64, 64),
    ],
)
def test_points_are_coloured_by_what_they_do(crossing: Crossing, still: int, moved: int, crossed: int) -> None:
    figure = strip([crossing])
    seeded, *drawn = figure.axes[0].lines
    assert [len(np.asarray(line.get_xdata())) for line in drawn] == [still, moved, crossed]
    assert len(np.asarray(seeded.get_xdata())) == moved + crossed
    plt.close(figure)


@pytest.mark.parametrize("crossing", [Uniform(0.3), Periodic(4), Wave(8), DeformedWave(8), Jitter(0.3)])
def test_every_pattern_has_words_with_its_numbers(crossing: Crossing) -> None:
    words = in_words(crossing)
    assert str(crossing) not in words
    numbers = str(crossing).partition("(")[2].rstrip(")").split(", ")
    assert all(number in words for number in numbers)
