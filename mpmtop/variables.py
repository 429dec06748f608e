"""Design variables: which points have one, where it starts, its bounds, and the densities and volume they make."""

from abc import ABC, abstractmethod
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.optimize import brentq
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from mpmtop.arrays import Array, Index
from mpmtop.design import Design
from mpmtop.errors import InvalidScene
from mpmtop.filter import DensityFilter, DesignSpace, density_filter, design_space, passive_filter
from mpmtop.points import MaterialPoints
from mpmtop.projection import Projected, project
from mpmtop.symmetry import orbits

VOLUME_ROUNDING = 1e-12  # of the volume: sums of p numbers


class DesignVariables(ABC):
    """What problems of any law have in common: variables x (n,) of the `design`, and the densities of p points.

    There is one variable for each of the a points that are not passive, or for each of their images in the mirrors of
    the design. rho = P(H x + fixed), with the filter H and the design's projection P, if it has one.

    The filter measures distances between `grid_points`, and there points are in the design's passive regions or not.
    It passes over passive points as if they were absent, or with `filter_passive` averages their densities with the
    others. Volume is that of the material points, `point_volume` (p,).
    """

    design: Design
    filter_passive: bool = False

    @property
    @abstractmethod
    def grid_points(self) -> MaterialPoints:
        """The points of the design grid."""

    @property
    @abstractmethod
    def point_volume(self) -> Array:
        """Volumes (p,) of the material points."""

    @cached_property
    def space(self) -> DesignSpace:
        """Which points are passive, and which are design variables."""
        return design_space(self.design, self.grid_points)

    @cached_property
    def orbit(self) -> Index | None:
        """Number (a,) of the variable of each active point; None where every one has its own."""
        if not self.design.symmetry:
            return None
        points, active = self.grid_points, self.space.active
        return orbits(self.design.symmetry, points.x[active], points.half_length[active], self.point_volume[active])

    @cached_property
    def filter(self) -> DensityFilter:
        """The density filter of the design's radius, from n variables to p densities."""
        radius = self.design.filter_radius
        if self.space.all_active:
            found = density_filter(self.grid_points, radius)
        else:
            found = passive_filter(self.grid_points, radius, self.space, over_passive=self.filter_passive)
        if self.orbit is None:
            return found
        a = len(self.orbit)
        spread = sp.csr_array((np.ones(a), (np.arange(a), self.orbit)))
        if isinstance(found.matrix, LinearOperator):
            return DensityFilter(found.matrix @ aslinearoperator(spread), found.offset)
        return DensityFilter(sp.csr_array(found.matrix @ spread), found.offset)

    @cached_property
    def positions(self) -> Array:
        """Places of the design variables on the design grid, (n, 2): of several images, the first one's."""
        active = self.space.active
        return self.grid_points.x[active if self.orbit is None else active[np.unique(self.orbit, return_index=True)[1]]]

    @property
    def filter_radius(self) -> float:
        """Radius of the density filter [length]."""
        return self.design.filter_radius

    @property
    def largest_move(self) -> float:
        """How far a rule may move a variable, of its range; see `Projection`."""
        return 1.0 if self.design.projection is None else self.design.projection.largest_move

    def densities(self, filtered: Array) -> Array:
        """Physical densities (p,) of filtered ones."""
        return filtered if self.design.projection is None else self._projected(filtered).rho

    def pull_back(self, filtered: Array | None, by_rho: Array) -> Array:
        """dJ/dx (n,) of dJ/drho (p,), at the filtered densities that the densities were made of; ValueError if they
        were made of none, which a projection does not bear."""
        if self.design.projection is None:
            return self.filter.adjoint(by_rho)
        if filtered is None:
            raise ValueError("these densities come from no design: a projection has a gradient where a design is known")
        return self.filter.adjoint(self._projected(filtered).pull_back(by_rho))

    def _projected(self, filtered: Array) -> Projected:
        assert self.design.projection is not None
        return project(self.design.projection, np.clip(filtered, 0, 1), self.point_volume)

    @cached_property
    def x0(self) -> Array:
        """The paper's start: the volume fraction everywhere, (n,). Beside passive points, or with a projection, the
        uniform design that meets the constraint."""
        n = len(self.positions)
        if self.design.projection is not None:
            return np.full(n, self._uniform(n))
        if self.space.all_active:
            return np.full(n, self.design.volume_fraction)
        passive, full = (self.volume_weight @ self.filter(x) for x in (np.zeros(n), np.ones(n)))
        return np.full(n, np.clip((1 - passive) / (full - passive), self.design.rho_min, 1))

    def _uniform(self, n: int) -> float:
        def excess(x: float) -> float:
            return float(self.volume_weight @ self.densities(self.filter(np.full(n, x))) - 1)

        least = self.design.rho_min
        return least if excess(least) >= 0 else 1.0 if excess(1.0) <= 0 else float(brentq(excess, least, 1.0))

    @cached_property
    def lower(self) -> Array:
        """rho_min everywhere, (n,)."""
        return np.full(len(self.positions), self.design.rho_min)

    @cached_property
    def upper(self) -> Array:
        """One everywhere, (n,)."""
        return np.ones_like(self.lower)

    @cached_property
    def volume_weight(self) -> Array:
        """Weights (p,) of densities in the volume, whose limit is 1."""
        volume = self.point_volume
        return volume / (self.design.volume_fraction * volume[~self.space.void].sum())

    def volume_gradient(self, filtered: Array | None) -> Array:
        """Derivative (1, n) of the volume constraint by the design: without a projection the same for every one."""
        if self.design.projection is None:
            return self._volume_gradient
        return self.pull_back(filtered, self.volume_weight)[None]

    @cached_property
    def _volume_gradient(self) -> Array:
        gradient = self.filter.adjoint(self.volume_weight)[None]
        gradient.flags.writeable = False
        return gradient

    def check_feasible(self) -> None:
        """InvalidScene if passive solid leaves no feasible design."""
        least, design = self.volume_weight @ self.densities(self.filter(self.lower)), self.design
        if least > 1 + VOLUME_ROUNDING:
            raise InvalidScene(
                f"passive solid, with rho_min elsewhere, is {least * design.volume_fraction:.4f} of the volume and "
                f"volume_fraction {design.volume_fraction}: raise it, or shrink passive_solid"
            )
