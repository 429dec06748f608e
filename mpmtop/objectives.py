"""Objectives: value and gradient with respect to the point moduli, both from one state of equilibrium."""

import numpy as np

from mpmtop.equilibrium import Equilibrium, Model
from mpmtop.scene import Array


def compliance(model: Model, state: Equilibrium) -> float:
    """J1 = f_ext . u (Eq. 8)."""
    return float(model.f_ext @ state.u)


def compliance_gradient(model: Model, state: Equilibrium) -> Array:
    """dJ1/dE_p = -V_p eps_p . D eps_p, (p,): Eq. (16) before the chain rule through SIMP.

    From L = f.u - lambda.(f_int(u) - f): dL/du = 0 gives K lambda = f, so lambda = u (self-adjoint, no further solve)
    and dJ1/dE_p = -u . dK/dE_p u, the negative of the strain energy's double at unit modulus.
    """
    return -model.points.volume * np.sum(state.strain @ model.D * state.strain, axis=1)
