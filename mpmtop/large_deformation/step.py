"""What a load step is made of: the state of the points at its start, and the operators of its weights."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array, Index, Mask
from mpmtop.large_deformation.assembly import Assembly, Stencils, stencils
from mpmtop.large_deformation.kinematics import Weights, stretched, weights
from mpmtop.large_deformation.model import Model


@dataclass(frozen=True, eq=False)
class State:
    """Positions x (p, 2), deformation gradients F (p, 2, 2), half-lengths (p, 2) and which were `clipped` (p, 2)."""

    x: Array
    F: Array
    half_length: Array
    clipped: Mask


@dataclass(frozen=True, eq=False)
class Operators:
    """The weights of a step, g (p, n, 2), and the assembly on the m unknowns in use."""

    weights: Weights
    g: Array
    stencils: Stencils
    assembly: Assembly

    @cached_property
    def G(self) -> sp.csr_array:
        """(2 p, nodes): row 2 p + k holds g_pi,k."""
        p, n, _ = self.g.shape
        column = np.repeat(self.weights.node[:, None], 2, axis=1).ravel()
        return self._rows(self.g.swapaxes(1, 2).ravel(), column, np.arange(0, 2 * p * n + 1, n))

    @cached_property
    def G_t(self) -> sp.csc_array:
        """(nodes, 2 p): the transpose of G."""
        return self.G.T

    @cached_property
    def N(self) -> sp.csr_array:
        """(p, nodes): N_pi."""
        p, n = self.weights.N.shape
        return self._rows(self.weights.N.ravel(), self.weights.node.ravel(), np.arange(0, p * n + 1, n))

    @cached_property
    def sizes_t(self) -> sp.csc_array:
        """(nodes, p): |g_pi|."""
        return self._rows(np.linalg.norm(self.g, axis=2).ravel(), self.N.indices, self.N.indptr).T

    def _rows(self, data: Array, column: Index, start: Index) -> sp.csr_array:
        return sp.csr_array((data, column, start), shape=(len(start) - 1, len(self.assembly.held) // 2))

    def nodal(self, q: Array) -> Array:
        """Vectors (nodes, 2) of the unknowns q (m,)."""
        return (self.assembly.from_unknowns @ q).reshape(-1, 2)

    def reduced(self, force: Array) -> Array:
        """Forces (m,) on the unknowns, of forces (nodes, 2)."""
        return self.assembly.to_unknowns @ force.ravel()

    def gradient(self, nodal: Array) -> Array:
        """sum_i u_i x g_i (p, 2, 2) of nodal vectors (nodes, 2)."""
        return (self.G @ nodal).reshape(-1, 2, 2).swapaxes(1, 2)

    def at_points(self, nodal: Array) -> Array:
        """sum_i N_i u_i (p, 2) of nodal vectors (nodes, 2)."""
        return self.N @ nodal

    def to_nodes(self, by_F: Array) -> Array:
        """sum_p by_F_p g_i (nodes, 2) of by_F (p, 2, 2): the transpose of `gradient`."""
        return self.G_t @ by_F.swapaxes(1, 2).reshape(-1, 2)


def start(model: Model, dtype: type = float) -> State:
    """The undeformed state."""
    points = model.points
    F = np.zeros((len(points.x), 2, 2), dtype) + np.eye(2)
    return moved(model, State(points.x.astype(dtype), F, points.half_length, np.zeros(points.x.shape, bool)), 0, F)


def moved(model: Model, state: State, by: Array | float, F: Array) -> State:
    """The state after its points moved `by` (p, 2) and have the deformation gradients F."""
    if model.domains == "fixed":
        return State(state.x + by, F, state.half_length, state.clipped)
    return State(state.x + by, F, *stretched(model.points.half_length, F, model.grid.h))


def operators(model: Model, state: State, *, second: bool = False) -> Operators:
    """Operators of the step that starts from `state`; with second derivatives of the weights where an adjoint asks."""
    total = model.frame == "total"
    x, length = (model.points.x, model.points.half_length) if total else (state.x, state.half_length)
    w = weights(model.grid, x, length, model.shape_function, second=second)
    g = w.grad_N if total else w.grad_N @ state.F
    used = stencils(w)
    touched = np.zeros(np.prod(model.grid.nodes), bool)
    touched[w.node[w.touched]] = True
    return Operators(w, g, used, model.assembly(used, touched))
