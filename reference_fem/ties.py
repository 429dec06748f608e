"""Springs, and edges held by Nitsche's method, on a finite element mesh; the equations are those of `EdgeSupport`.

An edge G held along d adds int_G alpha E / 2 (d . u)^2 - (d . u) (d . t) ds, with the traction t = n . sigma and the
modulus E at the nearest Gauss point g, and alpha = 2 lambda L_g / w_g: L_g is the length of the edge nearest to it, w_g
its weight, and lambda bounds |t|^2 by the energy.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree
from skfem import CellBasis
from skfem.helpers import sym_grad

from mpmtop.arrays import Array, Index
from mpmtop.body import Bed, Body, EdgeSupport
from mpmtop.errors import UnsupportedBody
from mpmtop.outline import Surface
from reference_fem.mesh import shortest_side
from reference_fem.outline import AtOutline, MeshKind, at_outline, outline

ASIDE = np.array([1e-7, 0.7e-7])  # of a side: from where the nearest Gauss point is sought, so that none is as near


class Ties(NamedTuple):
    """Rows (s, N) of springs, and of beds at positions of the outline, times the root of their stiffness; of edges
    (q, N), times the root of their length: d . u and d . t at unit modulus; alpha (q,), and the element (q,) whose
    modulus each has."""

    spring: sp.csr_matrix
    hold: sp.csr_matrix
    pull: sp.csr_matrix
    alpha: Array
    element: Index

    def unit_work(self, v: Array, u: Array, elements: int) -> Array:
        """v . dK/dE_e u (e,) of the edges."""
        a, b = self.hold @ v, self.hold @ u
        work = self.alpha * a * b - a * (self.pull @ u) - (self.pull @ v) * b
        return np.bincount(self.element, work, elements).astype(float)

    def force(self, young: Array, u: Array) -> Array:
        """K u (N,) of springs and edges, for element moduli (e,)."""
        E, held = young[self.element], self.hold @ u
        by_hold = self.hold.T @ (E * (self.alpha * held - self.pull @ u))
        return self.spring.T @ (self.spring @ u) + by_hold - self.pull.T @ (E * held)

    def matrices(self) -> tuple[Index, Array, Index, Index, Array]:
        """Entries of K: dofs (q, k) of edges, -1 beyond their number, matrices (q, k, k) at unit modulus and the
        element of each; dofs (s, k) and matrices (s, k, k) of springs."""
        dofs, (hold, pull) = _by_row(abs(self.hold) + abs(self.pull), self.hold, self.pull)
        crossed = hold[:, :, None] * pull[:, None, :]
        local = self.alpha[:, None, None] * hold[:, :, None] * hold[:, None, :] - crossed - crossed.transpose(0, 2, 1)
        at, (spring,) = _by_row(self.spring, self.spring)
        return dofs, local, self.element, at, spring[:, :, None] * spring[:, None, :]


def tie(body: Body, basis: CellBasis, kind: MeshKind, lam: float | Array, mu: float | Array) -> Ties:
    """Ties of a body with Lame's parameters at unit modulus, numbers or (e,). UnsupportedBody for an edge support
    or a bed without boundary."""
    N = basis.N
    hold, pull = [sp.csr_matrix((0, N))], [sp.csr_matrix((0, N))]
    alpha, element = [np.empty(0)], [np.empty(0, np.intp)]
    for support in body.edges:
        on = _held_outline(body, support, "an edge support", basis, kind)
        at = at_outline(basis, on.x, kind)
        traction, penalty, owner = _traction(basis, on, lam, mu)
        for d in support.directions(on.normal):
            weight = _each_along(np.sqrt(on.length)[:, None] * d)
            hold.append(weight @ at.N)
            pull.append(weight @ traction)
            alpha.append(penalty)
            element.append(owner)
    springs = [sp.csr_matrix((0, N))]
    for spring in body.springs:
        here: AtOutline = at_outline(basis, np.array([spring.position]), kind)
        springs.append(np.sqrt(spring.stiffness) * (sp.csr_matrix([spring.direction]) @ here.N))
    for bed in body.beds:
        on = _held_outline(body, bed, "a bed", basis, kind)
        N_on, root = at_outline(basis, on.x, kind).N, np.sqrt(bed.stiffness * on.length)[:, None]
        springs += [_each_along(root * d) @ N_on for d in bed.directions(on.normal)]
    spring_rows, hold_rows, pull_rows = (sp.vstack(part, format="csr") for part in (springs, hold, pull))
    return Ties(spring_rows, hold_rows, pull_rows, np.concatenate(alpha), np.concatenate(element))


def _held_outline(body: Body, support: EdgeSupport | Bed, what: str, basis: CellBasis, kind: MeshKind) -> Surface:
    on = outline(body.domain, support.region, basis.mesh, kind)
    if len(on.x) == 0:
        lower, upper = support.region.bounds
        raise UnsupportedBody(f"no boundary of the domain lies in {what} from {lower} to {upper}: move it")
    return on


def _each_along(d: Array) -> sp.csr_matrix:
    """Rows (k, 2k) that take d_k . u_k of displacements at k positions, for vectors d (k, 2)."""
    return sp.csr_matrix((d.ravel(), np.arange(d.size), 2 * np.arange(len(d) + 1)))


def _traction(
    basis: CellBasis, on: Surface, lam: float | Array, mu: float | Array
) -> tuple[sp.csr_matrix, Array, Index]:
    """Rows (2k, N) of t at the Gauss points nearest to an edge, at unit modulus, alpha (k,) and their elements (k,)."""
    gauss = CellBasis(basis.mesh, basis.elem, intorder=basis.elem.maxdeg, dofs=basis.dofs)
    e, q = gauss.dx.shape
    x = np.asarray(gauss.global_coordinates()).reshape(2, -1).T
    nearest = cKDTree(x).query(on.x - ASIDE * shortest_side(basis.mesh))[1]
    length = np.bincount(nearest, on.length, e * q)
    element, point = np.divmod(nearest, q)
    lam, mu = (np.broadcast_to(constant, e)[element] for constant in (lam, mu))
    alpha = 2 * 2 * (lam + mu) * (length / gauss.dx.ravel())[nearest]
    values = np.zeros((len(nearest), 2, gauss.Nbfun))
    for i, function in enumerate(gauss.basis):
        strain = np.asarray(sym_grad(function[0]))[:, :, element, point]  # (2, 2, k)
        stress = 2 * mu * strain + lam * (strain[0, 0] + strain[1, 1]) * np.eye(2)[:, :, None]
        values[:, :, i] = np.einsum("ijk,kj->ki", stress, on.normal)
    column = np.broadcast_to(gauss.element_dofs[:, element].T[:, None], values.shape)
    indptr = gauss.Nbfun * np.arange(2 * len(nearest) + 1)
    return sp.csr_matrix((values.ravel(), column.ravel(), indptr), shape=(2 * len(nearest), basis.N)), alpha, element


def _by_row(pattern: sp.csr_matrix, *matrices: sp.csr_matrix) -> tuple[Index, list[Array]]:
    """Columns (r, k) of a pattern's rows, -1 beyond their number, and the matrices' entries (r, k) there."""
    rows = pattern.shape[0]
    count = np.diff(pattern.indptr)
    row = np.repeat(np.arange(rows), count)
    place = row, np.arange(pattern.nnz) - np.repeat(pattern.indptr[:-1], count)
    column = np.full((rows, count.max(initial=0)), -1)
    column[place] = pattern.indices
    found = []
    for matrix in matrices:
        entries = np.zeros(column.shape)
        if len(row):
            entries[place] = np.asarray(matrix[row, pattern.indices]).ravel()
        found.append(entries)
    return column, found
