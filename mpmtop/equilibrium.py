"""Equilibrium: a scene discretised, and Newton's method for f_int(u) = f_ext (Eqs. 3 and 4)."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from mpmtop.b_bar import with_mean_dilatation
from mpmtop.ghost import GhostPenalty, ghost_penalty
from mpmtop.grid import Grid
from mpmtop.material import tangent
from mpmtop.points import MaterialPoints, seed
from mpmtop.region import divisions
from mpmtop.scene import (
    Array,
    InvalidScene,
    LoadOutsideBody,
    Mask,
    NotConverged,
    PNormStress,
    PointLoad,
    Scene,
    UnsupportedBody,
)
from mpmtop.shape_functions import ShapeFunction, tent
from mpmtop.solvers import STRESS_TOLERANCE, Lattice, Pattern, SingularMatrix, Solve, Solver, choose_solver
from mpmtop.stiffness import Stiffness, stiffness
from mpmtop.transfer import Transfer, transfer, weights

CONNECTS = 1e-7
"""Points softer than this part of the stiffest tie nothing to a support: only used to say what floats."""
ADJOINT = 1e-6
"""Error of a gradient, relative, that rounding may leave where void carries the load: it misleads no optimiser."""


@dataclass(frozen=True, eq=False)
class Model:
    """A scene on a grid with material points: all that stays the same while densities change."""

    scene: Scene
    grid: Grid
    points: MaterialPoints
    shape_function: ShapeFunction
    transfer: Transfer
    D: Array  # tangent at unit modulus (3, 3)
    f_ext: Array  # (2a,), supported degrees of freedom included
    ghost: GhostPenalty
    stiffness: Stiffness
    solver: Solver

    def stress(self, moduli: Array, strain: Array) -> Array:
        """Stresses (p, 3), Voigt, at the points with Young's moduli (p,): sigma_p = E_p D eps_p."""
        return moduli[:, None] * (strain @ self.D)

    def internal_force(self, stress: Array) -> Array:
        """f_int = sum_p V_p B_p^T sigma_p, (2a,), of the points; a ghost penalty adds its own `force`."""
        return self.transfer.B.T @ (self.points.volume[:, None] * stress).ravel()


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """Displacements u (2a,) [length] and strains (p, 3) in equilibrium, with the factorisation that found them, ready
    for an adjoint."""

    moduli: Array
    u: Array
    strain: Array
    solve: Solve
    newton_steps: int
    residual: float  # |R| / |f_ext| over the free degrees of freedom


def discretise(
    scene: Scene,
    h: float | tuple[float, float],
    ppc: int | tuple[int, int] = 2,
    shape_function: ShapeFunction = tent,
    *,
    points: MaterialPoints | None = None,
    grid: Grid | None = None,
    ghost: float = 0.0,
    b_bar: bool = False,
    solver: Callable[[Pattern], Solver] | None = None,
) -> Model:
    """Discretise `scene` by cells of size h (hx, hy) with ppc (nx, ny) points per cell and direction.

    `points` replaces the seeded points, `grid` the grid laid around them with a line on the domain's lower left corner,
    `solver` the choice of solver by size, `choose_solver` with a tolerance that suits the objective. `ghost` is gamma
    of the ghost penalty, see `mpmtop.ghost`: zero for none; tent and GIMP only. `b_bar` averages the dilatation over
    each cell against volumetric locking, see `mpmtop.b_bar`.
    Raises EmptyDomain, PointOutsideGrid, LoadOutsideBody, UnsupportedBody, or InvalidScene for `b_bar` in plane stress.

    Limit: domains of GIMP that leave the body's outermost cells by a hair give the nodes outside a hair of stiffness.
    These move far and the edge gets softer by a step, the more so the fewer cells the body has, unless a ghost penalty
    ties them: take quantities of interest at points, not at nodes.
    """
    hx, hy = (float(s) for s in np.broadcast_to(h, 2))
    lower, upper = scene.domain.bounds
    if points is None:
        nx, ny = np.broadcast_to(ppc, 2)
        if min(nx, ny) < 1 or not np.issubdtype(nx.dtype, np.integer):
            raise ValueError(f"{ppc} points per cell: give at least one in each direction, a whole number")
        points = seed(scene.domain, (hx / nx, hy / ny))
        # the lattice took the exact division of the sides; a grid of another pitch would drift through the points
        hx, hy = (upper - lower) * (nx, ny) / divisions("spacing", (lower, upper), (hx / nx, hy / ny))
    if grid is None:
        outside = np.maximum([lower - points.x.min(axis=0), points.x.max(axis=0) - upper], 0) / (hx, hy)
        grid = Grid.around(lower, upper, (hx, hy), margin=2 + int(np.ceil(outside.max())))
    operators = transfer(grid, points, shape_function)
    position = grid.node_positions(operators.nodes)
    f_ext = external_force(scene, grid, points, operators)
    held = held_dofs(scene, position, tol=1e-9 * min(hx, hy))
    D = tangent(scene.material)
    penalty = ghost_penalty(ghost, grid, points, operators, shape_function)
    if b_bar:
        if scene.material.plane == "stress":
            raise InvalidScene("b_bar: plane stress does not lock, and B-bar only makes it softer; leave it off")
        operators = with_mean_dilatation(grid, points, operators)
    K = stiffness(grid, points, operators, D, held, penalty)
    if not np.any(f_ext[K.dof]):
        raise LoadOutsideBody(
            "the loads act on held nodes only: move them away from the supports, or make them nonzero"
        )
    node, component = np.divmod(K.dof, 2)
    lines = np.stack(np.divmod(operators.nodes[node], grid.nodes[1]), axis=-1)
    if solver is None:
        of_stress = isinstance(scene.objective, PNormStress)
        solver = partial(choose_solver, tolerance=STRESS_TOLERANCE) if of_stress else choose_solver
    chosen = solver(Pattern(len(K.dof), K.row, K.col, Lattice(grid.h, lines, component)))
    return Model(scene, grid, points, shape_function, operators, D, f_ext, penalty, K, chosen)


def external_force(scene: Scene, grid: Grid, points: MaterialPoints, operators: Transfer) -> Array:
    """Nodal forces (2a,) of the scene's loads, p2g through the shape functions of the points that carry them."""
    force = np.zeros((len(operators.nodes), 2))
    tol = 1e-9 * min(grid.h)
    for load in scene.loads:
        if isinstance(load, PointLoad) and load.points == 0:
            position = replace(
                points, x=np.array([load.position]), volume=points.volume[:1], half_length=points.half_length[:1]
            )
            node, _, N, _ = (w[0] for w in weights(grid, position, tent))
            node, N = node[N != 0], N[N != 0]
            if not np.all(np.isin(node, operators.nodes)):
                raise LoadOutsideBody(f"load at {load.position}: no material point touches its nodes; move it inwards")
            np.add.at(force, np.searchsorted(operators.nodes, node), N[:, None] * load.force)
        else:
            carriers, share = load.shares(points.x, tol)
            force += np.outer(operators.N_matrix[carriers].T @ share, load.force)
    return force.ravel()


def held_dofs(scene: Scene, position: Array, tol: float) -> Mask:
    """Which degrees of freedom (2a,) of the nodes at `position` (a, 2) the supports hold."""
    held = np.zeros((len(position), 2), dtype=bool)
    for support in scene.supports:
        inside = support.region.contains(position, tol)
        if not np.any(inside):
            lower, upper = support.region.bounds
            raise UnsupportedBody(
                f"the support from {lower} to {upper} holds no node that a material point touches: "
                "move it onto the body"
            )
        held |= inside[:, None] & np.array(support.fixed)
    return held.ravel()


def equilibrium(model: Model, moduli: Array, *, tol: float | None = None, max_steps: int = 3) -> Equilibrium:
    """Newton's method from u = 0 until |R| <= tol |f_ext|, R = f_ext - f_int(u) over the free degrees of freedom.

    A linear scene takes one step; the tangent does not change, so any further step is an iterative refinement with
    the same factorisation: see `checked_solve`, also for `tol` and what it raises. `moduli` (p,) are Young's moduli.
    Raises UnsupportedBody if K is singular, naming the node and the island it belongs to.
    """
    if not np.all(np.isfinite(moduli)) or np.min(moduli) < 0:
        raise ValueError("point moduli must be finite and not negative: check the densities")
    with _mechanism_named(model, moduli):
        solve = model.solver.factor(model.stiffness.data(moduli))
    found = checked_solve(model, moduli, solve, model.f_ext, tol=tol, max_steps=max_steps)
    return Equilibrium(moduli, found.u, found.strain, solve, found.steps, found.residual)


class Solution(NamedTuple):
    """u (2a,), zero where held, its strains (p, 3), the solves it took and |R| / |load| over the free unknowns."""

    u: Array
    strain: Array
    steps: int
    residual: float


@np.errstate(over="ignore", invalid="ignore")  # what leaves the range is refused below, by name
def checked_solve(
    model: Model,
    moduli: Array,
    solve: Solve,
    load: Array,
    *,
    state: Array | None = None,
    tol: float | None = None,
    max_steps: int = 3,
) -> Solution:
    """K u = load (2a,) with the factorisation `solve` of K(moduli), and a check of the result: R = load - K u.

    Accepted is |R| <= tol |load| with |R . v| <= tol |load . v|; if not, u is refined by solving for R. v is u itself,
    or for an adjoint the `state` (2a,) it belongs to: the gradient is a product of the two, and an adjoint may miss a
    soft part of the body that decides it, however small |R| is. `tol` is the solver's own tolerance unless given, 1e-9
    of a direct one.

    Where void carries load, |K| |u| exceeds |load| so far that rounding alone leaves |R| above that, with load . u
    right to all digits that matter. So the last step may miss it if the error in the energy norm is small: its square,
    R . K^-1 R, must not exceed tol load . u, with |R . u| added, as both enter load . u; an adjoint may leave ADJOINT
    of |load . v|.

    Raises NotConverged, naming where u is least certain, UnsupportedBody where an iterative solver meets a mechanism,
    and ValueError where load . u leaves the range of double precision.
    """
    tol = model.solver.tolerance if tol is None else tol
    free = model.stiffness.dof
    u = np.zeros_like(load)
    residual = load[free]
    if not np.any(residual):
        return Solution(u, model.transfer.strain(u), 0, 0.0)
    size = np.linalg.norm(residual)
    for step in range(1, max_steps + 1):
        with _mechanism_named(model, moduli):
            u[free] += solve(residual)
        strain = model.transfer.strain(u)
        f_int = model.internal_force(model.stress(moduli, strain)) + model.ghost.force(moduli, u)
        residual = (load - f_int)[free]
        energy = float(load @ u)
        if not energy > 0 or energy == np.inf:
            raise _unusable(model, moduli, u[free], energy)
        relative = float(np.linalg.norm(residual) / size)
        v = u if state is None else state
        missed = _part(abs(float(residual @ v[free])), abs(float(load @ v)))
        if relative <= tol and missed <= tol:
            return Solution(u, strain, step, relative)
    with _mechanism_named(model, moduli):
        correction = solve(residual)
    error = abs(float(residual @ correction)) / energy + (missed if state is None else 0.0)
    if error <= tol and (state is None or missed <= max(tol, ADJOINT)):
        return Solution(u, strain, max_steps, relative)
    raise NotConverged(
        f"residual {relative:.1e} |load|, {error:.1e} of the energy, after {max_steps} Newton steps (tolerance "
        f"{tol:.0e}): the stiffness is nearly singular at {_place(model, moduli, int(np.argmax(np.abs(correction))))}; "
        "raise E_min / E0 (`contrast`) or support the body better"
    )


def _part(part: float, whole: float) -> float:
    """part / whole of numbers that are not negative; nothing is no part of nothing."""
    return part / whole if whole > 0 else (np.inf if part > 0 else 0.0)


def _unusable(model: Model, moduli: Array, u: Array, energy: float) -> Exception:
    """Why load . u = `energy` is not the work of a solution u (m,)."""
    if energy in (0, np.inf):
        return ValueError(f"load . u = {energy:g}: choose units nearer to the force and the modulus")
    return NotConverged(
        f"load . u = {energy:g}, where K is positive: the stiffness is nearly singular at "
        f"{_place(model, moduli, int(np.argmax(np.abs(u))))}; raise E_min / E0 (`contrast`) or support the body better"
    )


@contextmanager
def _mechanism_named(model: Model, moduli: Array) -> Iterator[None]:
    try:
        yield
    except SingularMatrix as error:
        raise UnsupportedBody(
            f"the body can move without resistance: {_place(model, moduli, error.unknown)}, carries no stiffness; hold "
            "the body there, connect it to a support, or raise E_min / E0 (`contrast`)"
        ) from error


def _place(model: Model, moduli: Array, unknown: int) -> str:
    """The unknown's node, and the island of points it belongs to if no support holds a node of that."""
    dof = model.stiffness.dof[unknown]
    transfer, position = model.transfer, model.points.x
    x, y = model.grid.node_positions(transfer.nodes[dof // 2])
    place = f"displacement {'xy'[dof % 2]} of the node at ({x:g}, {y:g})"
    a, p = len(transfer.nodes), len(moduli)
    stiff = moduli > CONNECTS * np.max(moduli)
    point, k = np.nonzero(transfer.touched & stiff[:, None])
    ties = sp.coo_array((np.ones(len(point)), (transfer.stencil[point, k], a + point)), shape=(a + p, a + p))
    piece = connected_components(ties, directed=False)[1]
    with_it = piece == piece[dof // 2]
    island = np.flatnonzero(with_it[a:] & stiff)
    supported = np.ones(2 * a, dtype=bool)
    supported[model.stiffness.dof] = False
    if len(island) == 0:
        return f"{place}, where all material is void"
    if np.any(supported.reshape(-1, 2)[with_it[:a]]):
        return place
    (x0, y0), (x1, y1) = position[island].min(axis=0), position[island].max(axis=0)
    extent = f"{len(island)} points from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g})"
    return f"{place}, on an island that no support holds, of {extent}"
