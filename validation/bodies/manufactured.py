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
from skfem import CellBasis, LinearForm
from skfem.helpers import dot

from mpmtop.arrays import Array, Index
from mpmtop.body import Body, Material, Support
from mpmtop.crossing import Crossing
from mpmtop.grid import Grid
from mpmtop.material import tangent
from mpmtop.points import MaterialPoints, seed
from mpmtop.region import Difference, Rectangle, Region
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3
from mpmtop.solvers import Pattern, choose_solver
from mpmtop.transfer import Transfer, body_ends, transfer
from reference_fem.elasticity import FemModel, fem_model, inverse_stiffness
from reference_fem.mesh import lattice, vector_basis
from validation.bodies.scenes import H

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

    def __call__(self, points: MaterialPoints, body: Region, h: float = H, x0: float = 0.0) -> MaterialPoints:
        x, half = points.x[:, 0], points.half_length[:, 0]
        sides = (x - half, x + half)
        left, right = (e + self.amplitude * h * np.sin(2 * np.pi * (e - x0) / (self.period * h)) for e in sides)
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
    """Relative L2 errors of displacement and stress."""

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
    solve = choose_solver(Pattern(len(inside), K.indices.astype(np.intp), column)).factor(K.data)
    g = u.copy()
    g[inside] = 0
    g[inside] = solve((f - B.T @ (VDB @ g))[inside])
    return g


@dataclass(frozen=True, eq=False)
class Analysis:
    """The square of `cells` cells per side, analysed: points and operators, degrees of freedom `inside` (n,) that were
    solved for, and displacements u (2a,)."""

    cells: int
    points: MaterialPoints
    operators: Transfer
    VDB: sp.csr_array
    inside: Index
    u: Array

    @property
    def errors(self) -> Errors:
        """sqrt(sum V |e|^2 / sum V |exact|^2) over the points in the square."""
        side = self.cells * H
        measured = Rectangle((0.0, 0.0), (side, side)).contains(self.points.x)
        expected = exact(self.points.x, side)
        u, stress = self.operators.interpolate(self.u), self.operators.strain(self.u) @ tangent(MATERIAL)
        return relative_errors(
            u[measured], stress[measured], expected.u[measured], expected.stress[measured], self.points.volume[measured]
        )


def relative_errors(u: Array, stress: Array, exact_u: Array, exact_stress: Array, weight: Array) -> Errors:
    """Errors of u (p, 2) and stress (p, 3), relative, by the weights (p,) of the positions.

    The stress is measured as a tensor, sigma_xy counted twice.
    """

    def relative(value: Array, reference: Array, components: Array) -> float:
        error, size = (weight @ (field**2 @ components) for field in (value - reference, reference))
        return float(np.sqrt(error / size))

    return Errors(relative(u, exact_u, np.ones(2)), relative(stress, exact_stress, np.array([1.0, 1.0, 2.0])))


def analysis(
    cells: int, shape_function: ShapeFunction, crossing: Crossing, *, ppc: int = 2, curvature: float | None = None
) -> Analysis:
    """Material points, ppc x ppc per cell, with `cells` cells per side and points moved by `crossing`.

    Body forces act where the points have been moved to. `curvature` is that of `coefficients`, by default the shape
    function's.
    """
    side = cells * H
    square = Rectangle((0.0, 0.0), (side, side))
    body = Rectangle((-MARGIN * H, -MARGIN * H), (side + MARGIN * H, side + MARGIN * H))
    points = crossing(seed(body, (H / ppc, H / ppc)), body)
    grid = Grid.around(*body.bounds, (H, H))
    operators = transfer(grid, points, shape_function, body_ends(grid, points))
    position = grid.node_positions(operators.nodes)
    inside = np.flatnonzero(np.repeat(square.contains(position, -1e-9 * H), 2))
    curvature = CURVATURE.get(shape_function, 0.0) if curvature is None else curvature

    f = operators.N_matrix.T @ (points.volume[:, None] * exact(points.x, side).body_force)
    given = coefficients(position, side, curvature)
    VDB = stiffness_product(points, operators)
    u = held_analysis(inside, given.ravel(), f.ravel(), operators.B, VDB)
    return Analysis(cells, points, operators, VDB, inside, u)


def errors(
    cells: int, shape_function: ShapeFunction, crossing: Crossing, *, ppc: int = 2, curvature: float | None = None
) -> Errors:
    """Errors of material points at themselves; arguments as for `analysis`."""
    return analysis(cells, shape_function, crossing, ppc=ppc, curvature=curvature).errors


@dataclass(frozen=True, eq=False)
class FiniteElementAnalysis:
    """The square of `cells` elements per side: model and displacements u (N,)."""

    cells: int
    model: FemModel
    u: Array

    @property
    def errors(self) -> Errors:
        """L2 errors by 4 x 4 Gauss points in each element, none of which is one where stress converges faster."""
        basis = self.model.basis
        fine = CellBasis(basis.mesh, basis.elem, intorder=7, dofs=basis.dofs)
        field = fine.interpolate(self.u)
        grad = field.grad
        strain = np.stack([grad[0, 0], grad[1, 1], grad[0, 1] + grad[1, 0]], axis=-1).reshape(-1, 3)
        expected = exact(np.asarray(fine.global_coordinates()).reshape(2, -1).T, self.cells * H)
        u = np.asarray(field).reshape(2, -1).T
        return relative_errors(u, strain @ tangent(MATERIAL), expected.u, expected.stress, fine.dx.ravel())


def finite_elements(cells: int, order: int) -> FiniteElementAnalysis:
    """Bilinear (order 1) or biquadratic (2) elements of size h, held at the exact values on the square's boundary."""
    side = cells * H
    square = Rectangle((0.0, 0.0), (side, side))
    everywhere = Rectangle((-np.inf, -np.inf), (np.inf, np.inf))
    body = Body(square, (Support(Difference(everywhere, square)),), material=MATERIAL)
    basis = vector_basis(lattice(square.bounds, np.array([H, H])), order)
    fine = CellBasis(basis.mesh, basis.elem, intorder=2 * order + 2, dofs=basis.dofs)
    b = exact(np.asarray(fine.global_coordinates()).reshape(2, -1).T, side).body_force.T.reshape(2, *fine.dx.shape)
    model = fem_model(body, basis, LinearForm(lambda v, w: dot(w.b, v)).assemble(fine, b=b))
    u = np.zeros(basis.N)
    for a, dofs in enumerate(basis.split_indices()):
        u[dofs] = exact(basis.doflocs[:, dofs].T, side).u[:, a]
    u[model.free] = 0
    local = np.einsum("eij,je->ie", model.matrices[model.shape], u[basis.element_dofs])
    lifted = model.f_ext - np.bincount(basis.element_dofs.ravel(), local.ravel(), basis.N)
    u[model.free] = inverse_stiffness(model, np.ones(len(model.area)))(lifted)[model.free]
    return FiniteElementAnalysis(cells, model, u)
