"""Filter: from the optimiser's variables to physical densities, and back for the gradient."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.fft
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, aslinearoperator
from scipy.spatial import KDTree

from mpmtop.arrays import Array, Index, Mask
from mpmtop.design import Design
from mpmtop.errors import EmptyDomain, InvalidScene
from mpmtop.points import MaterialPoints

BY_CONVOLUTION = 20_000
"""Points from which the filter of a lattice is a convolution: its time and memory do not grow with the radius, and the
sparse matrix takes 0.4 kB for each point at three spacings. Below, sums keep their order to the last bit."""


@dataclass(frozen=True, eq=False)
class DesignSpace:
    """Which of the points are passive, (p,) each: `solid` with density 1, `void` with density 0. The rest is active."""

    solid: Mask
    void: Mask

    @cached_property
    def active(self) -> Index:
        """The points that are design variables, (a,)."""
        return np.flatnonzero(~(self.solid | self.void))

    @cached_property
    def all_active(self) -> bool:
        """Whether no point is passive."""
        return len(self.active) == len(self.solid)


def design_space(design: Design, points: MaterialPoints) -> DesignSpace:
    """The points in the passive regions; InvalidScene where a region holds none or both claim one, EmptyDomain if no
    other is left."""
    nowhere = np.zeros(len(points.x), dtype=bool)
    regions = (design.passive_solid, design.passive_void)
    solid, void = (nowhere if region is None else region.contains(points.x) for region in regions)
    for name, region, held in zip(("passive_solid", "passive_void"), regions, (solid, void), strict=True):
        if region is not None and not np.any(held):
            raise InvalidScene(f"{name} holds no material point: enlarge it, or use smaller points")
    if np.any(solid & void):
        raise InvalidScene(
            f"{np.count_nonzero(solid & void)} points lie in both passive_solid and passive_void, the first at "
            f"{points.x[solid & void][0]}: take one region out of the other (`Difference`)"
        )
    if np.all(solid | void):
        raise EmptyDomain("every point is passive: shrink passive_solid or passive_void, or there is nothing to design")
    return DesignSpace(solid, void)


@dataclass(frozen=True, eq=False)
class DensityFilter:
    """Density filter: rho_p = sum_q w_pq design_q / sum_q w_pq with w_pq = V_q max(0, r - |x_p - x_q|).

    Source: Bruns and Tortorelli (2001), Comput. Methods Appl. Mech. Engrg 190:3443. Points are
    weighted by volume, so that refining a part of the design grid does not shift the average.

    Densities of passive points, and what they add to those of their neighbours, are the `offset` (p,); the matrix
    (p, a) then has no entry in their rows. None stands for zero.
    """

    matrix: sp.csr_array | LinearOperator  # rows sum to one, but for what the offset holds
    offset: Array | None = None

    def __call__(self, design: Array) -> Array:
        """Physical densities (p,) of design variables (a,)."""
        filtered = self.matrix @ design
        return filtered if self.offset is None else filtered + self.offset

    def adjoint(self, gradient: Array) -> Array:
        """dJ/ddesign (a,) of dJ/drho (p,)."""
        return self.matrix.T @ gradient


def density_filter(points: MaterialPoints, radius: float) -> DensityFilter:
    """Filter of the given radius [length] over the points' present positions."""
    place = _lattice(points) if len(points.x) >= BY_CONVOLUTION else None
    if place is not None:
        return DensityFilter(_convolution(place, 2 * points.half_length[0], radius))
    tree = KDTree(points.x)
    pairs = tree.query_pairs(radius, output_type="ndarray")
    p, q = np.concatenate([pairs, pairs[:, ::-1], np.arange(tree.n)[:, None].repeat(2, axis=1)]).T
    weight = points.volume[q] * (radius - np.linalg.norm(points.x[p] - points.x[q], axis=1))
    matrix = sp.csr_array((weight, (p, q)), shape=(tree.n, tree.n))
    return DensityFilter(sp.csr_array(sp.diags_array(1 / matrix.sum(axis=1)) @ matrix))


def _lattice(points: MaterialPoints) -> Index | None:
    """Line numbers (p, 2) of equal points on a lattice of their own size, from 0 on; None for any others."""
    spacing = 2 * points.half_length[0]
    if np.ptp(points.half_length, axis=0).max() > 1e-9 * spacing.min() or np.ptp(points.volume) > 1e-9 * spacing.prod():
        return None
    place = (points.x - points.x.min(axis=0)) / spacing
    line = np.rint(place).astype(np.intp)
    # on none are points that were moved singly, several in one place, and few far between
    cells = np.prod(line.max(axis=0) + 1)
    on_lines = np.abs(place - line).max() < 1e-7 and cells <= 8 * len(line)
    alone = on_lines and np.bincount(np.ravel_multi_index(line.T, line.max(axis=0) + 1)).max() == 1
    return line if alone else None


def _convolution(line: Index, spacing: Array, radius: float) -> LinearOperator:
    """The filter's matrix (p, p) for equal points on the lines (p, 2) of a lattice, applied by fast Fourier transform:
    its circle is long enough for no point to see another around it."""
    reach = np.ceil(radius / spacing).astype(int)
    circle = [scipy.fft.next_fast_len(int(n), real=True) for n in line.max(axis=0) + 1 + reach]
    offset = np.meshgrid(*(np.arange(-r, r + 1) for r in reach), indexing="ij")
    kernel = np.zeros(circle)
    kernel[tuple(offset)] = np.maximum(0, radius - np.hypot(*(o * s for o, s in zip(offset, spacing, strict=True))))
    spectrum = scipy.fft.rfft2(kernel)
    place = np.ravel_multi_index((line[:, 0], line[:, 1]), (circle[0], circle[1]))

    def weighted_sum(at_points: Array) -> Array:
        field = np.zeros(circle)
        field.ravel()[place] = at_points.ravel()
        summed = scipy.fft.rfft2(field, overwrite_x=True)
        summed *= spectrum
        return scipy.fft.irfft2(summed, s=circle, overwrite_x=True).take(place)

    total = weighted_sum(np.ones(len(line)))
    p = len(line)
    return LinearOperator(
        (p, p), matvec=lambda x: weighted_sum(x) / total, rmatvec=lambda g: weighted_sum(g.ravel() / total), dtype=float
    )


def passive_filter(points: MaterialPoints, radius: float, space: DesignSpace, *, over_passive: bool) -> DensityFilter:
    """Filter from the active points (a,) to the densities of all (p,), those of passive points being fixed.

    The average is taken over active neighbours only, as if the passive ones were absent; `over_passive` takes it over
    all of them, passive densities included: rho_a = W_aa design + W_as 1.
    """
    active, solid = space.active, space.solid.astype(float)
    p, a = len(solid), len(active)
    into = sp.csr_array((np.ones(a), (active, np.arange(a))), shape=(p, a))
    among = MaterialPoints(points.x[active], points.volume[active], points.half_length[active])
    W = density_filter(points if over_passive else among, radius).matrix
    offset = into @ (W @ solid)[active] + solid if over_passive else solid
    if isinstance(W, LinearOperator):
        spread = aslinearoperator(into)
        return DensityFilter(spread @ (spread.T @ W @ spread if over_passive else W), offset)
    return DensityFilter(sp.csr_array(into @ (W[active][:, active] if over_passive else W)), offset)
