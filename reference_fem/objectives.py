"""Objectives on a finite element model: value, and the derivatives by densities and by displacements.

What follows from these is the state's, see `adjoint` and `moduli_gradient` of `reference_fem.adjoint`.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np
import scipy.sparse as sp

from mpmtop.arrays import Array
from mpmtop.criteria import (
    Compliance,
    Criterion,
    Displacement,
    OwnCriterion,
    PNormStress,
    Response,
    StressMeasure,
    Volume,
    check_sensitivity,
    own_value,
)
from mpmtop.errors import InvalidScene
from reference_fem.adjoint import Derivative
from reference_fem.elasticity import (
    FemModel,
    gauss_points,
    strain_operator,
    von_mises_factor,
)
from reference_fem.mesh import ELEMENT_CENTRE
from reference_fem.response import displacement_operator, positions_in, solid_tangent

StressPosition = Literal["centre", "gauss"]
STRESS_POSITIONS: dict[str, Callable[[FemModel], Array]] = {
    "centre": lambda model: ELEMENT_CENTRE,
    "gauss": gauss_points,
}


class Objective(NamedTuple):
    """One criterion, as functions of the model in a load case, of densities rho (e,) and displacements u (N,)."""

    value: Callable[[FemModel, Array, Array], float]
    derivative: Callable[[FemModel, Array, Array], Derivative]


def objective(stated: Criterion, model: FemModel, stress_at: StressPosition, volume_share: Array) -> Objective:
    """What is stated, on a model; stresses and the fields of one's own criterion are at `stress_at` of every element.

    `volume_share` (e,) are the weights of densities in the volume. InvalidScene for a displacement in a model that was
    given its load vector.
    """
    match stated:
        case Compliance():
            return compliance()
        case PNormStress(p, q, measure, weight):
            area = None if weight == "count" else model.area / model.area.sum()
            return p_norm_stress(model, p, q, STRESS_POSITIONS[stress_at](model), measure, area)
        case Volume():
            return Objective(
                lambda model, rho, u: float(volume_share @ rho), lambda model, rho, u: Derivative(volume_share)
            )
        case Displacement():
            unit = unit_force(model, stated)
            return Objective(lambda model, rho, u: float(unit @ u), lambda model, rho, u: Derivative(u=unit))
    return own_criterion(model, stated, STRESS_POSITIONS[stress_at](model))


def unit_force(model: FemModel, stated: Displacement) -> Array:
    """Load vector (N,) whose work is the displacement."""
    if model.forces_of is None:
        raise InvalidScene("this model was given its load vector: a displacement needs a discretised body")
    return model.forces_of(replace(model.body, loads=(stated.unit_load,))).fixed


def compliance() -> Objective:
    """J = f . u, self-adjoint."""
    return Objective(
        value=lambda model, rho, u: float(model.force(rho) @ u),
        derivative=lambda model, rho, u: Derivative(work=1.0),
    )


def own_criterion(model: FemModel, stated: OwnCriterion, reference: Array) -> Objective:
    """A criterion of one's own, at reference positions (2, g) of every element, each with a g-th of its area.

    With u_eg = N u, eps_eg = B u and sigma_eg = C eps_eg of solid material: dj/du = N^T dj/du_eg + B^T (dj/deps +
    C dj/dsigma), and dj/drho_e is the sum over its positions.
    """
    g = reference.shape[1]
    x, volume = positions_in(model, reference), np.repeat(model.area / g, g)
    N, B = displacement_operator(model, reference), strain_operator(model, reference)
    C = solid_tangent(model.elastic)
    C = np.repeat(C, g, axis=0) if len(C) > 1 else C

    def through_C(rows: Array) -> Array:
        return np.matmul(rows[:, None], C)[:, 0] if len(C) > 1 else rows @ C[0]

    def response(rho: Array, u: Array) -> Response:
        strain = (B @ u).reshape(-1, 3)
        return Response(x, volume, np.repeat(rho, g), (N @ u).reshape(-1, 2), strain, through_C(strain))

    def derivative(model: FemModel, rho: Array, u: Array) -> Derivative:
        at = response(rho, u)
        by = stated.gradient(at)
        check_sensitivity(stated, by, at)
        by_u = np.zeros_like(u)
        by_strain = np.zeros_like(at.strain)
        if by.strain is not None:
            by_strain += by.strain
        if by.stress is not None:
            by_strain += through_C(np.asarray(by.stress))
        by_u += B.T @ by_strain.ravel()
        if by.displacement is not None:
            by_u += N.T @ np.ravel(by.displacement)
        by_rho = None if by.rho is None else np.reshape(by.rho, (-1, g)).sum(axis=1)
        return Derivative(by_rho, by_u if np.any(by_u) else None)

    return Objective(lambda model, rho, u: own_value(stated, response(rho, u)), derivative)


def p_norm_stress(
    model: FemModel,
    p: float,
    q: float,
    reference: Array,
    measure: StressMeasure = "von_mises",
    weight: Array | None = None,
) -> Objective:
    """J = (sum_eg a_e s_eg^p / g)^(1/p), s = rho_e^q vm_eg (Eq. 9), at reference positions (2, g) of every element.

    a_e is the `weight` (e,), one unless given.

    vm is the von Mises stress of solid material, of modulus E0, under the strain there. At one position the sum is
    the paper's, with one element for each material point; the mean over several makes them comparable.

    dJ/ds_eg = a_e (s_eg / J)^(p-1) / g. At fixed u dJ/drho_e = sum_g dJ/ds q s / rho, from above at rho = 0, see
    `_at_zero`. With vm = |t|, t = T u, dJ/du = T^T (dJ/ds rho^q t / |t|); without stress vm has no derivative, and
    zero, one of its subgradients, is taken.
    """
    positions = reference.shape[1]
    points = len(model.area) * positions
    factor = von_mises_factor(model.elastic, measure)
    each = np.repeat(factor, points // len(factor), axis=0)  # positions of an element follow one another
    M = sp.bsr_matrix((each, np.arange(points), np.arange(points + 1)))
    T = sp.csr_matrix(M @ strain_operator(model, reference))

    def solid(u: Array) -> tuple[Array, Array]:
        """t (e, g, 3) and vm (e, g)."""
        t = (T @ u).reshape(-1, positions, 3)
        return t, np.sqrt(np.sum(t**2, axis=-1))

    share = 1 / positions if weight is None else weight[:, None] / positions

    def value(model: FemModel, rho: Array, u: Array) -> float:
        return p_norm(rho[:, None] ** q * solid(u)[1], p, share)

    def derivative(model: FemModel, rho: Array, u: Array) -> Derivative:
        t, vm = solid(u)
        relax = rho[:, None] ** q
        s = relax * vm
        J = p_norm(s, p, share)
        empty = rho == 0
        by_rho = np.zeros_like(rho)
        by_rho[empty] = _at_zero(vm[empty], J, p, q, 1.0 if weight is None else weight[empty])
        if J == 0:
            return Derivative(by_rho)
        by_s = (s / J) ** (p - 1) * share if weight is not None else (s / J) ** (p - 1) / positions
        by_rho[~empty] = q * np.sum(by_s * s, axis=1)[~empty] / rho[~empty]
        by_t = np.divide(by_s * relax, vm, out=np.zeros_like(vm), where=vm > 0)[..., None] * t
        return Derivative(by_rho, T.T @ by_t.ravel())

    return Objective(value, derivative)


def _at_zero(vm: Array, J: float, p: float, q: float, weight: Array | float) -> Array:
    """Slope (e,) of J in the density of an element at zero, whose von Mises stresses are vm (e, g).

    J^p = (rest) + a rho^(q p) mean(vm^p). For J > 0 it is 0 if q p > 1, a J (M / J)^p / p with M = mean(vm^p)^(1/p) if
    q p = 1, and else infinite. J = 0 has no rest: J = a^(1/p) rho^q M.
    """
    mean = vm.max(axis=1, initial=0.0)
    mean *= np.mean(np.divide(vm, mean[:, None], out=np.zeros_like(vm), where=vm > 0) ** p, axis=1) ** (1 / p)
    order = q if J == 0 else q * p
    if q == 0 or order > 1 + 1e-12:  # its rounding, where q is 1 / p
        return np.zeros_like(mean)
    if order < 1 - 1e-12:
        return np.where(mean > 0, np.inf, 0.0)
    with np.errstate(over="ignore"):  # infinite, then
        return weight ** (1 / p) * mean if J == 0 else weight * (mean / J) ** p * J / p


def p_norm(s: Array, p: float, weight: Array | float = 1.0) -> float:
    """(sum weight s^p)^(1/p) of s >= 0; scaled by the largest s, so that no power overflows and none that counts
    underflows."""
    largest = float(s.max())
    if largest == 0:
        return 0.0
    return largest * float(np.sum(weight * (s / largest) ** p)) ** (1 / p)
