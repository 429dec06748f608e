"""The checks of orders, derivatives and adjoints: right where they must be, and seen to fail where they must fail."""

import numpy as np
import pandas as pd
import pytest

from mpmtop.arrays import Array
from validation.measures.derivatives import adjoint_gap, central_difference, taylor_orders
from validation.measures.orders import observed_order

RNG = np.random.default_rng(0)
A, X, D = RNG.random((6, 4)), RNG.random(4), RNG.random(4)


@pytest.mark.parametrize("ratio", [2.0, 3.0, 10.0])
@pytest.mark.parametrize("order", [0.5, 1.0, 4.0])
def test_order_of_a_power(order: float, ratio: float) -> None:
    h = np.array([0.3, 0.7])
    assert observed_order((ratio * h) ** order, h**order, ratio) == pytest.approx(order, rel=1e-13)


def test_order_keeps_the_index_of_a_series() -> None:
    """What one of the codes compared has no error for stays without an order."""
    coarse, fine = (pd.Series(e, ["ours", "theirs"]) for e in ([0.4, 0.8], [0.1, np.nan]))
    pd.testing.assert_series_equal(observed_order(coarse, fine), pd.Series([2.0, np.nan], ["ours", "theirs"]))


def test_order_needs_two_levels() -> None:
    with pytest.raises(ValueError, match="coarse level over that of the fine one"):
        observed_order(0.1, 0.2, 0.5)


def smooth(x: Array) -> float:
    return float(np.sum(np.exp(A @ x)))


def test_a_right_slope_has_order_two_and_a_wrong_one_order_one() -> None:
    slope, t = float(np.exp(A @ X) @ A @ D), (1e-2, 1e-3)
    assert taylor_orders(smooth, X, D, slope, t) == pytest.approx(2, abs=0.01)  # the third-order term, t = 1e-2
    # one per cent of the slope is wrong: at t = 1e-3 that is more than the second-order term
    assert taylor_orders(smooth, X, D, 1.01 * slope, (1e-4, 1e-5)) == pytest.approx(1, abs=0.01)


def test_central_difference_is_of_second_order() -> None:
    slope = float(np.exp(A @ X) @ A @ D)
    error = [central_difference(smooth, X, D, t) - slope for t in (1e-1, 5e-2)]
    assert observed_order(*error) == pytest.approx(2, abs=0.01)
    np.testing.assert_allclose(central_difference(lambda x: A @ x, X, D, 0.5), A @ D, rtol=1e-14)


def test_adjoint_and_what_is_none() -> None:
    y = RNG.random(6)
    assert adjoint_gap(lambda x: A @ x, lambda y: A.T @ y, X, y) < 1e-15  # rounding
    assert adjoint_gap(lambda x: A @ x, lambda y: 1.001 * A.T @ y, X, y) == pytest.approx(1e-3, rel=1e-9)
