"""Bodies with points that were moved over cell boundaries (`mpmtop.crossing`), and with their stiffness integrated."""

import numpy as np

from mpmtop.arrays import Array
from mpmtop.body import Body
from mpmtop.crossing import Crossing
from mpmtop.model import Model, discretise
from mpmtop.points import MaterialPoints, seed
from mpmtop.shape_functions import ShapeFunction
from validation.bodies.scenes import H


def points_model(body: Body, shape_function: ShapeFunction, ppc: int, crossing: Crossing, ghost: float = 0.0) -> Model:
    """The body on cells of size 1 with ppc x ppc points in each, moved by `crossing`."""
    points = crossing(seed(body.domain, (1 / ppc, 1 / ppc)), body.domain)
    return discretise(body, 1.0, points=points, shape_function=shape_function, ghost=ghost)


def integrated_exactly(lower: Array, upper: Array, pieces: int, n: int) -> MaterialPoints:
    """n x n Gauss points in each of `pieces` x `pieces` equal parts of every cell, or what the body has of it.

    Stiffness is then exact for functions that are polynomials of degree n - 1 at most on the parts: what is left
    between this and material points on the same body is their quadrature.
    """
    nodes, weights = np.polynomial.legendre.leggauss(n)
    positions, widths = [], []
    for a, b in zip(lower, upper, strict=True):
        part = H / pieces
        lines = part * np.arange(np.floor(a / part) + 1, np.ceil(b / part))
        breaks = np.concatenate([[a], lines, [b]])
        half = np.diff(breaks)[:, None] / 2
        positions.append((breaks[:-1, None] + half * (1 + nodes)).ravel())
        widths.append((half * weights).ravel())
    x, width = (np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2) for axes in (positions, widths))
    return MaterialPoints(x, width.prod(axis=1), width / 2)
