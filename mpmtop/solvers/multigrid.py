"""Geometric multigrid on the background grid: a V-cycle that approximates the inverse of K.

Every coarser lattice takes every other line, bilinear interpolation P carries its displacements back, and its stiffness
is Galerkin's, P^T K P, one axis after the other. Bilinear functions hold all linear fields, so that rigid bodies and
constant strains pass between the levels unharmed. Whatever P carries to where nothing exists, it takes no part in
P^T K P or a residual, and the smoother leaves it alone.

Smoother: Chebyshev polynomials of the diagonally scaled K (Adams, Brezina, Hu and Tuminaro 2003, J. Comput. Phys.
188:593), the same before and after the coarse correction: the cycle is symmetric positive definite, fit for conjugate
gradients. Source of the cycle: Briggs, Henson and McCormick (2000), A Multigrid Tutorial, 2nd ed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_solve_banded, cholesky_banded

from mpmtop.scene import Array
from mpmtop.solvers.pattern import Solve
from mpmtop.solvers.stencil import Blocks

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
