"""Geometric multigrid on the background grid: a V-cycle that approximates the inverse of K.

K acts on the nodes of a lattice, the bounding box of the body's nodes, and couples a node with those around it: one
2 x 2 block for each of (2 r + 1)^2 offsets, stored by offset. Every coarser lattice takes every other line, bilinear
interpolation P carries its displacements back, and its stiffness is Galerkin's, P^T K P, one axis after the other.
Bilinear functions hold all linear fields, so that rigid bodies and constant strains pass between the levels unharmed.

What does not exist (held degrees of freedom, nodes that no point touches) is a zero row and a zero column of K.
Whatever P carries there, it takes no part in P^T K P or a residual, and the smoother leaves it alone.

Smoother: Chebyshev polynomials of the diagonally scaled K (Adams, Brezina, Hu and Tuminaro 2003, J. Comput. Phys.
188:593), the same before and after the coarse correction: the cycle is symmetric positive definite, fit for conjugate
gradients. Source of the cycle: Briggs, Henson and McCormick (2000), A Multigrid Tutorial, 2nd ed.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_solve_banded, cholesky_banded

from mpmtop.scene import Array, Index

Solve = Callable[[Array], Array]
"""Solves K x = b for b (m,) or (m, k)."""

DEGREE = 2
"""Of the Chebyshev polynomial, before and after the coarse correction."""
SMOOTHED = 4.0
"""The smoother reduces what lies in the upper part [1 / SMOOTHED, 1] of the spectrum, about what a coarser level of
half the lines cannot represent."""
COARSEST = 5_000_000
"""Largest band (unknowns times nodes across) of a lattice that is not coarsened further but solved directly: in 0.3 s,
and 0.03 s a cycle. It should be as fine as that allows: on lattices coarser than the members of a design, gaps between
them close, and 20 iterations become 100 (250 x 125 cells, members of three cells, contrast 1e-9)."""
SHIFT = 1e-12
"""Part of the diagonal added on the coarsest level: two of its nodes may share all that they interpolate to."""
INTERPOLATION = ((-1, 0.5), (0, 1.0), (1, 0.5))
"""Linear interpolation along an axis: offset of the fine line from the coarse one, and weight."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """Where the unknowns are: `node` (m, 2) the lines (i, j) of their nodes, `component` (m,), and cell size h."""

    h: tuple[float, float]
    node: Index
    component: Index


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


class Step(NamedTuple):
    """From a lattice to the next coarser one: its axes to coarsen, interpolation P (2 nodes, 2 coarse) and P^T."""

    axes: tuple[int, ...]
    P: sp.csr_array
    PT: sp.csr_array


def coarsening(lines: tuple[int, int], h: tuple[float, float], coarsest: int = COARSEST) -> list[Step]:
    """Steps from a lattice of so many lines and cells of size h to one of no more than the `coarsest` band.

    An axis waits while its lines are further apart than the other's (Galerkin with point smoothers wants cells that are
    about square), or when it has few.
    """
    steps, n, spacing = [], list(lines), list(h)
    while max(n) > 4 and 2 * n[0] * n[1] * min(n) > coarsest:
        long = [a for a in (0, 1) if n[a] > 4]
        axes = tuple(a for a in long if spacing[a] < 1.5 * min(spacing[b] for b in long))
        along = [_interpolation(n[a]) if a in axes else sp.eye_array(n[a]) for a in (0, 1)]
        P = sp.csr_array(sp.kron(sp.eye_array(2), sp.kron(*along), format="csr"))
        steps.append(Step(axes, P, sp.csr_array(P.T)))
        for a in axes:
            n[a], spacing[a] = n[a] // 2 + 1, 2 * spacing[a]
    return steps


def _interpolation(n: int) -> sp.csr_array:
    """Linear interpolation (n, n // 2 + 1) from every other line."""
    i = np.arange(n)
    return sp.csr_array(
        (np.full(2 * n, 0.5), (np.tile(i, 2), np.concatenate([i // 2, (i + 1) // 2]))), shape=(n, n // 2 + 1)
    )


@dataclass(frozen=True, eq=False)
class Level:
    """K on a lattice, its smoother's `scale`, and the step to the next coarser lattice.

    `scale` (2 nodes,) is the inverse of the diagonal, over the largest eigenvalue of K scaled by it; zero where there
    is no stiffness.
    """

    K: Blocks
    scale: Array
    step: Step

    def residual(self, u: Array, f: Array) -> Array:
        """f - K u."""
        image = self.K.matrix @ u
        return np.subtract(f, image, out=image)

    def smooth(self, u: Array | None, f: Array) -> Array:
        """Chebyshev iteration of DEGREE for K u = f from u, which it changes, or from zero (None)."""
        centre, radius = (1 + 1 / SMOOTHED) / 2, (1 - 1 / SMOOTHED) / 2
        step = f * self.scale if u is None else self.residual(u, f) * self.scale
        step /= centre
        u = step.copy() if u is None else np.add(u, step, out=u)
        rho = radius / centre
        for _ in range(DEGREE - 1):
            rho, last = 1 / (2 * centre / radius - rho), rho
            correction = self.residual(u, f)
            correction *= self.scale
            correction *= 2 * rho / radius
            step *= rho * last
            step += correction
            u += step
        return u


@dataclass(frozen=True, eq=False)
class Cycle:
    """One V-cycle from zero: an approximation of K^-1, symmetric and positive definite."""

    levels: Sequence[Level]
    coarsest: Solve

    def __call__(self, f: Array, level: int = 0) -> Array:
        """u (2 nodes,) of the level with K u = f, about."""
        if level == len(self.levels):
            return self.coarsest(f)
        at = self.levels[level]
        u = at.smooth(None, f)
        u += at.step.P @ self(at.step.PT @ at.residual(u, f), level + 1)
        return at.smooth(u, f)


def v_cycle(K: Blocks, steps: Sequence[Step]) -> Cycle:
    """The hierarchy below K, and its cycle."""
    levels = []
    for step in steps:
        inverse = np.divide(1, K.diagonal, out=np.zeros_like(K.diagonal), where=K.diagonal > 0)
        levels.append(Level(K, inverse / largest_eigenvalue(K, inverse), step))
        for axis in step.axes:
            K = K.coarse(axis)
    return Cycle(levels, _coarsest(K))


def largest_eigenvalue(K: Blocks, inverse: Array) -> float:
    """Largest eigenvalue of K scaled by the `inverse` (2 nodes,) of its diagonal, rather above it than below.

    Six steps of the power method find 0.81 to 0.91 of it for designs and for random fields.
    """
    scale = np.sqrt(inverse)
    v, size = np.random.default_rng(0).normal(size=len(scale)), 1.0
    for _ in range(6):
        v = K.matrix @ (scale * v / size)
        v *= scale
        size = float(np.linalg.norm(v))
    return 1.25 * size


def _coarsest(K: Blocks) -> Solve:
    """Banded Cholesky of K, its nodes numbered across the lattice."""
    (nx, ny), (rx, ry) = K.stencil.lines, K.stencil.reach
    across, along = (ny, 1) if nx >= ny else (1, nx)
    other, x, y, c, i, j = np.nonzero(K.entries)
    row = 2 * (i * across + j * along) + c
    col = 2 * ((i + x - rx) * across + (j + y - ry) * along) + (c ^ other)
    below = row >= col
    band = np.zeros((int(np.max(row - col, initial=0)) + 1, K.stencil.size))
    band[(row - col)[below], col[below]] = K.entries[other, x, y, c, i, j][below]
    band[0] = np.where(band[0] > 0, band[0] * (1 + SHIFT), 1)
    factor = cholesky_banded(band, lower=True, overwrite_ab=True, check_finite=False)
    # place in a vector of every unknown of the band
    place = np.arange(K.stencil.size).reshape(2, nx, ny).transpose((1, 2, 0) if nx >= ny else (2, 1, 0)).ravel()

    def solve(f: Array) -> Array:
        u = np.empty_like(f)
        u[place] = cho_solve_banded((factor, True), f[place], overwrite_b=True, check_finite=False)
        return u

    return solve
