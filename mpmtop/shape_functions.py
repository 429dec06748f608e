"""Shape functions along one axis: tent (Eq. 6), GIMP (Eq. 7), B-splines. Value and gradient together.

A shape function is called with the positions xi (p,) of the points in units of cells (cell i is [i, i + 1)), the
half-lengths l (p,) of their domains in the same unit, and `tol` [cells]: a point, or the edge of its domain, that is no
further than this from a kink of the function lies on it. What lies beyond by less is noise of floating point, and the
stiffness of a node touched by such noise alone would be noise, too. `ends` are the first and the last node of the cells
that hold the body, for functions that treat its ends. It returns a `Stencil`: the first of n consecutive nodes, and the
values and gradients (per cell size) of these nodes' functions at each point. All of them form a partition of unity,
sum N = 1 and sum grad N = 0, and reproduce linear fields. Complex positions and half-lengths
are taken, too: what selects a branch is their real part.

CPDI is not among them: along one axis its gradient on a domain that stays undeformed is GIMP's, the difference of the
tent over the domain by its width, and small strain leaves domains as they are.
"""

from typing import Any, NamedTuple, Protocol

import numpy as np

from mpmtop.arrays import Array, Index
from mpmtop.errors import InvalidScene

ROUNDED = 2e-9
"""Part by which a domain as wide as a cell may exceed it: what sides that the spacing divides to 1e-9 make of it."""


class Stencil(NamedTuple):
    """First node (p,) of n consecutive ones; N (p, n) and grad_N (p, n), the latter per cell size."""

    first: Index
    N: Array
    grad_N: Array


Ends = tuple[int, int]
"""First and last node of the cells that hold the body, along one axis."""


class ShapeFunction(Protocol):
    """See the module's docstring; `__name__` names it in reports."""

    __name__: str

    def __call__(self, xi: Array, half_length: Array, tol: float, ends: Ends | None) -> Stencil:
        """Values and gradients at xi (p,)."""
        ...


def stencil(shape_function: ShapeFunction, xi: Array, half_length: Array, tol: float, ends: Ends | None) -> Stencil:
    """What a shape function gives at xi (p,); InvalidScene unless it is what the module's docstring asks for."""
    name, p = shape_function.__name__, len(xi)
    try:
        found: Any = shape_function(xi, half_length, tol, ends)
    except TypeError as error:
        raise InvalidScene(
            f"the shape function {name} failed ({error}): let it take xi (p,), half_length (p,), tol and ends"
        ) from error
    parts = found if isinstance(found, tuple) else (found,)
    if not (len(parts) == 3 and all(isinstance(part, np.ndarray) for part in parts) and _fits(Stencil(*parts), p)):
        told = ", ".join(str(getattr(part, "shape", type(part).__name__)) for part in parts)
        raise InvalidScene(
            f"the shape function {name} gave {told} for {p} points: return a `Stencil` of arrays, first (p,), whole "
            "numbers, N and grad_N (p, n), finite"
        )
    return Stencil(*parts)


def _fits(found: Stencil, p: int) -> bool:
    first, N, grad_N = found
    shaped = first.shape == (p,) and N.ndim == 2 and len(N) == p and N.shape == grad_N.shape
    numbers = first.dtype.kind == "i" and all(part.dtype.kind in "fc" for part in (N, grad_N))
    return shaped and numbers and bool(np.all(np.isfinite(N)) and np.all(np.isfinite(grad_N)))


def _in_cell(xi: Array, tol: float, ends: Ends | None) -> tuple[Array, Array]:
    """Half-open cell of each position, and the position in it, in [0, 1); the last cell of a body with `ends` holds its
    end, too, s = 1."""
    cell = np.floor(xi.real + tol)
    if ends is not None:
        cell = np.minimum(cell, ends[1] - 1)
    s = xi - cell
    return cell, np.where(s.real <= tol, 0.0, s)


def tent(xi: Array, half_length: Array, tol: float = 0.0, ends: Ends | None = None) -> Stencil:
    """Standard piecewise linear function, Eq. (6); at a grid line the gradient is that of the cell on the right."""
    cell, s = _in_cell(xi, tol, ends)
    one = np.ones_like(s)
    return Stencil(cell.astype(np.intp), np.stack([1 - s, s], axis=1), np.stack([-one, one], axis=1))


def gimp(xi: Array, half_length: Array, tol: float = 0.0, ends: Ends | None = None) -> Stencil:
    """Generalised interpolation, Eq. (7): the tent averaged over the point's domain [xi - l, xi + l], with l <= 1/2.

    A domain within one cell gives the tent's values exactly. Otherwise it holds one node, at distance d = xi - node,
    |d| < l, and the three nodes around it get (l - d)^2 / 4l, 1 - (d^2 + l^2) / 2l and (l + d)^2 / 4l. (Eq. 7 as
    printed omits the constant l/2 of the middle branch; without it the functions do not sum to one.)
    Source: Bardenhagen and Kober (2004), CMES 5:477.
    """
    if np.any(half_length.real > 0.5 * (1 + ROUNDED) + tol):
        raise ValueError(
            f"GIMP: a point's domain is {2 * half_length.real.max():.10g} cells wide, and may be one: use two points "
            "or more per cell and direction, smaller `half_length`, or larger cells (one leaves nodes all but free)"
        )
    lp = np.where(half_length.real > 0.5, 0.5, half_length)
    node = np.rint(xi.real)
    d = xi - node
    crosses = np.abs(d.real) < lp.real - tol
    lp = np.where(crosses, lp, 0.5)  # the others' is of no use, and that of a position is zero
    within, s = _in_cell(xi, tol, ends)

    a, b = (lp - d) ** 2 / (4 * lp), (lp + d) ** 2 / (4 * lp)
    da, db = -(lp - d) / (2 * lp), (lp + d) / (2 * lp)
    zero, one = np.zeros_like(s), np.ones_like(s)
    c = crosses[:, None]
    return Stencil(
        np.where(crosses, node - 1, within).astype(np.intp),
        np.where(c, np.stack([a, 1 - a - b, b], axis=1), np.stack([1 - s, s, zero], axis=1)),
        np.where(c, np.stack([da, -da - db, db], axis=1), np.stack([-one, one, zero], axis=1)),
    )


def bspline2(xi: Array, half_length: Array, tol: float = 0.0, ends: Ends | None = None) -> Stencil:
    """Quadratic B-spline on the three nodes nearest to the point, closed at the body's `ends`; C1.

    With one point for each cell its nodes are all but mechanisms, use at least two.
    Source: Steffen, Kirby and Berzins (2008), Int. J. Numer. Meth. Engng 76:922.
    """
    node = np.floor(xi.real + 0.5)
    d = xi - node
    d = np.where(np.abs(d.real) >= 0.5 - tol, np.copysign(0.5, d.real), d)
    N = np.stack([(0.5 - d) ** 2 / 2, 0.75 - d**2, (0.5 + d) ** 2 / 2], axis=1)
    return _closed(Stencil((node - 1).astype(np.intp), N, np.stack([d - 0.5, -2 * d, d + 0.5], axis=1)), ends)


def bspline3(xi: Array, half_length: Array, tol: float = 0.0, ends: Ends | None = None) -> Stencil:
    """Cubic B-spline on the nodes of the point's cell and of the next on either side, closed at the body's `ends`; C2.

    Source: as `bspline2`.
    """
    cell, s = _in_cell(xi, tol, ends)
    r = 1 - s
    N = np.stack([r**3, 3 * s**3 - 6 * s**2 + 4, 3 * r**3 - 6 * r**2 + 4, s**3], axis=1) / 6
    grad_N = np.stack([-(r**2), 3 * s**2 - 4 * s, 4 * r - 3 * r**2, s**2], axis=1) / 2
    return _closed(Stencil((cell - 1).astype(np.intp), N, grad_N), ends)


def _closed(stencil: Stencil, ends: Ends | None) -> Stencil:
    """B-splines that end with the body: a node beyond an end follows the two inside it, u_-1 = 2 u_0 - u_1.

    The end node alone then carries the value at the end, as with the tent: a clamp there holds exactly, and the nodes
    that only a corner of the body would reach are gone. Linear fields stay exact. The cubic's end function becomes
    s^3 / 6 - s + 1, that of Steffen, Kirby and Berzins (2008).
    """
    if ends is None:
        return stencil
    first, N, grad_N = stencil.first, stencil.N.copy(), stencil.grad_N.copy()
    n = N.shape[1]
    for beyond, ghost, end, next_to_end in (
        (first < ends[0], 0, 1, 2),
        (first + n - 1 > ends[1], n - 1, n - 2, n - 3),
    ):
        for w in (N, grad_N):
            w[beyond, end] += 2 * w[beyond, ghost]
            w[beyond, next_to_end] -= w[beyond, ghost]
            w[beyond, ghost] = 0
    return Stencil(first, N, grad_N)
