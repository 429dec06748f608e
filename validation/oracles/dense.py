"""The equations of a body written out in extended precision, apart from mpmtop's.

Shape functions, strain operator, tangent, load, clamp, objectives and gradients follow from closed forms, evaluated at
all nodes of the grid. Of the model only data is read: scene, grid, points, which shape function, and the ghost
penalty's operators, which are mpmtop's own. Where a long double is a double, so is all of this.

mpmtop's rule for kinks is taken over: what is no further from one than `tol`, 1e-12 of a cell or what forming the
position in cells can lose, lies on it, and along a grid line the gradient is that of the cell on its right.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from mpmtop.arrays import Array, Index, Mask
from mpmtop.body import Body, Material
from mpmtop.grid import Grid
from mpmtop.loads import Load, PointLoad, RegionLoad
from mpmtop.model import Model
from mpmtop.points import MaterialPoints

EXTENDED: Any = np.longdouble
ON = 1e-9
"""Part of a cell by which a node may miss the clamp, a point a region, and distances to a load may differ."""


class Quantities(NamedTuple):
    """Of an analysis: compliance (1,), p-norm (1,), their gradients by the logarithms of the moduli, (p,) each, and the
    displacements of the points (p, 2)."""

    compliance: Array
    p_norm: Array
    compliance_gradient: Array
    p_norm_gradient: Array
    displacement: Array


@dataclass(frozen=True, eq=False)
class Equations:
    """N (p, a) and B (3p, 2a) at the `nodes` (a,) that points touch, D (3, 3) or (p, 3, 3), f_ext (2a,), the `free`
    unknowns (m,) of 2a, volumes (p,), and the ghost penalty's `jump` (2f, a) and `modulus` (f, p)."""

    nodes: Index
    N: Array
    B: Array
    D: Array
    f_ext: Array
    free: Index
    volume: Array
    jump: Array
    modulus: Array


def equations_of(model: Model) -> Equations:
    """What the model should hold."""
    grid, points, body = model.grid, model.points, model.body
    nodes, N, B = operators(grid, points, model.shape_function.__name__)
    if model.transfer.b_bar is not None:
        B = mean_dilatation(B, grid, points)
    f_ext = nodal_force(body.loads, grid, points.x, points.volume, N)
    free = np.flatnonzero(~held(body, grid, nodes))
    jump, modulus = model.ghost.jump.toarray(), model.ghost.modulus.toarray()
    D = tangent(body.material)
    if body.parts:
        D = np.array([tangent(replace(body.material, poisson=nu)) for nu in of_points(body, points.x)[1]])
    return Equations(nodes, N, B, D, f_ext, free, points.volume, jump, modulus)


def held(body: Body, grid: Grid, nodes: Index) -> Mask:
    """Which of the unknowns (2a,) are: nodes in a support's region, in its components."""
    line = np.stack([nodes // (grid.cells[1] + 1), nodes % (grid.cells[1] + 1)], axis=1)
    x = np.array(grid.origin) + line * np.array(grid.h)
    by_support = [np.outer(s.region.contains(x, ON * min(grid.h)), s.fixed) for s in body.held]
    any_support: Mask = np.any(by_support, axis=0)
    return any_support.ravel()


def mean_dilatation(B: Array, grid: Grid, points: MaterialPoints) -> Array:
    """B (3p, 2a) with the dilatation of each cell's points at its mean by volume, the rest of the strain as it was."""
    xi = (points.x - grid.origin) / grid.h
    cell = np.floor(xi + kink_tolerance(grid, points)) @ [grid.cells[1] + 1, 1]
    share = (cell[:, None] == cell) * points.volume.astype(EXTENDED)
    strain = B.reshape(len(cell), 3, -1).copy()
    dilatation = strain[:, 0] + strain[:, 1]
    strain[:, :2] += ((share / share.sum(axis=1, keepdims=True) @ dilatation - dilatation) / 2)[:, None]
    return strain.reshape(B.shape)


def kink_tolerance(grid: Grid, points: MaterialPoints) -> float:
    """Part of a cell to which a position is on a line: what forming it in cells can lose, at least 1e-12."""
    largest = max(np.abs(points.x).max(), *np.abs(grid.origin))
    return max(1e-12, 8 * float(np.finfo(float).eps) * largest / min(grid.h))


@lru_cache(maxsize=2)
def operators(grid: Grid, points: MaterialPoints, function: str) -> tuple[Index, Array, Array]:
    """Nodes (a,) that some point touches, N (p, a) and B (3p, 2a); rows of B are xx, yy and engineering shear xy."""
    xi = (points.x - grid.origin) / grid.h
    tol = kink_tolerance(grid, points)
    axis = AXIS[function]
    (Nx, Gx), (Ny, Gy) = (
        axis(xi[:, k], points.half_length[:, k] / grid.h[k], tol, np.arange(grid.cells[k] + 1.0)) for k in (0, 1)
    )

    def product(a: Array, b: Array) -> Array:
        return (a[:, :, None] * b[:, None, :]).reshape(len(xi), -1)

    N, gx, gy = product(Nx, Ny), product(Gx / grid.h[0], Ny), product(Nx, Gy / grid.h[1])
    nodes = np.flatnonzero(np.any((N != 0) | (gx != 0) | (gy != 0), axis=0))
    N, gx, gy = N[:, nodes], gx[:, nodes], gy[:, nodes]
    B = np.zeros((len(xi), 3, len(nodes), 2), EXTENDED)
    B[:, 0, :, 0] = B[:, 2, :, 1] = gx
    B[:, 1, :, 1] = B[:, 2, :, 0] = gy
    return nodes, N, B.reshape(3 * len(xi), -1)


def on_lines(xi: Array, tol: float) -> Array:
    """Positions (p,) in cells, those within `tol` of a grid line on it."""
    line = np.floor(xi + tol)
    return np.where(xi - line <= tol, line, xi).astype(EXTENDED)


def tent(xi: Array, half: Array, tol: float, node: Array) -> tuple[Array, Array]:
    """max(0, 1 - |d|) at d = xi - node (p, n), and its slope from the right."""
    d = on_lines(xi, tol)[:, None] - node
    return np.maximum(0, 1 - np.abs(d)), np.where((d >= -1) & (d < 0), 1.0, np.where((d >= 0) & (d < 1), -1.0, 0.0))


def gimp(xi: Array, half: Array, tol: float, node: Array) -> tuple[Array, Array]:
    """The mean of the tent over [d - l, d + l], and the difference of its ends; the tent where no line cuts that."""
    reach = np.minimum(half, 0.5)[:, None]
    crosses = np.any(np.abs(xi[:, None] - node) < reach - tol, axis=1, keepdims=True)
    reach, d = reach.astype(EXTENDED), xi.astype(EXTENDED)[:, None] - node
    left = [np.clip(d + side * reach, -1, 0) for side in (-1, 1)]  # of the node the tent is 1 + t ...
    right = [np.clip(d + side * reach, 0, 1) for side in (-1, 1)]  # ... and right of it 1 - t
    # each part for itself: of a hair on one side nothing must be lost beside the other
    area = ((1 + left[1]) ** 2 - (1 + left[0]) ** 2) / 2 + ((1 - right[0]) ** 2 - (1 - right[1]) ** 2) / 2
    ends = np.maximum(0, 1 - np.abs(d + reach)) - np.maximum(0, 1 - np.abs(d - reach))
    within, slope = tent(xi, half, tol, node)
    return np.where(crosses, area / (2 * reach), within), np.where(crosses, ends / (2 * reach), slope)


def quadratic(xi: Array, half: Array, tol: float, node: Array) -> tuple[Array, Array]:
    """Quadratic B-spline: 3/4 - d^2 for |d| <= 1/2, (3/2 - |d|)^2 / 2 up to 3/2."""
    middle = np.floor(xi) + 0.5
    at = np.where(np.abs(xi - middle) <= tol, middle, xi).astype(EXTENDED)
    d = at[:, None] - node
    r = np.abs(d)
    N = np.where(r <= 0.5, 0.75 - d**2, np.maximum(0, 1.5 - r) ** 2 / 2)
    return closed(xi, tol, node, N, np.where(r <= 0.5, -2 * d, -np.sign(d) * np.maximum(0, 1.5 - r)))


def cubic(xi: Array, half: Array, tol: float, node: Array) -> tuple[Array, Array]:
    """Cubic B-spline: 2/3 - d^2 + |d|^3 / 2 for |d| <= 1, (2 - |d|)^3 / 6 up to 2."""
    d = on_lines(xi, tol)[:, None] - node
    r = np.abs(d)
    tail = np.maximum(0, 2 - r)
    N = np.where(r <= 1, EXTENDED(2) / 3 - d**2 + r**3 / 2, tail**3 / 6)
    return closed(xi, tol, node, N, np.sign(d) * np.where(r <= 1, 1.5 * d**2 - 2 * r, -(tail**2) / 2))


def closed(xi: Array, tol: float, node: Array, *weights: Array) -> tuple[Array, Array]:
    """Weights (p, n) with u_-1 = 2 u_0 - u_1 at both ends of the cells that hold a point: no node beyond takes part."""
    first, last = (int(np.floor(part + tol)) for part in (xi.min(), xi.max()))
    value, slope = (w.copy() for w in weights)
    for end, outwards in ((first, -1), (last + 1, 1)):
        for w in (value, slope):
            beyond = node == end + outwards
            ghost = w[:, beyond].sum(axis=1)  # none where the grid ends
            w[:, node == end] += 2 * ghost[:, None]
            w[:, node == end - outwards] -= ghost[:, None]
            w[:, beyond] = 0
    return value, slope


AXIS: dict[str, Callable[[Array, Array, float, Array], tuple[Array, Array]]] = {
    "tent": tent,
    "gimp": gimp,
    "bspline2": quadratic,
    "bspline3": cubic,
}
"""By the name of mpmtop's function."""


def lame(material: Material) -> tuple[Any, Any]:
    """lambda and mu at unit Young's modulus; in plane stress the lambda that keeps sigma_zz at zero."""
    nu = EXTENDED(material.poisson)
    lam, mu = nu / ((1 + nu) * (1 - 2 * nu)), 1 / (2 * (1 + nu))
    return (lam if material.plane == "strain" else 2 * lam * mu / (lam + 2 * mu)), mu


def of_points(body: Body, x: Array) -> tuple[Array, Array]:
    """Young's modulus and Poisson's ratio (p,) of solid points at x (p, 2): of the first part that holds them."""
    young, poisson = np.full(len(x), body.material.young), np.full(len(x), body.material.poisson)
    for part in reversed(body.parts):
        within = part.region.contains(x, ON)
        young[within], poisson[within] = part.material.young, part.material.poisson
    return young, poisson


def tangent(material: Material) -> Array:
    """D (3, 3): sigma = lambda tr(eps) 1 + 2 mu eps, of engineering shear."""
    lam, mu = lame(material)
    D: Array = np.diag([2 * mu, 2 * mu, mu])
    D[:2, :2] += lam
    return D


def nodal_force(loads: tuple[Load, ...], grid: Grid, x: Array, volume: Array, N: Array) -> Array:
    """f_i = sum_p N_ip f_p, (2a,): shares by volume of the points in the region, equal ones of those nearest to the
    load, where those at the last distance, if they are too many, divide what is left."""
    share = np.zeros((len(x), 2), EXTENDED)
    for load in loads:
        if isinstance(load, RegionLoad):
            part = volume.astype(EXTENDED) * load.region.contains(x, ON * min(grid.h))
            share += np.outer(part / part.sum(), load.force)
            continue
        assert isinstance(load, PointLoad)
        apart = np.round(np.sqrt(((x - load.position) ** 2).sum(axis=1)) / (ON * min(grid.h)))
        last = np.sort(apart)[load.points - 1]
        part = (apart < last) + (apart == last) * EXTENDED(load.points - (apart < last).sum()) / (apart == last).sum()
        share += part[:, None] / load.points * load.force
    return (N.T @ share).ravel()


def objectives(
    equations: Equations,
    u: Array,
    moduli: Array,
    rho: Array,
    solve: Callable[[Array], Array],
    material: Material,
    p: float,
    q: float,
) -> Quantities:
    """All that is judged, of displacements u (2a,); `solve` takes and gives free unknowns (m,).

    dC/dE_p = -V_p eps_p . D eps_p. J = (sum s_p^p)^(1/p), s_p = rho_p^q vm(E0 D eps_p): with K lambda = dJ/du,
    dJ/dE_p = -V_p eps_p(lambda) . D eps_p, zero if all that carries stress is void. The ghost penalty adds its energy.
    """
    strain = (equations.B @ u).reshape(-1, 3)
    xx, yy, xy = material.young * (strain @ equations.D).T
    nu = material.poisson if material.plane == "strain" else 0.0
    zz = nu * (xx + yy)
    vm = np.sqrt(xx**2 + yy**2 + zz**2 - xx * yy - yy * zz - zz * xx + 3 * xy**2)
    s = rho**q * vm
    largest = s.max() if s.max() > 0 else EXTENDED(1)
    J = largest * np.sum((s / largest) ** p) ** (1 / EXTENDED(p))
    # 2 vm dvm = (2 xx - yy - zz) dxx + (2 yy - xx - zz) dyy + (2 zz - xx - yy) dzz + 6 xy dxy, dzz = nu (dxx + dyy)
    by_zz = nu * (2 * zz - xx - yy)
    by_stress = np.stack([2 * xx - yy - zz + by_zz, 2 * yy - xx - zz + by_zz, 6 * xy], axis=1)
    weight = (s / (J if J > 0 else 1)) ** (p - 1) * rho**q / np.where(vm > 0, 2 * vm, 1)
    by_u = equations.B.T @ (material.young * (weight[:, None] * by_stress) @ equations.D).ravel()
    adjoint = np.zeros_like(u)
    adjoint[equations.free] = solve(by_u[equations.free])
    return Quantities(
        np.array([equations.f_ext @ u]),
        np.array([J]),
        moduli * by_moduli(equations, u, u),
        moduli * by_moduli(equations, adjoint, u),
        equations.N @ u.reshape(-1, 2),
    )


def by_moduli(equations: Equations, v: Array, u: Array) -> Array:
    """-v . dK/dE_p u, (p,)."""
    left, right = ((equations.B @ w).reshape(-1, 3) for w in (v, u))
    energy = -equations.volume * ((left @ equations.D) * right).sum(axis=1)
    if len(equations.modulus):
        jumps = (equations.jump @ v.reshape(-1, 2)) * (equations.jump @ u.reshape(-1, 2))
        energy -= equations.modulus.T @ jumps.reshape(-1, 4).sum(axis=1)
    return energy
