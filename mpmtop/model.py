"""Model: a body on a grid with material points, its loads and supports, and the operators made of them."""

import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from mpmtop.arrays import Array, Mask, number, numbers
from mpmtop.b_bar import with_mean_dilatation
from mpmtop.body import Body, Elastic, Support, elastic
from mpmtop.cut import cut_points
from mpmtop.diagnose import ModelWarning, findings
from mpmtop.errors import InvalidScene, UnsupportedBody
from mpmtop.forces import Forces, external_force
from mpmtop.ghost import GhostPenalty, ghost_penalty
from mpmtop.grid import Grid
from mpmtop.loads import Load, check_work
from mpmtop.material import by_material, tangent
from mpmtop.points import MaterialPoints, seed
from mpmtop.region import Region, divisions
from mpmtop.shape_functions import Ends, ShapeFunction, gimp, tent
from mpmtop.solvers import Lattice, Pattern, Solver, choose_solver
from mpmtop.stiffness import Stiffness, stiffness
from mpmtop.ties import Ties, stated_ties, tie
from mpmtop.transfer import Functions, Transfer, body_ends, functions_at, transfer


@dataclass(frozen=True, eq=False)
class Model:
    """A body on a grid with material points: all that stays the same while densities change.

    The body may be exchanged for one with other loads (`dataclasses.replace`). One of another material or on other
    supports is InvalidScene: K is made of them.
    """

    body: Body
    grid: Grid
    points: MaterialPoints
    shape_function: ShapeFunction
    ends: tuple[Ends, Ends]  # of the body [nodes], where B-splines end
    transfer: Transfer
    ghost: GhostPenalty
    ties: Ties
    stiffness: Stiffness
    solver: Solver
    findings: tuple[ModelWarning, ...]  # how the model misleads about the body, see `mpmtop.diagnose`
    acting: tuple[Body, Forces]  # a body whose loads are known already, and their nodal forces

    def __post_init__(self) -> None:
        nodes = self.grid.node_positions(self.transfer.nodes)
        held = held_dofs(self.body.held, nodes, 1e-9 * min(self.grid.h))
        if np.any(held[self.stiffness.dof]) or len(held) - np.count_nonzero(held) != len(self.stiffness.dof):
            raise InvalidScene("the stiffness was made for other supports: discretise the body anew")
        if self.ties.stated != stated_ties(self.body):
            raise InvalidScene("the stiffness was made for other springs or edges: discretise the body anew")
        if not np.array_equal(self.stiffness.D, self.D):
            raise InvalidScene("the stiffness was made of another material: discretise the body anew")

    @cached_property
    def elastic(self) -> Elastic:
        """Elastic constants of the solid at the points."""
        return elastic(self.body, self.points.x, "material point")

    @cached_property
    def D(self) -> Array:
        """Elastic tangent at unit modulus (3, 3), or (p, 3, 3) where Poisson's ratio differs."""
        return tangent(self.elastic)

    @cached_property
    def forces(self) -> Forces:
        """Nodal forces of the body's loads, held degrees of freedom included."""
        body, known = self.acting
        return known if body is self.body else self.forces_of(self.body.loads)

    def forces_of(self, loads: Iterable[Load]) -> Forces:
        """Nodal forces of any loads, held degrees of freedom included."""
        body, grid, points = self.body, self.grid, self.points
        return external_force(loads, body.domain, grid, points, self.shape_function, self.ends, self.transfer)

    @property
    def f_ext(self) -> Array:
        """Nodal forces (2a,) of the body's loads, but for those that follow the density."""
        return self.forces.fixed

    def force(self, rho: Array) -> Array:
        """Nodal forces (2a,) of all loads at densities rho (p,)."""
        return self.forces.at(rho)

    def force_work(self, v: Array) -> Array | None:
        """v . df/drho (p,) of the loads that follow the density, for nodal v (2a,); None if none does."""
        return None if self.forces.weight is None else self.forces.weight.T @ v

    @cached_property
    def prescribed(self) -> Array | None:
        """Nodal displacements (2a,) that supports prescribe, zero elsewhere; None if all are zero."""
        if not self.body.is_displaced:
            return None
        nodes = self.grid.node_positions(self.transfer.nodes)
        return prescribed(self.body.held, nodes, 1e-9 * min(self.grid.h))

    def resistance(self, moduli: Array, u: Array, strain: Array | None = None) -> Array:
        """K u (2a,) before any degree of freedom is held, ghost penalty and ties included; `strain` (p, 3) if known."""
        stress = self.stress(moduli, self.transfer.strain(u) if strain is None else strain)
        return sum((part.force(moduli, u) for part in self._beside), start=self.internal_force(stress))

    def work(self, v: Array, strain_v: Array, u: Array, strain_u: Array) -> Array:
        """v . dK/dE_p u (p,) = V_p eps_p(v) . D eps_p(u), and the parts of ghost penalty and edges."""
        energy = by_material(strain_v, self.D)
        energy *= strain_u
        by_points = self.points.volume * np.sum(energy, axis=1)
        return sum((part.work(v, u) for part in self._beside), start=by_points)

    @cached_property
    def _beside(self) -> tuple[GhostPenalty | Ties, ...]:
        """What resists beside the points, where there is any."""
        return *([self.ghost] if self.ghost.modulus.shape[0] else ()), *([self.ties] if self.ties.stated else ())

    def at(self, x: Array, half_length: Array | float = 0.0) -> Functions:
        """The functions at positions x (k, 2) of the body, as at points with domains of `half_length` (k, 2) there.

        Without a domain those of GIMP are the tent, which its field is made of. On the body's last grid line they are
        those of the cell inside. A mean dilatation (B-bar) is of points and takes no part. Raises PositionOutsideBody
        where no material point gives the nodes any stiffness.
        """
        return functions_at(self.grid, self.transfer.nodes, self.shape_function, self.ends, x, half_length)

    def stress(self, moduli: Array, strain: Array) -> Array:
        """Stresses (p, 3), Voigt, at the points with Young's moduli (p,): sigma_p = E_p D eps_p."""
        return moduli[:, None] * by_material(strain, self.D)

    def internal_force(self, stress: Array) -> Array:
        """f_int = sum_p V_p B_p^T sigma_p, (2a,), of the points; a ghost penalty adds its own `force`."""
        return self.transfer.B.T @ (self.points.volume[:, None] * stress).ravel()


def discretise(
    body: Body,
    h: float | tuple[float, float] | None = None,
    ppc: int | tuple[int, int] | None = None,
    shape_function: ShapeFunction = tent,
    *,
    points: MaterialPoints | None = None,
    grid: Grid | None = None,
    ghost: float = 0.0,
    b_bar: bool = False,
    cut: bool = False,
    solver: Callable[[Pattern], Solver] = choose_solver,
) -> Model:
    """Discretise `body` by cells of size h (hx, hy) with ppc (nx, ny) points per cell and direction, 2 unless given.

    `points` replaces the seeded points and ppc, `grid` replaces h and the grid laid around the points with a line on
    the domain's lower left corner, `solver` the choice of solver by size, `choose_solver`. `ghost` is gamma of the
    ghost penalty, see `mpmtop.ghost`: zero for none; tent and GIMP only. `b_bar` averages the dilatation over each cell
    against volumetric locking, see `mpmtop.b_bar`. `cut` seeds the pieces of the grid's own cells that the domain
    covers, see `mpmtop.cut`: for a body whose edge runs between the grid's lines; h need not divide its sides.
    Raises EmptyDomain, PointOutsideGrid, LoadOutsideBody, UnsupportedBody, or InvalidScene for `b_bar` in plane stress,
    and for an argument that another one leaves without effect.
    Warns of what misleads about the body, see `mpmtop.diagnose`: GluedGap, NearMechanism, UnevenCells,
    PointsOnGridLines.

    Limit: domains of GIMP that leave the body's outermost cells by a hair give the nodes outside a hair of stiffness.
    These move far and the edge gets softer by a step, the more so the fewer cells the body has, unless a ghost penalty
    ties them: take quantities of interest at points, not at nodes.
    """
    seeded_in = body.domain if points is None else None
    _check_kinds({"b_bar": b_bar, "cut": cut}, {"shape_function": shape_function, "solver": solver})
    if cut:
        points, grid = _cut(body.domain, h, ppc, points, grid, shape_function)
        h = ppc = None
    points, (hx, hy) = points_and_cell(body.domain, h, ppc, points, grid)
    lower, upper = body.domain.bounds
    if grid is None:
        outside = np.maximum([lower - points.x.min(axis=0), points.x.max(axis=0) - upper], 0) / (hx, hy)
        grid = Grid.around(lower, upper, (hx, hy), margin=2 + int(np.ceil(outside.max())))
    ends = body_ends(grid, points)
    weighted = transfer(grid, points, shape_function, ends)
    forces = external_force(body.loads, body.domain, grid, points, shape_function, ends, weighted)
    f_ext = forces.at(np.ones(len(points.volume)))
    found = findings(grid, points, weighted, shape_function, body.held, f_ext, seeded_in, cut)
    penalty = ghost_penalty(ghost, grid, points, weighted, shape_function)
    if b_bar:
        if body.material.plane == "stress":
            raise InvalidScene("b_bar: plane stress does not lock, and B-bar only makes it softer; leave it off")
        weighted = with_mean_dilatation(grid, points, weighted)
    held = held_dofs(body.held, grid.node_positions(weighted.nodes), 1e-9 * min(grid.h))
    D = tangent(elastic(body, points.x, "material point"))
    ties = tie(body, grid, points, weighted, shape_function, ends, D)
    K = stiffness(grid, points, weighted, D, held, penalty, ties)
    chosen = _bound(solver, _pattern(grid, weighted, K))
    model = Model(body, grid, points, shape_function, ends, weighted, penalty, ties, K, chosen, found, (body, forces))
    if body.loads:
        check_loads(model)
    for finding in found:
        warnings.warn(finding, stacklevel=2)
    return model


def _check_kinds(flags: dict[str, Any], functions: dict[str, Any]) -> None:
    for name, flag in flags.items():
        if not isinstance(flag, bool):
            raise InvalidScene(f"{name} {flag!r}: say True or False")
    for name, function in functions.items():
        if not callable(function) or (name == "shape_function" and not hasattr(function, "__name__")):
            raise InvalidScene(f"{name} {function!r}: give a function by name, such as tent, or leave it out")


def _bound(solver: Callable[[Pattern], Solver], pattern: Pattern) -> Solver:
    """The solver of a pattern; InvalidScene unless it is one."""
    try:
        chosen = solver(pattern)
    except TypeError as error:
        raise InvalidScene(f"`solver` {solver!r} failed ({error}): let it take a `Pattern`") from error
    if not (callable(getattr(chosen, "factor", None)) and number(getattr(chosen, "tolerance", None)) > 0):
        raise InvalidScene(
            f"`solver` made a {type(chosen).__name__}: return an object with `factor(data, tolerance)` and a positive "
            "`tolerance`, as those of mpmtop.solvers"
        )
    return chosen


def points_and_cell(
    domain: Region,
    h: float | tuple[float, float] | None,
    ppc: int | tuple[int, int] | None,
    points: MaterialPoints | None,
    grid: Grid | None,
) -> tuple[MaterialPoints, tuple[float, float]]:
    """The points, seeded unless given, and the size (hx, hy) of a cell; arguments as for `discretise`.

    InvalidScene where one of them leaves another without effect.
    """
    hx, hy = _cell(h, grid)
    if points is not None and not isinstance(points, MaterialPoints):
        raise InvalidScene(f"points {points!r}: give `MaterialPoints`, as `seed` makes them")
    if points is not None:
        if ppc is not None:
            raise InvalidScene(f"{ppc} points per cell beside `points`: give one of the two")
        return points, (hx, hy)
    nx, ny = _per_cell(ppc)
    points = seed(domain, (hx / nx, hy / ny))
    # the lattice took the exact division of the sides; a grid of another pitch would drift through the points
    lower, upper = domain.bounds
    hx, hy = (upper - lower) * (nx, ny) / divisions("spacing", (lower, upper), (hx / nx, hy / ny))
    return points, (hx, hy)


def _cell(h: float | tuple[float, float] | None, grid: Grid | None) -> tuple[float, float]:
    """The size (hx, hy) of a cell, given as such or by a grid."""
    if (h is None) == (grid is None):
        raise InvalidScene("cells: give their size h or a `grid`, one of the two")
    if grid is not None and not isinstance(grid, Grid):
        raise InvalidScene(f"grid {grid!r}: give a `Grid(origin, h, cells)`, or the size h of its cells")
    size: Any = h if grid is None else grid.h
    if not (np.isfinite(number(size)) or numbers(size, 2)):
        raise InvalidScene(f"cells of size {size!r}: give finite, positive lengths, the spacing of the lines")
    hx, hy = (float(s) for s in np.broadcast_to(size, 2))
    return hx, hy


def _per_cell(ppc: int | tuple[int, int] | None) -> tuple[int, int]:
    given: Any = 2 if ppc is None else ppc
    nx, ny = np.broadcast_to(given, 2) if np.isfinite(number(given)) or numbers(given, 2) else (np.int64(0),) * 2
    if min(nx, ny) < 1 or not np.issubdtype(nx.dtype, np.integer):
        raise ValueError(f"{ppc!r} points per cell: give at least one in each direction, a whole number")
    return int(nx), int(ny)


def _cut(
    domain: Region,
    h: float | tuple[float, float] | None,
    ppc: int | tuple[int, int] | None,
    points: MaterialPoints | None,
    grid: Grid | None,
    shape_function: ShapeFunction,
) -> tuple[MaterialPoints, Grid]:
    """Points cut along the outline, and the grid whose cells they are pieces of; arguments as for `discretise`."""
    if points is not None:
        raise InvalidScene("`cut` seeds points of its own beside `points`: give one of the two")
    if shape_function is gimp:
        raise InvalidScene("`cut` is for functions without domains, and GIMP within a cell is the tent: take `tent`")
    grid = Grid.around(*domain.bounds, _cell(h, grid)) if grid is None else grid
    return cut_points(domain, grid, _per_cell(ppc)), grid


def check_loads(model: Model) -> None:
    """LoadOutsideBody if the body's loads do no work."""
    solid = np.ones(len(model.points.volume))
    check_work(model.force(solid)[model.stiffness.dof], model.forces.size)


def held_otherwise(models: Sequence[Model], body: Body) -> Model:
    """A model of a body that differs in loads and supports from those that there are: with the stiffness of the first
    that is held in the same degrees of freedom, or one of its own."""
    model = models[0]
    held = held_dofs(body.held, model.grid.node_positions(model.transfer.nodes), 1e-9 * min(model.grid.h))
    free = np.flatnonzero(~held)
    for alike in models:
        if np.array_equal(free, np.sort(alike.stiffness.dof)) and alike.ties.stated == stated_ties(body):
            return replace(alike, body=body)
    ties = tie(body, model.grid, model.points, model.transfer, model.shape_function, model.ends, model.D)
    K = stiffness(model.grid, model.points, model.transfer, model.D, held, model.ghost, ties)
    solver: Any = model.solver
    try:
        again = replace(solver, pattern=_pattern(model.grid, model.transfer, K))
    except TypeError as error:
        raise InvalidScene(
            f"load cases on other supports need a solver each ({error}): make {type(solver).__name__} a dataclass "
            "with a `pattern`"
        ) from error
    return replace(model, body=body, ties=ties, stiffness=K, solver=again)


def _pattern(grid: Grid, weighted: Transfer, K: Stiffness) -> Pattern:
    node, component = np.divmod(K.dof, 2)
    lines = np.stack(np.divmod(weighted.nodes[node], grid.nodes[1]), axis=-1)
    return Pattern(len(K.dof), K.row, K.col, Lattice(grid.h, lines, component))


def held_dofs(supports: tuple[Support, ...], position: Array, tol: float) -> Mask:
    """Which degrees of freedom (2a,) of the nodes at `position` (a, 2) the supports hold."""
    held = np.zeros((len(position), 2), dtype=bool)
    for support in supports:
        inside = support.region.contains(position, tol)
        if not np.any(inside):
            lower, upper = support.region.bounds
            raise UnsupportedBody(
                f"the support from {lower} to {upper} holds no node that a material point touches: "
                "move it onto the body"
            )
        held |= inside[:, None] & np.array(support.fixed)
    return held.ravel()


def prescribed(supports: tuple[Support, ...], position: Array, tol: float) -> Array:
    """Displacements (2a,) that supports prescribe at nodes at `position` (a, 2); InvalidScene where two disagree."""
    value = np.full((len(position), 2), np.nan)
    for support in supports:
        at = support.region.contains(position, tol)[:, None] & np.array(support.fixed)
        given = np.broadcast_to(support.displacement, value.shape)
        other = at & ~np.isnan(value) & (value != given)
        if np.any(other):
            x, y = position[np.any(other, axis=1)][0]
            raise InvalidScene(
                f"two supports displace the node at ({x:g}, {y:g}) differently: let their regions be apart"
            )
        value[at] = given[at]
    return np.nan_to_num(value).ravel()
