"""Nodal forces of a body's loads: what points carry, what acts at positions, along the boundary, and by volume."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array
from mpmtop.errors import LoadOutsideBody, PositionOutsideBody
from mpmtop.grid import Grid
from mpmtop.loads import Along, Load, action
from mpmtop.outline import surface
from mpmtop.points import MaterialPoints
from mpmtop.region import Region
from mpmtop.shape_functions import Ends, ShapeFunction
from mpmtop.transfer import Functions, Transfer, functions_at, functions_near


class Forces(NamedTuple):
    """Nodal forces f(rho) = fixed + weight rho, (2a,), of densities rho (p,).

    `weight` (2a, p) is None where no load follows the density. `size` is the sum of the absolute values of all forces,
    at density one, before any cancel.
    """

    fixed: Array
    weight: sp.csr_array | None
    size: float

    def at(self, rho: Array) -> Array:
        """f (2a,) at densities rho (p,)."""
        return self.fixed if self.weight is None else self.fixed + self.weight @ rho


def external_force(
    loads: Iterable[Load],
    domain: Region,
    grid: Grid,
    points: MaterialPoints,
    shape_function: ShapeFunction,
    ends: tuple[Ends, Ends],
    operators: Transfer,
) -> Forces:
    """p2g of what points carry and of forces by volume, V_p N_ip b(x_p); by the functions there of what acts at
    positions; and int N_i t ds along the body's outline, see `outline.surface` and `transfer.functions_near`.

    LoadOutsideBody where there is no material.
    """
    tol = 1e-9 * min(grid.h)
    acts = action(loads, points.x, points.volume, tol)
    fixed = (operators.N_matrix[acts.points].T @ acts.carried).ravel()
    if len(acts.position) > 0:
        try:
            at = functions_at(grid, operators.nodes, shape_function, ends, acts.position)
        except PositionOutsideBody as error:
            raise LoadOutsideBody(f"a load acts at {error}") from error
        fixed += at.force(acts.force)
    size = float(np.abs(acts.places(points.x)[1]).sum())
    for piece in acts.along:
        functions, force = _along(piece, domain, grid, points, shape_function, operators)
        fixed += functions.force(force)
        size += float(np.abs(force).sum())
    weight = None
    for part in acts.throughout:
        force = points.volume[:, None] * part.at(points.x, tol)
        size += float(np.abs(force).sum())
        if part.follows_density:
            by_density = _by_point(operators.N_matrix, force)
            weight = by_density if weight is None else weight + by_density
        else:
            fixed += (operators.N_matrix.T @ force).ravel()
    return Forces(fixed, weight, size)


def _along(
    piece: Along,
    domain: Region,
    grid: Grid,
    points: MaterialPoints,
    shape_function: ShapeFunction,
    operators: Transfer,
) -> tuple[Functions, Array]:
    """Functions at positions (n,) of the outline, and the forces (n, 2) there."""
    on = surface(domain, piece.region, grid.lines)
    if len(on.x) == 0:
        lower, upper = piece.region.bounds
        raise LoadOutsideBody(
            f"no boundary of the domain lies in the region of a load from {lower} to {upper}: move the region onto it"
        )
    try:
        near = functions_near(grid, points, operators.nodes, shape_function, on.x)
    except PositionOutsideBody as error:
        raise LoadOutsideBody(f"a load acts at {error}") from error
    return near.functions, on.length[:, None] * piece.traction(on.x, on.normal)


def _by_point(N: sp.csr_array, force: Array) -> sp.csr_array:
    """Nodal forces (2a, p) by the density of each point: N_ip force_p, of N (p, a) and forces (p, 2) at density one."""
    a = N.shape[1]
    x, y = (sp.diags_array(force[:, k]) @ N for k in (0, 1))
    both = sp.hstack([x, y], format="csr")  # columns by component, then node
    order = np.arange(2 * a).reshape(2, a).T.ravel()
    return sp.csr_array(both[:, order].T)
