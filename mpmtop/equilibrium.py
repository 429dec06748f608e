"""Equilibrium: a scene discretised, and Newton's method for f_int(u) = f_ext (Eqs. 3 and 4)."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mpmtop.b_bar import with_mean_dilatation
from mpmtop.ghost import GhostPenalty, ghost_penalty
from mpmtop.grid import Grid
from mpmtop.linear_solver import STRESS_TOLERANCE, SingularMatrix, Solve, Solver, choose_solver
from mpmtop.material import tangent
from mpmtop.multigrid import Lattice
from mpmtop.points import MaterialPoints, seed
from mpmtop.scene import (
    Array,
    Index,
    LoadOutsideBody,
    Mask,
    NotConverged,
    PNormStress,
    PointLoad,
    Scene,
    UnsupportedBody,
)
from mpmtop.shape_functions import ShapeFunction, tent
from mpmtop.stiffness import Stiffness, stiffness
from mpmtop.transfer import Transfer, transfer, weights


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
    solver: Callable[[int, Index, Index, Lattice], Solver] | None = None,
) -> Model:
    """Discretise `scene` by cells of size h (hx, hy) with ppc (nx, ny) points per cell and direction.

    `points` replaces the seeded points, `grid` the grid laid around them with a line on the domain's lower left corner,
    `solver` the choice of solver by size, `choose_solver` with a tolerance that suits the objective. `ghost` is gamma
    of the ghost penalty, see `mpmtop.ghost`: zero for none; tent and GIMP only. `b_bar` averages the dilatation over
    each cell against volumetric locking, see `mpmtop.b_bar`.
    Raises EmptyDomain, PointOutsideGrid, LoadOutsideBody or UnsupportedBody.
    """
    hx, hy = (float(s) for s in np.broadcast_to(h, 2))
    if points is None:
        nx, ny = np.broadcast_to(ppc, 2)
        if min(nx, ny) < 1 or not np.issubdtype(nx.dtype, np.integer):
            raise ValueError(f"{ppc} points per cell: give at least one in each direction, a whole number")
        points = seed(scene.domain, (hx / nx, hy / ny))
    lower, upper = scene.domain.bounds
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
    chosen = solver(len(K.dof), K.row, K.col, Lattice(grid.h, lines, component))
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
    the same factorisation. `tol` is the solver's own tolerance unless given, 1e-9 of a direct one. Where void carries
    load, |K| |u| exceeds |f_ext| so far that rounding alone leaves |R| above that, with f.u right to all digits that
    matter: after the last step |R . u| <= tol f_ext . u, the relative error of the energy, suffices. `moduli` (p,) are
    Young's moduli. Raises UnsupportedBody if K is singular, naming the node, and NotConverged.
    """
    if not np.all(np.isfinite(moduli)) or np.min(moduli) < 0:
        raise ValueError("point moduli must be finite and not negative: check the densities")
    tol = model.solver.tolerance if tol is None else tol
    free = model.stiffness.dof
    f_norm = np.linalg.norm(model.f_ext[free])
    u = np.zeros_like(model.f_ext)
    with _mechanism_named(model):
        solve = model.solver.factor(model.stiffness.data(moduli))
    residual = model.f_ext[free]
    for step in range(1, max_steps + 1):
        with _mechanism_named(model):
            u[free] += solve(residual)
        strain = model.transfer.strain(u)
        f_int = model.internal_force(model.stress(moduli, strain)) + model.ghost.force(moduli, u)
        residual = (model.f_ext - f_int)[free]
        relative = float(np.linalg.norm(residual) / f_norm)
        if relative <= tol:
            return Equilibrium(moduli, u, strain, solve, step, relative)
    energy_error = abs(residual @ u[free]) / abs(model.f_ext @ u)
    if energy_error <= tol:
        return Equilibrium(moduli, u, strain, solve, max_steps, relative)
    raise NotConverged(
        f"residual {relative:.1e} |f_ext|, {energy_error:.1e} of the energy, after {max_steps} Newton steps (tolerance "
        f"{tol:.0e}): the stiffness is nearly singular; raise E_min / E0 (`contrast`) or support the body better"
    )


@contextmanager
def _mechanism_named(model: Model) -> Iterator[None]:
    try:
        yield
    except SingularMatrix as error:
        dof = model.stiffness.dof[error.unknown]
        x, y = model.grid.node_positions(model.transfer.nodes[dof // 2])
        raise UnsupportedBody(
            f"the body can move without resistance: displacement {'xy'[dof % 2]} of the node at ({x:g}, {y:g}) "
            "carries no stiffness; hold the body there, connect it to a support, or raise E_min / E0 (`contrast`)"
        ) from error
