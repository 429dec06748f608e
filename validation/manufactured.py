"""A manufactured solution: errors of one elastic analysis that owe nothing to outline, supports or loads.

The unit square is cut into n x n cells; lengths are in units of the cell size h = 1, so the square has the side n. The
body goes on for `MARGIN` cells around it, and every node on the square's boundary or outside is held at the exact
solution: u = g + w with g there and w = 0, f_int(w) = f_body - f_int(g) at the nodes within. What is left is the shape
function and the sum over the points that stands for the integral.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from mpmtop.grid import Grid
from mpmtop.linear_solver import choose_solver
from mpmtop.material import tangent
from mpmtop.points import MaterialPoints, seed
from mpmtop.scene import Array, Index, Material, Rectangle, Region
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3
from mpmtop.transfer import Transfer, transfer
from validation.crossing import Crossing
from validation.scenes import H

MATERIAL = Material(young=1.0, poisson=0.3, plane="strain")
MARGIN = 2
"""Cells of body beyond the square: the widest function within it, the cubic, reaches one, and moved points less."""
CURVATURE: dict[ShapeFunction, float] = {bspline2: 1 / 8, bspline3: 1 / 6}
"""Half the variance of a B-spline, [h^2]: see `coefficients`. The others' coefficients are values at the nodes."""
GROWTH, DECAY = 0.8, -0.6  # of u_x along x, of u_y along y, over the side of the square
WAVE_X, WAVE_Y = 2.5, 3.0  # of u_y along x, of u_x along y
PHASE_X, PHASE_Y = 0.3, 0.4


class Fields(NamedTuple):
    """u (p, 2), stress (p, 3) in Voigt order, body force (p, 2) and Laplacian of each component of u (p, 2)."""

    u: Array
    stress: Array
    body_force: Array
    laplacian: Array


def exact(x: Array, side: float) -> Fields:
    """The solution at x (p, 2) in a square of the given side; with X = x / side, Y = y / side

        u_x = exp(0.8 X) sin(3 Y + 0.4),    u_y = sin(2.5 X + 0.3) exp(-0.6 Y),

    b = -div sigma, sigma = lambda tr(eps) I + 2 mu eps in plane strain. Nothing of it vanishes on the boundary.
    """
    X, Y = x.T / side
    nu = MATERIAL.poisson
    lam, mu = MATERIAL.young * np.array([nu / (1 - 2 * nu), 0.5]) / (1 + nu)
    ux, uy = np.exp(GROWTH * X) * np.sin(WAVE_Y * Y + PHASE_Y), np.sin(WAVE_X * X + PHASE_X) * np.exp(DECAY * Y)
    ux_x, ux_y = GROWTH * ux, WAVE_Y * np.exp(GROWTH * X) * np.cos(WAVE_Y * Y + PHASE_Y)
    uy_x, uy_y = WAVE_X * np.cos(WAVE_X * X + PHASE_X) * np.exp(DECAY * Y), DECAY * uy
    dilatation = ux_x + uy_y
    stress = np.stack([lam * dilatation + 2 * mu * ux_x, lam * dilatation + 2 * mu * uy_y, mu * (ux_y + uy_x)], axis=1)
    laplacian = np.stack([(GROWTH**2 - WAVE_Y**2) * ux, (DECAY**2 - WAVE_X**2) * uy], axis=1)
    # div sigma = (lambda + mu) grad div u + mu laplacian u
    gradient = np.stack([GROWTH**2 * ux + DECAY * uy_x, GROWTH * ux_y + DECAY**2 * uy], axis=1)
    body_force = -(lam + mu) * gradient - mu * laplacian
    return Fields(np.stack([ux, uy], axis=1), stress / side, body_force / side**2, laplacian / side**2)


def coefficients(position: Array, side: float, curvature: float) -> Array:
    """Nodal coefficients (a, 2) of the exact u at nodes (a, 2).

    A symmetric function of sum one and variance v [h^2] turns u into u + h^2 v/2 u'' + O(h^4), so the quasi-interpolant
    c = u - h^2 v/2 laplacian(u) takes it back; `curvature` is v/2, zero for values at the nodes. Source: de Boor and
    Fix (1973), J. Approx. Theory 8:19.
    """
    fields = exact(position, side)
    return fields.u - curvature * H**2 * fields.laplacian


@dataclass(frozen=True)
class DeformedWave:
    """A deformation x + `amplitude` sin(2 pi x / `period`) of which the domains take part.

    Each domain becomes its own image, so that they tile the body as before. Positions differ from those of
    `crossing.Wave` by a part of order l^2, volumes and half-lengths by up to 2 pi amplitude / period.
    """

    period: float
    amplitude: float = 0.26

    def __call__(self, points: MaterialPoints, body: Region) -> MaterialPoints:
        x, half = points.x[:, 0], points.half_length[:, 0]
        left, right = (e + self.amplitude * H * np.sin(2 * np.pi * e / (self.period * H)) for e in (x - half, x + half))
        stretch = (right - left) / (2 * half)
        return replace(
            points,
            x=np.stack([(left + right) / 2, points.x[:, 1]], axis=1),
            volume=points.volume * stretch,
            half_length=points.half_length * np.stack([stretch, np.ones_like(stretch)], axis=1),
        )

    def __str__(self) -> str:
        return f"deformed wave({self.period:g}, {self.amplitude:g})"


class Errors(NamedTuple):
    """Relative L2 errors of displacement and stress at the points in the square."""

    displacement: float
    stress: float


def stiffness_product(points: MaterialPoints, operators: Transfer) -> sp.csr_array:
    """V D B (3p, 2a) at unit modulus: K = B^T (V D B).

    `discretise` maps any moduli to K; with one modulus for good a product is enough, and takes a fifth of the time.
    """
    return sp.csr_array(sp.kron(sp.diags_array(points.volume), tangent(MATERIAL), format="csr") @ operators.B)


def held_analysis(inside: Index, u: Array, f: Array, B: sp.csr_array, VDB: sp.csr_array) -> Array:
    """Displacements (2a,) in equilibrium with f (2a,) at the degrees of freedom `inside`, equal to u (2a,) elsewhere.

    Nodes are numbered along the columns of the grid, so the band of K is narrow as it is.
    """
    K = sp.tril(B[:, inside].T @ VDB[:, inside], format="csc")
    K.sort_indices()
    column = np.repeat(np.arange(len(inside)), np.diff(K.indptr))
    solve = choose_solver(len(inside), K.indices.astype(np.intp), column).factor(K.data)
    g = u.copy()
    g[inside] = 0
    g[inside] = solve((f - B.T @ (VDB @ g))[inside])
    return g


def errors(
    cells: int, shape_function: ShapeFunction, crossing: Crossing, *, ppc: int = 2, curvature: float | None = None
) -> Errors:
    """Errors, sqrt(sum V |e|^2 / sum V |exact|^2), with `cells` per side and points moved by `crossing`.

    There are ppc x ppc points per cell, and body forces act where they have been moved to. The stress is measured as a
    tensor, sigma_xy counted twice. `curvature` is that of `coefficients`, by default the shape function's.
    """
    side = cells * H
    square = Rectangle((0.0, 0.0), (side, side))
    body = Rectangle((-MARGIN * H, -MARGIN * H), (side + MARGIN * H, side + MARGIN * H))
    points = crossing(seed(body, (H / ppc, H / ppc)), body)
    grid = Grid.around(*body.bounds, (H, H))
    operators = transfer(grid, points, shape_function)
    position = grid.node_positions(operators.nodes)
    inside = np.flatnonzero(np.repeat(square.contains(position, -1e-9 * H), 2))
    curvature = CURVATURE.get(shape_function, 0.0) if curvature is None else curvature

    expected = exact(points.x, side)
    f = operators.N_matrix.T @ (points.volume[:, None] * expected.body_force)
    given = coefficients(position, side, curvature)
    u = held_analysis(inside, given.ravel(), f.ravel(), operators.B, stiffness_product(points, operators))

    measured = square.contains(points.x)
    weight = points.volume[measured, None]

    def relative(value: Array, reference: Array, components: Array) -> float:
        error, size = ((weight * components * field[measured] ** 2).sum() for field in (value - reference, reference))
        return float(np.sqrt(error / size))

    return Errors(
        relative(operators.interpolate(u), expected.u, np.ones(2)),
        relative(operators.strain(u) @ tangent(MATERIAL), expected.stress, np.array([1.0, 1.0, 2.0])),
    )
