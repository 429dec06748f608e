"""Geometric multigrid on the background grid: a V-cycle that approximates the inverse of K.

Every coarser lattice takes every other line, bilinear interpolation P carries its displacements back, and its stiffness
is Galerkin's, P^T K P, one axis after the other. Bilinear functions hold all linear fields, so that rigid bodies and
constant strains pass between the levels unharmed. Whatever P carries to where nothing exists, it takes no part in
P^T K P or a residual, and the smoother leaves it alone.

Smoother: Chebyshev polynomials of the diagonally scaled K (Adams, Brezina, Hu and Tuminaro 2003, J. Comput. Phys.
188:593), the same before and after the coarse correction: the cycle is symmetric positive definite, fit for conjugate
gradients. It is computed in single precision, whose rounding is far below what a cycle leaves, but for the coarse
operators and the coarsest level's factorisation: there pieces that hang on next to nothing, void or a sliver of a cell,
show by their last digits. The factor L itself is of the root of their stiffness, 3e-5 of the rest for a void of 1e-9:
it is rounded, too.
Source of the cycle: Briggs, Henson and McCormick (2000), A Multigrid Tutorial, 2nd ed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array, Index
from mpmtop.solvers.pattern import Lattice, Pattern, Solve
from mpmtop.solvers.sparse_cholesky import SparseCholesky
from mpmtop.solvers.stencil import Blocks

DEGREE = 2
"""Of the Chebyshev polynomial, before and after the coarse correction."""
SMOOTHED = 6.0
"""The smoother reduces what lies in the upper part [1 / SMOOTHED, 1] of the spectrum, about what a coarser level of
half the lines cannot represent. Of the designs named at COARSEST 4 took as many cycles to 1e-5 and up to 6 of 38 more
to 1e-8, 3 still more."""
COARSEST = 300_000
"""Unknowns, about, of a level that is not coarsened further but solved directly, by sparse Cholesky. It should be as
fine as a cycle's price allows: on lattices coarser than the members of a design, gaps between them close, and no second
visit of a level makes up for it. Designs of an optimisation of 251,000 unknowns (iterations 10 to 41) took 7 to 16
cycles to 1e-5 from a lattice of a quarter, 9 to 38 from one of a sixteenth, where two visits of the level between (a
W-cycle) still took 27 to 30, and two conjugate gradients there 21 to 27; for 1.4 times the price of a cycle."""
SHIFT = 1e-12
"""Part of the diagonal added on the coarsest level: two of its nodes may share all that they interpolate to."""


class Step(NamedTuple):
    """From a lattice to the next coarser one: its axes to coarsen, interpolation P (2 nodes, 2 coarse) and P^T."""

    axes: tuple[int, ...]
    P: sp.csr_array
    PT: sp.csr_array


def coarsening(lines: tuple[int, int], h: tuple[float, float], coarsest: int = COARSEST) -> list[Step]:
    """Steps from a lattice of so many lines and cells of size h to one of no more than `coarsest` unknowns, one step at
    least.

    An axis waits while its lines are further apart than the other's (Galerkin with point smoothers wants cells that are
    about square), or when it has few.
    """
    steps: list[Step] = []
    n, spacing = list(lines), list(h)
    while max(n) > 4 and (not steps or 2 * n[0] * n[1] > coarsest):
        long = [a for a in (0, 1) if n[a] > 4]
        axes = tuple(a for a in long if spacing[a] < 1.5 * min(spacing[b] for b in long))
        along = [_interpolation(n[a]) if a in axes else sp.eye_array(n[a]) for a in (0, 1)]
        P = sp.csr_array(sp.kron(sp.eye_array(2), sp.kron(*along), format="csr"), dtype=np.float32)
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


class Coarsest(NamedTuple):
    """The coarsest level, to be solved directly: places of its unknowns (m,) in a vector, of its lower triangle (nnz,)
    in `Blocks.entries`, and of the diagonal (m,) therein."""

    unknown: Index
    entry: Index
    diagonal: Index
    cholesky: SparseCholesky

    def factor(self, K: Blocks) -> Solve:
        """K u = f for vectors f (2 nodes,) of the level."""
        data = K.entries.ravel()[self.entry]
        diagonal = data[self.diagonal]
        data[self.diagonal] = np.where(diagonal > 0, diagonal * (1 + SHIFT), 1)
        inside = self.cholesky.unchecked(data, np.float32)

        def solve(f: Array) -> Array:
            u = np.zeros_like(f)
            u[self.unknown] = inside(f[self.unknown])
            return u

        return solve


def coarsest_of(structure: Blocks, steps: Sequence[Step]) -> Coarsest:
    """The coarsest level below a `structure`: positive where K has an entry, zero where it has none."""
    for step in steps:
        for axis in step.axes:
            structure = structure.coarse(axis)
    (nx, ny), reach = structure.stencil.lines, structure.stencil.reach
    unknown = np.flatnonzero(structure.diagonal)
    number = np.full(structure.stencil.size, -1)
    number[unknown] = np.arange(len(unknown))
    other, x, y, c, i, j = np.nonzero(structure.entries)
    row = number[(c * nx + i) * ny + j]
    col = number[((c ^ other) * nx + i + x - reach[0]) * ny + j + y - reach[1]]
    lower = row >= col
    row, col = row[lower], col[lower]
    component, node = np.divmod(unknown, nx * ny)
    lattice = Lattice((1.0, 1.0), np.stack(np.divmod(node, ny), axis=-1), component)
    on_diagonal = np.flatnonzero(row == col)
    on_diagonal = on_diagonal[np.argsort(row[on_diagonal])]
    cholesky = SparseCholesky(Pattern(len(unknown), row, col, lattice))
    return Coarsest(unknown, np.flatnonzero(structure.entries)[lower], on_diagonal, cholesky)


@dataclass(frozen=True, eq=False)
class Level:
    """`matrix` is K on a lattice in single precision; its smoother's `scale`, and the step to the next coarser lattice.

    `scale` (2 nodes,) is the inverse of the diagonal, over the largest eigenvalue of K scaled by it; zero where there
    is no stiffness.
    """

    matrix: Blocks
    scale: Array
    step: Step

    def residual(self, u: Array, f: Array) -> Array:
        """f - K u."""
        image = self.matrix @ u
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
        """u (2 nodes,) of the level with K u = f, about, in single precision."""
        if level == len(self.levels):
            return self.coarsest(f)
        at = self.levels[level]
        u = at.smooth(None, f)
        u += at.step.P @ self(at.step.PT @ at.residual(u, f), level + 1)
        return at.smooth(u, f)


def v_cycle(K: Blocks, steps: Sequence[Step], coarsest: Coarsest) -> Cycle:
    """The hierarchy below K, and its cycle; SingularMatrix if the coarsest level has a mechanism."""
    levels = []
    for step in steps:
        single = Blocks(K.stencil, K.entries.astype(np.float32))
        # a sliver's may be below the range of single precision: it is left alone, and to the direct solver if it counts
        there = single.diagonal > np.finfo(np.float32).tiny
        inverse = np.divide(1, single.diagonal, out=np.zeros_like(single.diagonal), where=there)
        levels.append(Level(single, inverse / largest_eigenvalue(single, inverse), step))
        for axis in step.axes:
            K = K.coarse(axis)
    return Cycle(levels, coarsest.factor(K))


def largest_eigenvalue(K: Blocks, inverse: Array) -> float:
    """Largest eigenvalue of K scaled by the `inverse` (2 nodes,) of its diagonal, rather above it than below.

    Six steps of the power method find 0.81 to 0.91 of it for designs and for random fields.
    """
    scale = np.sqrt(inverse)
    v, size = np.random.default_rng(0).normal(size=len(scale)).astype(scale.dtype), 1.0
    for _ in range(6):
        v = K @ (scale * v / size)
        v *= scale
        size = float(np.linalg.norm(v))
    return 1.25 * size
