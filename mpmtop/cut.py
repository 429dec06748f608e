"""Points cut along the outline: each is the piece of its part of a cell that the body covers.

A lattice that is laid over a body leaves stairs along its edge, and a tent counts a point wholly to one cell wherever
the body ends in it. Here every cell of the grid is divided into nx x ny rectangles, whatever the body's sides are; a
point stands for what the domain covers of one of them, with its area, at its centroid. Constants and linear functions
are then integrated exactly over the body's part of each cell, so that with tents a uniform stress is in equilibrium in
a body of any outline. B-splines have other pieces, and are exact for its area and its moments only.

Areas and moments of the pieces are sums over the outline. With int_c the integral from the left over rectangle c, the
divergence of (int_c s^k t^l dx, 0) is s^k t^l within c and zero elsewhere, so that

    int_(body, c) s^k t^l dA = int_outline g n_x ds,    g = s^(k+1) / (k+1) t^l within c,  t^l / (k+1) to its right,

for coordinates s, t in [0, 1] of the rectangle and the outline in its row; g is zero elsewhere.
Source: weights of cut cells by their moments, Mueller, Kummer and Oberlack (2013), Int. J. Numer. Meth. Engng 96:512.
"""

import numpy as np

from mpmtop.arrays import Array
from mpmtop.errors import EmptyDomain
from mpmtop.grid import Grid
from mpmtop.outline import GAUSS_POINTS, surface
from mpmtop.points import MaterialPoints
from mpmtop.region import Rectangle, Region

PLANE = Rectangle((-np.inf, -np.inf), (np.inf, np.inf))
GAUSS = len(GAUSS_POINTS)
SLIVER = 1e-6
"""Of a rectangle's area: less is left out. Its nodes would hang on a stiffness of that order, and the outline there
takes the functions of the nearest cell with a point."""
WHOLE = 1e-9
"""Of a rectangle's area: one that lacks no more is whole, and its point that of the lattice to the last bit."""


def cut_points(domain: Region, grid: Grid, ppc: tuple[int, int]) -> MaterialPoints:
    """Points of all pieces that the domain covers of the grid's cells, each divided into ppc (nx, ny) rectangles.

    Half-lengths are those of the whole rectangles: what a density is drawn and judged on. InvalidScene for a domain
    without an outline, as a `LevelSet`; EmptyDomain if the grid does not reach over the domain.
    """
    lower, upper = domain.bounds
    step = np.divide(grid.h, ppc)
    fine = Grid(grid.origin, (float(step[0]), float(step[1])), (grid.cells[0] * ppc[0], grid.cells[1] * ppc[1]))
    start, end = (fine.cell_coordinates(corner) for corner in (lower, upper))
    if np.any(start < -WHOLE) or np.any(end > np.add(fine.cells, WHOLE)):
        raise EmptyDomain(f"the domain from {lower} to {upper} leaves the grid of {grid.cells} cells: enlarge the grid")
    area, moment = _moments(domain, fine)
    place = np.argwhere(area > SLIVER)
    at = tuple(place.T)
    area, centre = area[at], moment[at] / area[at][:, None]
    whole = area > 1 - WHOLE
    area[whole], centre[whole] = 1.0, 0.5
    x = (place + centre) * step + fine.origin
    return MaterialPoints(x, area * step.prod(), np.tile(step / 2, (len(x), 1)))


def _moments(domain: Region, fine: Grid) -> tuple[Array, Array]:
    """Area (nx, ny), and the integrals of s and t, (nx, ny, 2), of the domain's part of every rectangle of a grid, in
    units of the rectangle."""
    on = surface(domain, PLANE, fine.lines)
    xi = fine.cell_coordinates(on.x)
    middle = xi.reshape(-1, GAUSS, 2)[:, GAUSS // 2]  # of the Gauss points of one rectangle
    i, j = np.clip(np.floor(np.repeat(middle, GAUSS, axis=0)).astype(np.intp), 0, np.subtract(fine.cells, 1)).T
    s, t = xi[:, 0] - i, xi[:, 1] - j
    rise = on.length * on.normal[:, 0] / fine.h[1]

    def integral(within: Array, on_the_left: Array) -> Array:
        """Of g (n,) in the outline's rectangle, and in each on its left."""
        own, left = np.zeros(fine.cells), np.zeros(fine.cells)
        np.add.at(own, (i, j), within * rise)
        np.add.at(left, (i, j), on_the_left * rise)
        own[:-1] += np.cumsum(left[:0:-1], axis=0)[::-1]
        return own

    area = integral(s, np.ones_like(s))
    return area, np.stack([integral(s**2 / 2, np.full_like(s, 0.5)), integral(s * t, t)], axis=-1)
