"""Background grid: cells, nodes and the half-open cell convention every other module relies on."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from mpmtop.arrays import Array, Index
from mpmtop.errors import PointOutsideGrid


@dataclass(frozen=True)
class Grid:
    """Cartesian grid of `cells` (nx, ny) cells of size `h` (hx, hy) [length] from `origin` (2,).

    A cell is half-open, [x_i, x_i + h): a position on a grid line belongs to the cell on its right (above it). Node
    (i, j) has the index i * (ny + 1) + j. Only nodes that a material point touches ever get degrees of freedom, so a
    grid much larger than the body costs nothing.
    """

    origin: tuple[float, float]
    h: tuple[float, float]
    cells: tuple[int, int]

    def __post_init__(self) -> None:
        if not (np.all(np.isfinite(self.origin)) and np.all(np.isfinite(self.h)) and min(self.h) > 0):
            raise ValueError(
                f"grid from {self.origin} with cells of {self.h}: give finite numbers, cell sizes positive"
            )
        if min(self.cells) < 1:
            raise ValueError(f"grid of {self.cells} cells: give at least one in each direction")

    @classmethod
    def around(cls, lower: Array, upper: Array, h: tuple[float, float], margin: int = 2) -> Self:
        """Smallest grid with a line at `lower` that holds the box and `margin` more cells on every side."""
        size = (np.asarray(upper) - lower) / h
        cells = np.ceil(size - 1e-9).astype(int) + 2 * margin
        ox, oy = np.asarray(lower) - np.multiply(margin, h)
        return cls((float(ox), float(oy)), h, (int(cells[0]), int(cells[1])))

    @property
    def nodes(self) -> tuple[int, int]:
        """Number of nodes in x and in y."""
        return self.cells[0] + 1, self.cells[1] + 1

    @property
    def lines(self) -> tuple[Array, Array]:
        """Coordinates of the lines across x (nx,) and across y (ny,)."""
        (ox, oy), (hx, hy), (nx, ny) = self.origin, self.h, self.nodes
        return ox + hx * np.arange(nx, dtype=float), oy + hy * np.arange(ny, dtype=float)

    @property
    def segments(self) -> Array:
        """Ends (m, 2, 2) of all lines, from edge to edge of the grid: those across x, then those across y."""
        node = np.arange(np.prod(self.nodes)).reshape(self.nodes)
        return self.node_positions(np.concatenate([node[:, [0, -1]], node[[0, -1]].T]))

    def node_positions(self, index: Index | None = None) -> Array:
        """Positions (..., 2) of the nodes of the given indices (...), or (n, 2) of all."""
        index = np.arange(np.prod(self.nodes)) if index is None else index
        return np.stack(np.divmod(index, self.nodes[1]), axis=-1) * self.h + self.origin

    def cell_coordinates(self, x: Array) -> Array:
        """Positions x (p, 2) in units of cells from the origin, (p, 2): cell i is [i, i + 1)."""
        return (x - self.origin) / np.asarray(self.h)

    def node_index(self, i: Index, j: Index) -> Index:
        """Index of the nodes (i, j); a node beyond the grid is an error, never wrapped around."""
        nx, ny = self.nodes
        outside = (i < 0) | (i >= nx) | (j < 0) | (j >= ny)
        if np.any(outside):
            raise PointOutsideGrid(
                f"{np.count_nonzero(outside)} nodes that the points need lie outside the grid of {self.cells} cells: "
                "enlarge the grid (or its margin), or move the points inside"
            )
        return i * ny + j
