"""A small explicit material point code: tents on a fixed grid, lumped masses, viscous damping, small strain."""

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array
from mpmtop.material import tangent
from mpmtop.shape_functions import tent
from mpmtop.transfer import body_ends, transfer
from validation.codes.explicit import Motion
from validation.methods.protocol import Case


@dataclass
class Swing:
    """Operators of a case, and nodal displacement and velocity (2a,) at one time."""

    case: Case
    N: sp.csr_array
    B: sp.csr_array
    DV: Array
    mass: Array
    held: Array
    given: Array
    force: Array
    dt: float
    u: Array = field(init=False)
    v: Array = field(init=False)

    def __post_init__(self) -> None:
        self.u, self.v = np.zeros_like(self.force), np.zeros_like(self.force)


class Swinging:
    """Points of unit density; `damping` by mass and time."""

    name, version = "swinging MPM", "1"
    capabilities = frozenset(
        {
            "analysis",
            "quadrature at points",
            "points anywhere",
            "body forces",
            "moduli by point",
            "plane stress",
            "gradient",
        }
    )

    def __init__(self, damping: float = 0.1) -> None:
        self.damping = damping

    def begin(self, case: Case) -> Swing:
        operators = transfer(case.grid, case.points, tent, body_ends(case.grid, case.points))
        V, D = case.points.volume, tangent(case.body.material)
        mass = np.repeat(operators.N_matrix.T @ V, 2)
        position = case.grid.node_positions(operators.nodes)
        held = np.zeros(position.shape, bool)
        for support in case.body.supports:
            held |= np.outer(support.region.contains(position, 1e-9), support.fixed)
        force = (operators.N_matrix.T @ case.carried).ravel()
        DV = np.einsum("p,ij->pij", V * case.moduli, D)
        K = operators.B.T @ sp.block_diag(list(DV), format="csr") @ operators.B
        fastest = np.sqrt(np.max(np.abs(K).sum(axis=1) / mass))  # Gershgorin's bound of the frequency
        given = np.zeros_like(force)
        return Swing(case, operators.N_matrix, operators.B, DV, mass, held.ravel(), given, force, 1.6 / fastest)

    def advance(self, state: Swing, level: float, steps: int) -> Motion:
        keep = 1 - self.damping * state.dt
        for _ in range(steps):
            stress = np.einsum("pij,pj->pi", state.DV, (state.B @ state.u).reshape(-1, 3))
            state.v = keep * state.v + state.dt * (level * state.force - state.B.T @ stress.ravel()) / state.mass
            state.v[state.held] = 0
            state.u = state.u + state.dt * state.v
        strain = (state.B @ state.u).reshape(-1, 3)
        stress = np.einsum("pij,pj->pi", state.DV, strain)
        at_points = state.N @ state.u.reshape(-1, 2)
        kinetic, stored = float(state.mass @ state.v**2) / 2, float(np.sum(stress * strain)) / 2
        return Motion(at_points, stress / state.case.points.volume[:, None], kinetic, stored)

    def end(self, state: Swing) -> None:
        """Nothing is held open."""
