"""Design variables: which points have one, where it starts, its bounds, and the densities and volume they make."""

from abc import ABC, abstractmethod
from functools import cached_property

import numpy as np

from mpmtop.arrays import Array
from mpmtop.design import Design
from mpmtop.errors import InvalidScene
from mpmtop.filter import DensityFilter, DesignSpace, density_filter, design_space, passive_filter
from mpmtop.points import MaterialPoints

VOLUME_ROUNDING = 1e-12  # of the volume: sums of p numbers


class DesignVariables(ABC):
    """What problems of any law have in common: one variable of the `design` for each point that is not passive.

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
    def filter(self) -> DensityFilter:
        """The density filter of the design's radius, from a variables to p densities."""
        radius = self.design.filter_radius
        if self.space.all_active:
            return density_filter(self.grid_points, radius)
        return passive_filter(self.grid_points, radius, self.space, over_passive=self.filter_passive)

    @property
    def positions(self) -> Array:
        """Places of the design variables on the design grid, (a, 2)."""
        return self.grid_points.x[self.space.active]

    @property
    def filter_radius(self) -> float:
        """Radius of the density filter [length]."""
        return self.design.filter_radius

    @cached_property
    def x0(self) -> Array:
        """The paper's start: the volume fraction everywhere, (a,). Beside passive points, what meets the constraint."""
        a = len(self.space.active)
        if self.space.all_active:
            return np.full(a, self.design.volume_fraction)
        passive, full = (self.volume_weight @ self.filter(x) for x in (np.zeros(a), np.ones(a)))
        return np.full(a, np.clip((1 - passive) / (full - passive), self.design.rho_min, 1))

    @cached_property
    def lower(self) -> Array:
        """rho_min everywhere, (a,)."""
        return np.full(len(self.space.active), self.design.rho_min)

    @cached_property
    def upper(self) -> Array:
        """One everywhere, (a,)."""
        return np.ones_like(self.lower)

    @cached_property
    def volume_weight(self) -> Array:
        """Weights (p,) of densities in the volume, whose limit is 1."""
        volume = self.point_volume
        return volume / (self.design.volume_fraction * volume[~self.space.void].sum())

    @cached_property
    def volume_gradient(self) -> Array:
        """Derivative (1, a) of the volume constraint by the design: the same for every one."""
        gradient = self.filter.adjoint(self.volume_weight)[None]
        gradient.flags.writeable = False
        return gradient

    def check_feasible(self) -> None:
        """InvalidScene if passive solid leaves no feasible design."""
        least, design = self.volume_weight @ self.filter(self.lower), self.design
        if least > 1 + VOLUME_ROUNDING:
            raise InvalidScene(
                f"passive solid, with rho_min elsewhere, is {least * design.volume_fraction:.4f} of the volume and "
                f"volume_fraction {design.volume_fraction}: raise it, or shrink passive_solid"
            )
