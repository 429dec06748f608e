"""Ties: springs, and supports along the outline, which need not follow the grid's lines.

A spring of stiffness k at x_s along a unit vector d adds the energy k (d . u(x_s))^2 / 2, a bed int k (d . u)^2 / 2 ds.

An edge G held along d is tied by Nitsche's symmetric method. With the traction t = n . sigma(u) it adds

    int_G alpha E / 2 (d . u)^2 - (d . u) (d . t) ds

to the energy of the body, which the exact solution makes stationary whatever alpha is: it need not be so large that it
binds the nodes of a cut cell one by one. u is that of the functions at the edge, sigma and E are those of the nearest
material point p, so that K stays linear in the moduli, and so that a cut cell's functions, which the points may hardly
see, do not enter the traction. With L_p the length of the edge nearest to p and lambda the largest modulus of D,

    |t|^2 <= lambda E eps . E D eps,    alpha = BOUND lambda L_p / V_p,

the edge takes no more than 1 / BOUND of any point's energy: K stays positive definite, however the cells are cut.
Uniform stress is exact where the body's own quadrature is. Integrals as in `mpmtop.outline`.

Sources: Nitsche (1971), Abh. Math. Semin. Univ. Hambg. 36:9; Burman and Hansbo (2012), Appl. Numer. Math. 62:328.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from mpmtop.arrays import Array, Index
from mpmtop.body import Bed, Body, EdgeSupport, Spring
from mpmtop.errors import LoadOutsideBody, PositionOutsideBody, UnsupportedBody
from mpmtop.grid import Grid
from mpmtop.outline import Surface, surface
from mpmtop.points import MaterialPoints
from mpmtop.shape_functions import Ends, ShapeFunction
from mpmtop.transfer import Transfer, functions_at, functions_near

ASIDE = (1e-7, 0.7e-7)
"""Of a cell: the nearest point is sought from so far aside, so that rounding does not choose between two."""
BOUND = 2.0
"""Half of a point's energy is left to it. More binds the nodes of cut cells, and stiffens coarse grids."""


@dataclass(frozen=True, eq=False)
class Ties:
    """Rows over the nodal displacements (2a,): `spring` (s, 2a), times sqrt(k), those of beds at
    positions of the outline, too, times the root of their length; for q positions of edges, times the
    root of their length, `hold` (q, 2a), d . u, and `pull` (q, 2a), d . t at unit modulus. `penalty` (q,) is alpha, and
    `modulus` (q, p) takes each position's point. They are of the supports `stated`."""

    stated: tuple[EdgeSupport | Spring | Bed, ...]
    spring: sp.csr_array
    hold: sp.csr_array
    pull: sp.csr_array
    penalty: Array
    modulus: sp.csr_array

    def work(self, v: Array, u: Array) -> Array:
        """v . dK/dE_p u (p,) of the edges, for nodal displacements v and u (2a,)."""
        hold_v, hold_u = self.hold @ v, self.hold @ u
        return self.modulus.T @ (self.penalty * hold_v * hold_u - hold_v * (self.pull @ u) - (self.pull @ v) * hold_u)

    def force(self, moduli: Array, u: Array) -> Array:
        """K u (2a,) of the ties, with point moduli (p,): minus the force that they exert on the body."""
        E, held = self.modulus @ moduli, self.hold @ u
        by_hold = self.hold.T @ (E * (self.penalty * held - self.pull @ u))
        return self.spring.T @ (self.spring @ u) + by_hold - self.pull.T @ (E * held)


def stated_ties(body: Body) -> tuple[EdgeSupport | Spring | Bed, ...]:
    """The supports of a body that are ties."""
    return *body.edges, *body.springs, *body.beds


def tie(
    body: Body,
    grid: Grid,
    points: MaterialPoints,
    transfer: Transfer,
    shape_function: ShapeFunction,
    ends: tuple[Ends, Ends],
    D: Array,
) -> Ties:
    """Ties of a body, with tangent D (3, 3) or (p, 3, 3) at unit modulus.

    UnsupportedBody for an edge support or a bed without boundary, LoadOutsideBody for a spring where there is no
    material.
    """
    nodes, p = transfer.nodes, len(points.volume)
    if not stated_ties(body):
        none = sp.csr_array((0, 2 * len(nodes)))
        return Ties((), none, none, none, np.empty(0), sp.csr_array((0, p)))
    hold, pull = [sp.csr_array((0, 2 * len(nodes)))], [sp.csr_array((0, 2 * len(nodes)))]
    penalty, nearest = [np.empty(0)], [np.empty(0, np.intp)]
    for support in body.edges:
        on, N = _on_outline(body, support, grid, points, nodes, shape_function)
        # of points as near as each other the lower left one
        point = cKDTree(points.x).query(on.x - np.multiply(ASIDE, grid.h))[1]
        length = np.bincount(point, on.length, p)
        here = D if D.ndim == 2 else D[point]
        alpha = BOUND * (here[..., 0, 0] + here[..., 0, 1]) * (length / points.volume)[point]
        traction = _traction(on.normal, here, transfer.B, point)
        root = np.sqrt(on.length)[:, None]
        for d in support.directions(on.normal):
            hold.append(_along(root * d, *_components(N)))
            pull.append(_along(root * d, *traction))
            penalty.append(alpha)
            nearest.append(point)
    rows = [sp.csr_array((0, 2 * len(nodes)))]
    for spring in body.springs:
        try:
            functions = functions_at(grid, nodes, shape_function, ends, np.array([spring.position]))
        except PositionOutsideBody as error:
            raise LoadOutsideBody(f"a spring acts at {error}") from error
        along = _along(np.array([spring.direction]), *_components(functions.N))
        rows.append(sp.csr_array(np.sqrt(spring.stiffness) * along))
    for bed in body.beds:
        on, N = _on_outline(body, bed, grid, points, nodes, shape_function)
        root = np.sqrt(bed.stiffness * on.length)[:, None]
        rows += [_along(root * d, *_components(N)) for d in bed.directions(on.normal)]
    spring, hold_all, pull_all = (sp.csr_array(sp.vstack(part, format="csr")) for part in (rows, hold, pull))
    own = np.concatenate(nearest)
    modulus = sp.csr_array((np.ones(len(own)), own, np.arange(len(own) + 1)), shape=(len(own), p))
    return Ties(stated_ties(body), spring, hold_all, pull_all, np.concatenate(penalty), modulus)


def _on_outline(
    body: Body,
    support: EdgeSupport | Bed,
    grid: Grid,
    points: MaterialPoints,
    nodes: Index,
    shape_function: ShapeFunction,
) -> tuple[Surface, sp.csr_array]:
    """The outline in a support's region, and the functions N (k, a) there."""
    what = "an edge support" if isinstance(support, EdgeSupport) else "a bed"
    on = surface(body.domain, support.region, grid.lines)
    if len(on.x) == 0:
        lower, upper = support.region.bounds
        raise UnsupportedBody(f"no boundary of the domain lies in {what} from {lower} to {upper}: move it")
    try:
        return on, functions_near(grid, points, nodes, shape_function, on.x).functions.N
    except PositionOutsideBody as error:
        raise UnsupportedBody(f"{what} holds an edge at {error}") from error


def _components(N: sp.csr_array) -> tuple[sp.csr_array, sp.csr_array]:
    """Rows (k, 2a) of u_x and of u_y, of N (k, a)."""
    return sp.csr_array(sp.kron(N, [[1, 0]])), sp.csr_array(sp.kron(N, [[0, 1]]))


def _traction(normal: Array, D: Array, B: sp.csr_array, point: Index) -> tuple[sp.csr_array, sp.csr_array]:
    """Rows (k, 2a) of the traction n . sigma at unit modulus, along x and along y, under the strains of points (k,).

    The tangent D is (3, 3), or (k, 3, 3) of these points.
    """
    strain = [B[3 * point + v] for v in range(3)]

    def part(v: int, w: int) -> sp.csr_array:
        return D[v, w] * strain[w] if D.ndim == 2 else sp.csr_array(sp.diags_array(D[:, v, w]) @ strain[w])

    xx, yy, xy = (sum((part(v, w) for w in range(1, 3)), start=part(v, 0)) for v in range(3))
    x, y = (sp.diags_array(normal[:, k]) for k in (0, 1))
    return x @ xx + y @ xy, x @ xy + y @ yy


def _along(d: Array, x: sp.csr_array, y: sp.csr_array) -> sp.csr_array:
    """d . (x, y), rows (k, 2a), of vectors d (k, 2)."""
    return sp.csr_array(sp.diags_array(d[:, 0]) @ x + sp.diags_array(d[:, 1]) @ y)
