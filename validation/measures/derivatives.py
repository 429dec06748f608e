"""Is it the derivative, is it the adjoint: checks by values of the function alone.

They are of a function f of arrays x (n,), along a direction d (n,); what rounding leaves of them is for the caller to
judge, who knows the size of f and its condition number.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mpmtop.arrays import Array
from validation.measures.orders import observed_order


def central_difference(f: Callable[[Array], Any], x: Array, d: Array, t: float) -> Any:
    """(f(x + t d) - f(x - t d)) / 2t, of f of any shape: the derivative along d to t^2 / 6 of the third one, and to
    rounding of f over t."""
    return (f(x + t * d) - f(x - t * d)) / (2 * t)


def taylor_remainders(
    f: Callable[[Array], float], x: Array, d: Array, slope: float, t: Sequence[float] | Array
) -> Array:
    """|f(x + t d) - f(x) - t slope| (k,) at steps t (k,)."""
    t = np.asarray(t)
    return np.abs(np.array([f(x + step * d) for step in t]) - f(x) - t * slope)


def taylor_orders(f: Callable[[Array], float], x: Array, d: Array, slope: float, t: Sequence[float] | Array) -> Array:
    """Orders (k - 1,) in t of the Taylor remainder between neighbours of falling steps t (k,).

    2, to a third-order term of relative size t, if slope is the derivative along d; 1 if it is not. Not a number where
    f is linear along d or t so small that rounding is all that is left: then it says nothing.
    """
    t = np.asarray(t)
    remainder = taylor_remainders(f, x, d, slope, t)
    pairs = zip(remainder[:-1], remainder[1:], t[:-1] / t[1:], strict=True)
    return np.array([observed_order(*pair) for pair in pairs])


def adjoint_gap(A: Callable[[Array], Array], A_T: Callable[[Array], Array], x: Array, y: Array) -> float:
    """|y . A x - A_T y . x| over |y| . |A x|, the sum of the sizes of its terms: rounding if A_T is the adjoint."""
    Ax = A(x)
    return float(abs(y @ Ax - A_T(y) @ x) / (np.abs(y) @ np.abs(Ax)))
