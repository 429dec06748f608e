"""Points of low, high and multiple resolution on one grid, and designs carried from one to another."""

from typing import Any

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array
from mpmtop.points import MaterialPoints, seed
from mpmtop.quadtree import Quadtree, quadtree
from mpmtop.shape_functions import tent
from reference_fem.reanalyse import owners
from validation.bodies.scenes import H, distributed_load
from validation.methods.analyser import Analyser, DensityField, material_points

RTOL_OPTIMUM = 5e-3
"""150 iterations of a non-convex optimisation amplify another processor's rounding; neighbouring optima of this scene
differ by a few 1e-3."""
COARSE, FINE = H / 3, H / 6
MIDDLE = 7.5 * H


def leaves() -> dict[str, Quadtree]:
    """Low, high, and multi resolution with the 23rd row, cut in half by the middle, fine."""
    low = quadtree(distributed_load().body.domain, (COARSE, COARSE))
    return {
        "low": low,
        "multi, quadtree": low.refine(low.centre[:, 1] > MIDDLE - 1e-9),
        "high": low.refine(np.ones(len(low.level), dtype=bool)),
    }


def overlapping() -> MaterialPoints:
    """The paper's 10,170 points: 45 fine rows from the top, 23 coarse ones from the bottom."""
    fine, coarse = (seed(distributed_load().body.domain, (side, side)) for side in (FINE, COARSE))
    above, below = fine.x[:, 1] > MIDDLE, coarse.x[:, 1] < MIDDLE + 1e-9
    return MaterialPoints(
        *(
            np.concatenate([getattr(fine, field)[above], getattr(coarse, field)[below]])
            for field in ("x", "volume", "half_length")
        )
    )


def standard(points: MaterialPoints, radius: float = 1.0 * H) -> Analyser:
    """Standard MPM; GIMP is the same as long as no domain leaves its cell."""
    return material_points(tent, "standard", points=points)(distributed_load(radius))


def remapped(design: DensityField, fine: MaterialPoints) -> Array:
    """Densities of a design at finer points: of the rectangle that holds each, the nearest if two do."""
    return design.rho[owners(fine.x, design.x, design.half_length)]


def effective_radius(analyser: Analyser) -> float:
    """Radius of the continuous cone whose second moment, 0.3 R^2, is the filter's mean over the inner points."""
    problem: Any = analyser.problem
    matrix = sp.csr_array(problem.filter.matrix if hasattr(problem, "filter") else problem.H)
    x, radius = analyser.x, analyser.scene.design.filter_radius
    row, column = matrix.nonzero()
    moment = np.bincount(row, matrix[row, column] * np.sum((x[row] - x[column]) ** 2, axis=1))
    lower, upper = analyser.scene.body.domain.bounds
    inner = np.all((x > lower + radius) & (x < upper - radius), axis=1)
    return float(np.sqrt(moment[inner].mean() / 0.3))


def stored_bytes(analyser: Analyser) -> int:
    """Bytes of the operators that an iteration uses: moduli to stiffness, strain, filter."""
    problem: Any = analyser.problem  # of material points
    operators = (problem.model.stiffness.data_map, problem.model.transfer.B, problem.filter.matrix)
    return sum(part.nbytes for m in operators for part in (m.data, m.indices, m.indptr))
