"""Design variables on elements: start, bounds, and the densities and volume they make."""

from functools import cached_property

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array
from mpmtop.design import Design
from reference_fem.design import BISECTIONS, DesignSpace, design_space, projection_adjoint, step, threshold
from reference_fem.elasticity import FemModel


class DesignVariables:
    """Variables x (n,) of a design, and the densities rho = P(H x + fixed) of the elements of a model."""

    model: FemModel
    design: Design
    filter_passive: bool

    @cached_property
    def space(self) -> DesignSpace:
        """Which elements are design variables, and the filter."""
        return design_space(self.design, self.model.centres, self.model.area, self.filter_passive)

    @property
    def H(self) -> sp.csr_matrix:
        """Density filter (e, n), with empty rows for passive elements."""
        return self.space.H

    @property
    def positions(self) -> Array:
        """Centres of the elements that are design variables, (n, 2): of several images, the first one's."""
        return self.model.centres[self.space.first]

    @property
    def filter_radius(self) -> float:
        """Radius of the filter [length]."""
        return self.design.filter_radius

    @property
    def largest_move(self) -> float:
        """How far a rule may move a variable, of its range; see `Projection`."""
        return 1.0 if self.design.projection is None else self.design.projection.largest_move

    def densities(self, filtered: Array) -> Array:
        """Densities (e,) of filtered ones."""
        projection = self.design.projection
        if projection is None:
            return filtered
        r = np.clip(filtered, 0, 1)
        return step(projection, threshold(projection, r, self.model.area), r)[0]

    def pull_back(self, filtered: Array | None, by_rho: Array) -> Array:
        """dJ/dx (n,) of dJ/drho (e,), at the filtered densities; ValueError where a projection needs them."""
        projection = self.design.projection
        if projection is None:
            return self.H.T @ by_rho
        if filtered is None:
            raise ValueError("these densities come from no design: a projection has a gradient where a design is known")
        return self.H.T @ projection_adjoint(projection, np.clip(filtered, 0, 1), self.model.area, by_rho)

    @cached_property
    def x0(self) -> Array:
        """Uniform design (n,) that meets the volume constraint: the volume fraction if nothing is passive."""
        n = self.H.shape[1]
        area = self.model.area
        if self.design.projection is not None:
            return np.full(n, self._uniform(n))
        if len(self.space.active) == len(area):
            return np.full(n, self.design.volume_fraction)
        uniform = (self.volume_bound - area @ self.space.fixed) / (area @ (self.H @ np.ones(n)))
        return np.full(n, np.clip(uniform, self.design.rho_min, 1))

    def _uniform(self, n: int) -> float:
        low, high = self.design.rho_min, 1.0
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            volume = self.volume(self.densities(self.H @ np.full(n, middle) + self.space.fixed))
            low, high = (middle, high) if volume < 1 else (low, middle)
        return low

    @property
    def lower(self) -> Array:
        """rho_min everywhere (n,)."""
        return np.full(self.H.shape[1], self.design.rho_min)

    @property
    def upper(self) -> Array:
        """One everywhere (n,)."""
        return np.ones(self.H.shape[1])

    @cached_property
    def volume_bound(self) -> float:
        """The largest volume allowed."""
        return self.design.volume_fraction * self.model.area[~self.space.void].sum()

    @property
    def volume_share(self) -> Array:
        """Weights (e,) of densities in the fraction of what is not passive void."""
        return self.model.area / self.model.area[~self.space.void].sum()

    def volume(self, rho: Array) -> float:
        """Volume of densities rho (e,) by the largest one allowed."""
        return float(self.model.area @ rho / self.volume_bound)

    def volume_gradient(self, filtered: Array | None = None) -> Array:
        """Derivative (1, n) of that volume by the design; with a projection, at its filtered densities."""
        return (self.pull_back(filtered, self.model.area) / self.volume_bound)[None]
