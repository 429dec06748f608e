"""Design: from the optimiser's variables to physical densities, and back for the gradient."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import KDTree

from mpmtop.points import MaterialPoints
from mpmtop.scene import Array


@dataclass(frozen=True, eq=False)
class DensityFilter:
    """Density filter: rho_p = sum_q w_pq design_q / sum_q w_pq with w_pq = V_q max(0, r - |x_p - x_q|).

    Source: Bruns and Tortorelli (2001), Comput. Methods Appl. Mech. Engrg 190:3443. Points are
    weighted by volume, so that refining a part of the design grid does not shift the average.
    """

    matrix: sp.csr_array  # rows sum to one

    def __call__(self, design: Array) -> Array:
        """Physical densities (p,) of design variables (p,)."""
        return self.matrix @ design

    def adjoint(self, gradient: Array) -> Array:
        """dJ/ddesign (p,) of dJ/drho (p,)."""
        return self.matrix.T @ gradient


def density_filter(points: MaterialPoints, radius: float) -> DensityFilter:
    """Filter of the given radius [length] over the points' present positions."""
    tree = KDTree(points.x)
    pairs = tree.query_pairs(radius, output_type="ndarray")
    p, q = np.concatenate([pairs, pairs[:, ::-1], np.arange(tree.n)[:, None].repeat(2, axis=1)]).T
    weight = points.volume[q] * (radius - np.linalg.norm(points.x[p] - points.x[q], axis=1))
    matrix = sp.csr_array((weight, (p, q)), shape=(tree.n, tree.n))
    return DensityFilter(sp.csr_array(sp.diags_array(1 / matrix.sum(axis=1)) @ matrix))
