"""Histories: the end of each is seen, and what is stated."""

from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import pytest

from mpmtop.arrays import Array
from validation.measures.history import histories


class Run(NamedTuple):
    objective: Array
    volume: Array


@pytest.mark.parametrize("stated", [None, 84.0])
def test_the_end_fills_a_panel_of_its_own(stated: float | None) -> None:
    runs = {"a": Run(500 / np.arange(1, 7), np.full(6, 0.3)), "b": Run(520 / np.arange(1, 7), np.full(6, 0.3))}
    figure = histories(runs, "compliance", stated)
    top, middle, bottom = figure.axes
    low, high = middle.get_ylim()
    ends = [runs["a"].objective[-1], runs["b"].objective[-1], *([stated] if stated else [])]
    assert low < min(ends)
    assert max(ends) < high < 1.1 * max(ends)
    low, high = bottom.get_ylim()
    assert low < 0.3 < high
    figure.canvas.draw()
    assert {"80", "100", "200", "400"} <= {label.get_text() for label in top.get_yticklabels()}
    plt.close(figure)
