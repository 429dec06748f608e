"""Objectives on a finite element model: value, and the derivatives by densities and by displacements.

What follows from these is the state's, see `adjoint` and `moduli_gradient` of `elasticity`.
"""

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array
from mpmtop.criteria import Compliance, PNormStress, StressMeasure
from reference_fem.elasticity import Derivative, FemModel, gauss_points, strain_operator, von_mises_factor
from reference_fem.mesh import ELEMENT_CENTRE

StressPosition = Literal["centre", "gauss"]
STRESS_POSITIONS: dict[str, Callable[[FemModel], Array]] = {
    "centre": lambda model: ELEMENT_CENTRE,
    "gauss": gauss_points,
}


class Objective(NamedTuple):
    """One objective on one model, as functions of densities rho (e,) and displacements u (N,)."""

    value: Callable[[Array, Array], float]
    derivative: Callable[[Array, Array], Derivative]


def objective(stated: Compliance | PNormStress, model: FemModel, stress_at: StressPosition) -> Objective:
    """What is stated, on a model; a p-norm takes stresses at `stress_at` of every element."""
    match stated:
        case Compliance():
            return compliance(model)
        case PNormStress(p, q, measure):
            return p_norm_stress(model, p, q, STRESS_POSITIONS[stress_at](model), measure)


def compliance(model: FemModel) -> Objective:
    """J = f . u, self-adjoint."""
    return Objective(value=lambda rho, u: float(model.force(rho) @ u), derivative=lambda rho, u: Derivative(work=1.0))


def p_norm_stress(
    model: FemModel, p: float, q: float, reference: Array, measure: StressMeasure = "von_mises"
) -> Objective:
    """J = (sum_eg s_eg^p / g)^(1/p), s = rho_e^q vm_eg (Eq. 9), at reference positions (2, g) of every element.

    vm is the von Mises stress of solid material, of modulus E0, under the strain there. At one position the sum is
    the paper's, with one element for each material point; the mean over several makes them comparable.

    dJ/ds_eg = (s_eg / J)^(p-1) / g. At fixed u dJ/drho_e = sum_g dJ/ds q s / rho, from above at rho = 0, see
    `_at_zero`. With vm = |t|, t = T u, dJ/du = T^T (dJ/ds rho^q t / |t|); without stress vm has no derivative, and
    zero, one of its subgradients, is taken.
    """
    positions = reference.shape[1]
    points = len(model.area) * positions
    factor = von_mises_factor(model.body.material, measure)
    T = sp.csr_matrix(sp.kron(sp.eye(points), factor) @ strain_operator(model, reference))

    def solid(u: Array) -> tuple[Array, Array]:
        """t (e, g, 3) and vm (e, g)."""
        t = (T @ u).reshape(-1, positions, 3)
        return t, np.sqrt(np.sum(t**2, axis=-1))

    def value(rho: Array, u: Array) -> float:
        return p_norm(rho[:, None] ** q * solid(u)[1], p, 1 / positions)

    def derivative(rho: Array, u: Array) -> Derivative:
        t, vm = solid(u)
        relax = rho[:, None] ** q
        s = relax * vm
        J = p_norm(s, p, 1 / positions)
        empty = rho == 0
        by_rho = np.zeros_like(rho)
        by_rho[empty] = _at_zero(vm[empty], J, p, q)
        if J == 0:
            return Derivative(by_rho)
        by_s = (s / J) ** (p - 1) / positions
        by_rho[~empty] = q * np.sum(by_s * s, axis=1)[~empty] / rho[~empty]
        by_t = np.divide(by_s * relax, vm, out=np.zeros_like(vm), where=vm > 0)[..., None] * t
        return Derivative(by_rho, T.T @ by_t.ravel())

    return Objective(value, derivative)


def _at_zero(vm: Array, J: float, p: float, q: float) -> Array:
    """Slope (e,) of J in the density of an element at zero, whose von Mises stresses are vm (e, g).

    J^p = (rest) + rho^(q p) mean(vm^p). For J > 0 it is 0 if q p > 1, J (M / J)^p / p with M = mean(vm^p)^(1/p) if
    q p = 1, and else infinite. J = 0 has no rest: J = rho^q M.
    """
    mean = vm.max(axis=1, initial=0.0)
    mean *= np.mean(np.divide(vm, mean[:, None], out=np.zeros_like(vm), where=vm > 0) ** p, axis=1) ** (1 / p)
    order = q if J == 0 else q * p
    if q == 0 or order > 1 + 1e-12:  # its rounding, where q is 1 / p
        return np.zeros_like(mean)
    if order < 1 - 1e-12:
        return np.where(mean > 0, np.inf, 0.0)
    with np.errstate(over="ignore"):  # infinite, then
        return mean if J == 0 else (mean / J) ** p * J / p


def p_norm(s: Array, p: float, weight: Array | float = 1.0) -> float:
    """(sum weight s^p)^(1/p) of s >= 0; scaled by the largest s, so that no power overflows and none that counts
    underflows."""
    largest = float(s.max())
    if largest == 0:
        return 0.0
    return largest * float(np.sum(weight * (s / largest) ** p)) ** (1 / p)
