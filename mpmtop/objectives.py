"""Objectives: the value of a state of equilibrium, and its derivatives by the densities and by the displacements.

What follows from these is not theirs: the state solves its adjoint, and the law gives dR/dE, see `equilibrium`.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from mpmtop.arrays import Array
from mpmtop.criteria import (
    Compliance,
    Criterion,
    Displacement,
    OwnCriterion,
    PNormStress,
    Response,
    StressMeasure,
    StressWeight,
    Volume,
    check_sensitivity,
    own_value,
)
from mpmtop.equilibrium import Derivative, Equilibrium
from mpmtop.material import by_material, von_mises, von_mises_form
from mpmtop.model import Model

STRESS_TOLERANCE = 1e-8
"""Of an iterative solver, for objectives of stress: keeps them to 1e-6 over ten iterations (20,000 points, p = 12)."""


ROUNDING = 1e-12
"""Of q p, where q = 1 / p was meant."""


class Objective(NamedTuple):
    """Value and derivatives of one criterion at a state and densities (p,).

    `of_state` says whether it depends on the state at all, `solves` whether an adjoint is solved for, `of_stress`
    whether stresses are computed; `tolerance` is what it asks of an iterative solver beside that one's own.
    """

    value: Callable[[Model, Equilibrium, Array], float]
    derivative: Callable[[Model, Equilibrium, Array], Derivative]
    of_state: bool = True
    solves: bool = True
    of_stress: bool = False
    tolerance: float = np.inf


def objective(stated: Criterion, model: Model, volume_share: Array) -> Objective:
    """What is stated, on a model; `volume_share` (p,) are the weights of densities in the volume."""
    match stated:
        case Compliance():
            return Objective(
                lambda model, state, rho: compliance(model, state),
                lambda model, state, rho: COMPLIANCE,
                solves=False,
            )
        case PNormStress(p, q, measure, weight):
            a = _point_weight(weight, model)
            value = partial(p_norm_stress, p=p, q=q, measure=measure, weight=a)
            derivative = partial(p_norm_stress_derivative, p=p, q=q, measure=measure, weight=a)
            return Objective(value, derivative, of_stress=True, tolerance=STRESS_TOLERANCE)
        case Volume():
            return Objective(
                lambda model, state, rho: float(volume_share @ rho),
                lambda model, state, rho: Derivative(volume_share),
                of_state=False,
                solves=False,
            )
        case Displacement():
            unit = model.forces_of((stated.unit_load,)).fixed
            return Objective(
                lambda model, state, rho: float(unit @ state.u), lambda model, state, rho: Derivative(u=unit)
            )
    return Objective(
        lambda model, state, rho: own_value(stated, response(model, state, rho)),
        partial(_own_derivative, stated),
        of_stress=True,
        tolerance=STRESS_TOLERANCE,
    )


def response(model: Model, state: Equilibrium, rho: Array) -> Response:
    """What a criterion of one's own sees, at the material points."""
    points = model.points
    displacement = model.transfer.interpolate(state.u)
    return Response(points.x, points.volume, rho, displacement, state.strain, _solid_stress(model, state))


def _own_derivative(stated: OwnCriterion, model: Model, state: Equilibrium, rho: Array) -> Derivative:
    """What a criterion's sensitivity is by densities and displacements: u_p = N u, eps_p = B_p u, sigma_p = E0 D eps_p.

    InvalidScene where a part of it has another shape than its field.
    """
    at = response(model, state, rho)
    by = stated.gradient(at)
    check_sensitivity(stated, by, at)
    by_u = np.zeros_like(state.u)
    if by.displacement is not None:
        by_u += (model.transfer.N_matrix.T @ by.displacement).ravel()
    if by.strain is not None:
        by_u += model.transfer.B.T @ np.ravel(by.strain)
    if by.stress is not None:
        by_strain = by_material(by.stress, model.D)
        by_u += model.transfer.B.T @ (np.reshape(model.elastic.young, (-1, 1)) * by_strain).ravel()
    return Derivative(by.rho, by_u if np.any(by_u) else None)


def compliance(model: Model, state: Equilibrium) -> float:
    """J1 = f_ext . u (Eq. 8), less r . g of reactions r to displacements g of supports: minus twice the potential.

    That is least for the stiffest body whatever moves it, and self-adjoint: dJ1/dE = -u . dK/dE u by the envelope.
    """
    work = float(state.f_ext @ state.u)
    if model.prescribed is None:
        return work
    reaction = model.resistance(state.moduli, state.u, state.strain) - state.f_ext
    return work - float(reaction @ model.prescribed)


COMPLIANCE = Derivative(work=1.0)
"""The derivative of the compliance: it is self-adjoint."""


def p_norm_stress(
    model: Model,
    state: Equilibrium,
    rho: Array,
    *,
    p: float,
    q: float,
    measure: StressMeasure = "von_mises",
    weight: Array | float = 1.0,
) -> float:
    """J2 = (sum_p a_p s_p^p)^(1/p), s_p = rho_p^q vm(E0 D eps_p) (Eq. 9), scaled by the largest s against overflow.

    a_p is the `weight` (p,), one as in the paper.
    """
    return _p_norm(rho**q * _solid_von_mises(model, state, measure)[1], p, weight)


def p_norm_stress_derivative(
    model: Model,
    state: Equilibrium,
    rho: Array,
    *,
    p: float,
    q: float,
    measure: StressMeasure = "von_mises",
    weight: Array | float = 1.0,
) -> Derivative:
    """dJ2/drho_p at fixed state and dJ2/du.

    w_p = dJ2/ds_p = a_p (s_p / J2)^(p-1), in [0, 1] for a_p = 1. At fixed state dJ2/drho_p = w_p q s_p / rho_p; at
    rho_p = 0 it is one-sided, see `_by_density`, and may be infinite. dJ2/du = sum_p w_p rho_p^q E0 B_p^T D
    dvm/dsigma_p. Without stress vm has no derivative; zero, one of its subgradients, is taken. (Eqs. 17 to 20 of the
    paper.)
    """
    stress, vm = _solid_von_mises(model, state, measure)
    s = rho**q * vm
    J = _p_norm(s, p, weight)
    explicit = _by_density(rho, vm, J, p, q, weight)
    if J == 0:
        return Derivative(explicit)
    w = weight * (s / J) ** (p - 1)
    by_stress = by_material(stress, von_mises_form(model.elastic, measure))  # vm dvm/dsigma
    direction = np.divide(by_stress, vm[:, None], out=np.zeros_like(by_stress), where=vm[:, None] > 0)
    by_strain = (w * rho**q * model.elastic.young)[:, None] * by_material(direction, model.D)
    return Derivative(explicit, model.transfer.B.T @ by_strain.ravel(), scale=J)


def _by_density(rho: Array, vm: Array, J: float, p: float, q: float, weight: Array | float) -> Array:
    """dJ2/drho_p (p,) at fixed vm, from above where rho_p = 0.

    J2 grows there by a_p (vm_p / J2)^(p-1) vm_p / p times rho^(q p): not at all for q p > 1 or without stress, linearly
    for q p = 1, and for less with an infinite slope. Where no other point has relaxed stress J2 is a_p^(1/p) rho^q
    vm_p.
    """
    s = rho**q * vm
    w = weight * (s / J) ** (p - 1) if J > 0 else np.zeros_like(s)
    slope = np.divide(q * w * s, rho, out=np.zeros_like(rho), where=rho > 0)
    power = q * p if J > 0 else q
    growing = (rho == 0) & (vm > 0)
    if q == 0 or power > 1 + ROUNDING or not np.any(growing):
        return slope
    if power < 1 - ROUNDING:
        slope[growing] = np.inf
    else:
        a, vm = np.broadcast_to(weight, rho.shape)[growing], vm[growing]
        with np.errstate(over="ignore"):  # infinite, then
            slope[growing] = q * vm * (a * (vm / J) ** (p - 1) if J > 0 else a ** (1 / p))
    return slope


def _solid_von_mises(model: Model, state: Equilibrium, measure: StressMeasure) -> tuple[Array, Array]:
    """Stress (p, 3) and von Mises stress (p,) of solid material under the strains of the state."""
    stress = _solid_stress(model, state)
    return stress, von_mises(stress, model.elastic, measure)


def _solid_stress(model: Model, state: Equilibrium) -> Array:
    """E0 D eps (p, 3)."""
    return np.reshape(model.elastic.young, (-1, 1)) * by_material(state.strain, model.D)


def _p_norm(s: Array, p: float, weight: Array | float) -> float:
    largest = float(np.max(s))
    return largest * float(np.sum(weight * (s / largest) ** p)) ** (1 / p) if largest > 0 else 0.0


def _point_weight(weight: StressWeight, model: Model) -> Array | float:
    volume = model.points.volume
    return 1.0 if weight == "count" else volume / volume.sum()
