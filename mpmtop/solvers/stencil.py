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

    @property
    def offset(self) -> Index:
        """By how many places in a vector the nodes of the stencil follow its middle one."""
        x, y = (np.arange(-r, r + 1) for r in self.reach)
        return (x[:, None] * self.lines[1] + y).ravel()

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
    def _diagonals(self) -> list[sp.dia_array]:
        """The operator between like components, and from each to the other one, its image at the place of the first.

        SciPy stores diagonals by column. K is symmetric: its entries by row are these, with opposite offsets, so that
        nothing is copied, and no index is read. But where the lattice is narrower than the stencil: two nodes of it are
        equally far in a vector then, one of them always beyond the lattice, with a zero.
        """
        size = self.stencil.size
        entries, offset = self.entries.reshape(2, -1, size), self.stencil.offset
        distinct, which = np.unique(offset, return_inverse=True)
        if len(distinct) < len(offset):
            merged = np.zeros((2, len(distinct), size), entries.dtype)
            for k, place in enumerate(which):
                merged[:, place] += entries[:, k]
            entries, offset = merged, distinct
        return [sp.dia_array((part, -offset), shape=(size, size)) for part in entries]

    def __matmul__(self, u: Array) -> Array:
        """K u of a vector (2 nodes,)."""
        image, crossed = (part @ u for part in self._diagonals)
        half = len(u) // 2
        image[:half] += crossed[half:]
        image[half:] += crossed[:half]
        return image

    def coarse(self, axis: int) -> "Blocks":
        """P^T K P with P linear interpolation along the axis from every other line."""
        stencil = self.stencil.coarse(axis)
        reach = stencil.reach[axis]
        result = Blocks(stencil, np.zeros(stencil.shape, self.entries.dtype))
        fine, coarse = (np.moveaxis(K.entries, (1 + axis, 4 + axis), (0, 1)) for K in (self, result))
        even, odd = fine[:, ::2], fine[:, 1::2]
        for x in range(-reach, reach + 2):
            if x <= reach and (carried := _carried(even, 2 * x)) is not None:
                coarse[x + reach, : even.shape[1]] += carried
            if (carried := _carried(odd, 2 * x - 1)) is None:
                continue
            # an odd line is half of the coarse one before it, and half of the one behind
            half = 0.5 * carried
            if x <= reach:
                coarse[x + reach, : odd.shape[1]] += half
            if x > -reach:
                coarse[x - 1 + reach, 1 : odd.shape[1] + 1] += half
        return result


def _carried(lines: Array, x: int) -> Array | None:
    """Entries of K P between fine lines, by offset first, and the coarse line whose fine one is x lines away; None
    where that is too far."""
    r = len(lines) // 2
    beside = [lines[k + r] for k in (x - 1, x + 1) if abs(k) <= r]
    if not beside:
        return None
    carried = 0.5 * (beside[0] + beside[1] if len(beside) == 2 else beside[0])
    if abs(x) <= r:
        carried += lines[x + r]
    return carried


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
