"""`mpmtop`'s material points behind the methods' protocol."""

import warnings
from dataclasses import dataclass, field
from typing import get_args

import numpy as np

import mpmtop
from mpmtop.arrays import Array
from mpmtop.diagnose import ModelWarning
from mpmtop.equilibrium import Equilibrium, adjoint, equilibrium, moduli_gradient
from mpmtop.grid import Grid
from mpmtop.model import Model, discretise
from mpmtop.objectives import COMPLIANCE
from mpmtop.shape_functions import ShapeFunction
from mpmtop.transfer import weights
from validation.methods.protocol import Answer, Capability, Case, Shape


@dataclass(frozen=True)
class PointMethod:
    """The material point method with one shape function."""

    name: str
    shape_function: ShapeFunction
    version: str = f"mpmtop {mpmtop.__version__}"
    capabilities: frozenset[Capability] = field(default=frozenset(get_args(Capability)) - {"load steps"})

    def analyse(self, case: Case) -> Answer:
        """At the points: u = N u, sigma = E D B u; see `Analyses`."""
        model, f, given, state = self._solved(case)
        u = state.u + given
        stress = model.stress(case.moduli, model.transfer.strain(u))
        return Answer(model.transfer.interpolate(u), stress, float(f @ u))

    def gradient(self, case: Case) -> Array:
        """-V eps . D eps (p,), self-adjoint; see `Analyses`."""
        model, _, _, state = self._solved(case)
        return moduli_gradient(model, state, adjoint(model, state, COMPLIANCE))

    def shape(self, x: Array, half_length: Array, grid: Grid) -> Shape:
        """Inside a body that the whole grid holds; see `HasShape`."""
        ends = (0, grid.cells[0]), (0, grid.cells[1])
        node, touched, N, grad_N = weights(grid, x, half_length, self.shape_function, ends)
        index = np.stack(np.divmod(np.where(touched, node, 0), grid.nodes[1]), axis=-1)
        return Shape(index, N, grad_N)

    def _solved(self, case: Case) -> tuple[Model, Array, Array, Equilibrium]:
        """Model, nodal forces f (2a,), nodal displacements g (2a,) that supports prescribe, zero elsewhere, and the
        state w of K w = f - K g: u = g + w."""
        with warnings.catch_warnings():  # cases move points off the clamp and over grid lines on purpose
            warnings.simplefilter("ignore", ModelWarning)
            model = discretise(case.body, points=case.points, grid=case.grid, shape_function=self.shape_function)
            carried = np.zeros_like(case.points.x) if case.forces is None else case.forces
            if case.body_force is not None:
                carried = carried + case.points.volume[:, None] * case.body_force
            f = model.f_ext + (model.transfer.N_matrix.T @ carried).ravel()
            given = case.displaced(case.grid.node_positions(model.transfer.nodes)).ravel()
            given[model.stiffness.dof] = 0
            lift = model.internal_force(model.stress(case.moduli, model.transfer.strain(given)))
            return model, f, given, equilibrium(model, case.moduli, f_ext=f - lift)
