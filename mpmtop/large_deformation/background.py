"""Soft background: a stiffness on every cell of the fixed box, whether or not points are in it.

Its energy on the increment du of a step is (1/2) alpha E0 int |grad du|^2 over the box, with bilinear functions: small
enough to leave the answer alone, and it gives every node of the box a stiffness that no moving point switches on or
off. Without it the tangent is singular as soon as a cell at the body's boundary holds too few points, and
stabilisations that follow the cut cells make the objective jump whenever the cells change.

It does not couple the components. What the points do not touch in a step is eliminated before it, exactly.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from mpmtop.arrays import Array, Index, Mask
from mpmtop.grid import Grid

SYMMETRIC = {"SymmetricMode": True, "DiagPivotThresh": 0.0}
"""SuperLU, told that the diagonal serves as pivots, as it does of what is symmetric and positive definite."""


class Entries(NamedTuple):
    """Values (n,) at rows and columns of a matrix, each place at most once."""

    row: Index
    column: Index
    value: Array


@dataclass(frozen=True, eq=False)
class Component:
    """Stiffness K (k, k) of one component's unknowns, which among all of them are `unknown` (k,); and an `order` (k,)
    in which they are eliminated with little fill."""

    K: sp.csr_array
    unknown: Index
    order: Index

    @cached_property
    def entries(self) -> Entries:
        """Those of K."""
        return Entries(np.repeat(np.arange(self.K.shape[0]), np.diff(self.K.indptr)), self.K.indices, self.K.data)

    def condensed(self, active: Mask) -> Entries:
        """K_aa - K_ae K_ee^-1 K_ea, by unknowns of the component, on the `active` (k,), with all others free of force.

        With K = L U and the active ones last, what is eliminated leaves S = L_aa U_aa: no system is solved.
        """
        row, column, value = self.entries
        of_row, of_column = active[row], active[column]
        edge = np.zeros(len(active), bool)
        edge[row[of_row & ~of_column]] = True
        if not np.any(edge):
            return _part(self.entries, of_row & of_column)
        others = self.order[~active[self.order]]
        last = np.flatnonzero(edge)
        place = np.full(len(active), -1)
        place[np.append(others, last)] = np.arange(len(others) + len(last))
        i, j = place[row], place[column]
        both = (i >= 0) & (j >= 0)
        n = len(others) + len(last)
        K = sp.csc_array((value[both], (i[both], j[both])), shape=(n, n))
        lu = splu(K, permc_spec="NATURAL", options=SYMMETRIC)
        at = lu.perm_c[len(others) :]
        S = _dense(lu.L, at) @ _dense(lu.U, at)
        kept = of_row & of_column & ~(edge[row] & edge[column])
        inner = _part(self.entries, kept)
        return Entries(
            np.append(inner.row, np.repeat(last, len(last))),
            np.append(inner.column, np.tile(last, len(last))),
            np.append(inner.value, S.ravel()),
        )


def _part(of: Entries, which: Mask) -> Entries:
    return Entries(of.row[which], of.column[which], of.value[which])


def _dense(of: sp.csc_array, at: Index) -> Array:
    """Rows and columns `at` (n,) of a sparse matrix, (n, n)."""
    place = np.full(of.shape[0], -1)
    place[at] = np.arange(len(at))
    i, j = place[of.indices], np.repeat(place, np.diff(of.indptr))
    among = (i >= 0) & (j >= 0)
    found = np.zeros((len(at), len(at)))
    found[i[among], j[among]] = of.data[among]
    return found


@dataclass(frozen=True, eq=False)
class Background:
    """Stiffness on the m unknowns of the box: one component, or one that both share. Positive definite once something
    holds it."""

    components: tuple[Component, Component]

    def condensed(self, active: Mask) -> sp.csr_array:
        """Its stiffness (a, a) on the `active` (m,) unknowns, with all others free of force."""
        x, y = self.components
        of_x, of_y = active[x.unknown], active[y.unknown]
        first = x.condensed(of_x)
        second = first if y.K is x.K and np.array_equal(of_x, of_y) else y.condensed(of_y)
        place = np.cumsum(active) - 1
        row, column = (
            np.concatenate([place[x.unknown[of_first]], place[y.unknown[of_second]]])
            for of_first, of_second in ((first.row, second.row), (first.column, second.column))
        )
        m = np.count_nonzero(active)
        return sp.csr_array((np.concatenate([first.value, second.value]), (row, column)), shape=(m, m))


def background(grid: Grid, unknown: Index, sign: Array, size: float) -> Background:
    """Background of `size` alpha E0 on unknowns: degree of freedom d of the box is `sign[d]` times unknown[d], or held
    where that is -1; both (2 nodes,)."""
    hx, hy = grid.h
    along, mass = np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([[2.0, 1.0], [1.0, 2.0]]) / 6
    cell = size * (np.kron(along, mass) * hy / hx + np.kron(mass, along) * hx / hy)
    nx, ny = grid.nodes
    lower_left = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    nodes = lower_left[:, None] + np.array([0, 1, ny, ny + 1])
    row, column = np.broadcast_arrays(nodes[:, :, None], nodes[:, None, :])
    laplacian = sp.coo_array(
        (np.broadcast_to(cell, row.shape).ravel(), (row.ravel(), column.ravel())), shape=(nx * ny,) * 2
    )
    laplacian = sp.csr_array(laplacian)

    def component(c: int) -> Component:
        of = unknown[c::2]
        free = np.flatnonzero(of >= 0)
        mine, place = np.unique(of[free], return_inverse=True)
        T = sp.csr_array((sign[c::2][free], (free, place)), shape=(nx * ny, len(mine)))
        K = sp.csr_array(T.T @ laplacian @ T)
        order = np.argsort(
            splu(sp.csc_array(K + sp.eye_array(len(mine)) * size), permc_spec="MMD_AT_PLUS_A", options=SYMMETRIC).perm_c
        )
        return Component(K, mine, order)

    x, y = component(0), component(1)
    if x.K.shape == y.K.shape and (x.K != y.K).nnz == 0:
        y = Component(x.K, y.unknown, x.order)
    return Background((x, y))
