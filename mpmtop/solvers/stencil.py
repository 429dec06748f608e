"""Symmetric operators on the nodes of a lattice, stored by stencil, and their coarsening.

K acts on the nodes of a lattice, the bounding box of the body's nodes, and couples a node with those around it: one
2 x 2 block for each of (2 r + 1)^2 offsets, stored by offset. What does not exist (held degrees of freedom, nodes that
no point touches) is a zero row and a zero column.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array, Index
from mpmtop.solvers.pattern import Lattice

INTERPOLATION = ((-1, 0.5), (0, 1.0), (1, 0.5))
"""Linear interpolation along an axis: offset of the fine line from the coarse one, and weight."""


@dataclass(frozen=True)
class Stencil:
    """A lattice of `lines` (nx, ny) whose nodes are coupled with those up to `reach` (rx, ry) lines to either side."""

    lines: tuple[int, int]
    reach: tuple[int, int]

    @property
    def shape(self) -> tuple[int, ...]:
        """Of `Blocks.entries`."""
        return (2, *(2 * r + 1 for r in self.reach), 2, *self.lines)

    @property
    def size(self) -> int:
        """Of a vector: 2 nodes."""
        return 2 * self.lines[0] * self.lines[1]

    @cached_property
    def column(self) -> Array:
        """Columns (2 nodes, entries in a row) of the matrix; beyond the lattice any, for a zero."""
        component, node = np.divmod(np.arange(self.size, dtype=np.int32)[:, None], self.size // 2)
        x, y = (np.arange(-r, r + 1, dtype=np.int32) for r in self.reach)
        other = np.clip(node + (x[:, None] * self.lines[1] + y).ravel(), 0, self.size // 2 - 1)
        return np.concatenate([other + c * (self.size // 2) for c in (component, 1 - component)], axis=1)

    def coarse(self, axis: int) -> "Stencil":
        """Of every other line, coupled by linear interpolation."""
        lines, reach = list(self.lines), list(self.reach)
        lines[axis], reach[axis] = lines[axis] // 2 + 1, (reach[axis] + 2) // 2
        return Stencil((lines[0], lines[1]), (reach[0], reach[1]))


@dataclass(frozen=True, eq=False)
class Blocks:
    """Symmetric operator on vectors (2 nodes,), first all of component 0, then of 1.

    `entries` (s, x, y, c, i, j) couple component c of node (i, j) with the same component (s = 0) or the other (s = 1)
    of node (i + x - rx, j + y - ry); zero where either does not exist.
    """

    stencil: Stencil
    entries: Array

    @cached_property
    def diagonal(self) -> Array:
        """The diagonal (2 nodes,)."""
        rx, ry = self.stencil.reach
        return self.entries[0, rx, ry].ravel()

    @cached_property
    def matrix(self) -> sp.csr_array:
        """The operator as a sparse matrix with all entries of the stencil in every row."""
        size, column = self.stencil.size, self.stencil.column
        start = np.arange(0, column.size + 1, column.shape[1], dtype=np.int32)
        return sp.csr_array((self.entries.reshape(-1, size).T.ravel(), column.ravel(), start), shape=(size, size))

    def coarse(self, axis: int) -> "Blocks":
        """P^T K P with P linear interpolation along the axis from every other line."""
        r, stencil = self.stencil.reach[axis], self.stencil.coarse(axis)
        reach = stencil.reach[axis]
        result = Blocks(stencil, np.zeros(stencil.shape))
        fine, coarse = (np.moveaxis(K.entries, (1 + axis, 4 + axis), (0, 1)) for K in (self, result))
        for a, weight in INTERPOLATION:  # fine lines 2 I + a
            lines = fine[:, abs(a) :: 2]
            first = 1 if a < 0 else 0
            into = coarse[:, first : first + lines.shape[1]]
            for b, other in INTERPOLATION:
                for x in range(-reach, reach + 1):
                    if abs(2 * x + b - a) <= r:
                        into[x + reach] += (weight * other) * lines[2 * x + b - a + r]
        return result


class Places(NamedTuple):
    """Stencil on the bounding box of the unknowns, and flat places: in `Blocks.entries` those of the entries at
    (row, col) and of their transposes (nnz,), in a vector those of the unknowns (m,)."""

    stencil: Stencil
    entry: Index
    transposed: Index
    unknown: Index


def places(lattice: Lattice, row: Index, col: Index) -> Places:
    """Where the entries of a pattern and its unknowns go."""
    node, component = lattice.node - lattice.node.min(axis=0), lattice.component
    nx, ny = (int(n) + 1 for n in node.max(axis=0))
    apart = node[col] - node[row]
    other = component[row] ^ component[col]
    rx, ry = (int(r) for r in np.abs(apart).max(axis=0, initial=1))
    stencil = Stencil((nx, ny), (rx, ry))

    def place(a: Index, offset: Index) -> Index:
        return np.ravel_multi_index((other, *(offset + stencil.reach).T, component[a], *node[a].T), stencil.shape)

    unknown = np.ravel_multi_index((component, *node.T), (2, nx, ny))
    return Places(stencil, place(row, apart), place(col, -apart), unknown)


def assembled(at: Places, data: Array) -> Blocks:
    """The operator with entries `data` (nnz,) of the lower triangle."""
    entries = np.zeros(at.stencil.shape)
    entries.ravel()[at.entry] = data
    entries.ravel()[at.transposed] = data
    return Blocks(at.stencil, entries)


def rigid_motions(at: Places, h: tuple[float, float]) -> Array:
    """The two translations and the rotation about the middle of the lattice, (3, 2 nodes), zero where no unknown is."""
    x, y = np.meshgrid(
        *(s * (np.arange(n) - n / 2) / max(at.stencil.lines) for n, s in zip(at.stencil.lines, h, strict=True)),
        indexing="ij",
    )
    one, zero = np.ones_like(x), np.zeros_like(x)
    motions = np.zeros((3, at.stencil.size))
    motions[:, at.unknown] = np.array([[one, zero], [zero, one], [-y, x]]).reshape(3, -1)[:, at.unknown]
    return motions
