"""`mpmtop`'s material points behind the methods' protocol."""

import warnings
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

import mpmtop
from mpmtop.arrays import Array
from mpmtop.diagnose import ModelWarning
from mpmtop.equilibrium import Equilibrium, adjoint, equilibrium, moduli_gradient
from mpmtop.grid import Grid
from mpmtop.large_deformation import law
from mpmtop.large_deformation.model import discretise as large_discretise
from mpmtop.large_deformation.steps import trajectory
from mpmtop.loads import Action
from mpmtop.model import Model, discretise
from mpmtop.objectives import COMPLIANCE
from mpmtop.shape_functions import ShapeFunction, bspline2, gimp, tent
from mpmtop.transfer import weights
from mpmtop.voigt import PAIRS
from validation.methods.protocol import Answer, Capability, Case, Shape, Step

ALL: frozenset[Capability] = frozenset(get_args(Capability)) - {"sheared domains"}


@dataclass(frozen=True, eq=False)
class Carried:
    """Forces (p, 2) on all points, in their order."""

    forces: Array

    def act(self, x: Array, volume: Array, tol: float) -> Action:
        """See `mpmtop.loads.Load`."""
        return Action(np.arange(len(x)), self.forces, np.empty((0, 2)), np.empty((0, 2)))


@dataclass(frozen=True)
class PointMethod:
    """The material point method with one shape function."""

    name: str
    shape_function: ShapeFunction
    version: str = f"mpmtop {mpmtop.__version__}"
    without: frozenset[Capability] = frozenset()

    @property
    def capabilities(self) -> frozenset[Capability]:
        """All but those it is `without`, and load steps by functions that have none."""
        able = ALL if self.shape_function in (tent, gimp, bspline2) else ALL - {"load steps"}
        return able - self.without

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

    def steps(self, case: Case, count: int) -> list[Step]:
        """Updated Lagrangian steps with Hencky's law, domains as they are, the usual background; see `Steps`."""
        body = replace(case.body, loads=(Carried(case.carried),))
        model = large_discretise(
            body, shape_function=self.shape_function, steps=count, points=case.points, grid=case.grid
        )
        found = []
        for state in trajectory(model, case.moduli).states[1:]:
            tau = law.kirchhoff(law.stress(model.law, state.F), state.F)  # at unit modulus
            cauchy = tau * (case.moduli / law.jacobian(state.F))[:, None, None]
            found.append(Step(state.x, np.stack([cauchy[:, i, j] for i, j in PAIRS[2]], axis=1)))
        return found

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
