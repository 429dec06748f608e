"""Load cases on a finite element model, and the criteria of a design in all of them.

Cases held in the same degrees of freedom have one stiffness: it is factorised once for all their load vectors.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mpmtop.arrays import Array
from mpmtop.body import Body
from mpmtop.criteria import AtMost, Compliance, Criterion, Volume, Worst
from mpmtop.errors import InvalidScene
from mpmtop.loads import check_work
from mpmtop.scene import LoadCase, case_bodies
from reference_fem.boundary import held_dofs, prescribed
from reference_fem.elasticity import FemModel, State, displacements, fem_model, inverse_stiffness, resistance
from reference_fem.factorise import Solve
from reference_fem.mesh import GEOMETRY_TOLERANCE, shortest_side
from reference_fem.objectives import Objective


def case_models(model: FemModel, cases: tuple[LoadCase, ...]) -> tuple[FemModel, ...]:
    """The model in each load case; itself if there are none.

    LoadOutsideBody if the loads of a case do no work, InvalidScene for a model that was given its load vector.
    """
    if not cases:
        return (model,)
    found: list[FemModel] = []
    for body in case_bodies(model.body, cases):
        found.append(_in_case([model, *found], body))
    return tuple(found)


def _in_case(models: Sequence[FemModel], body: Body) -> FemModel:
    model = models[0]
    if model.forces_of is None:
        raise InvalidScene("this model was given its load vector and knows no load cases: discretise the body")
    forces = model.forces_of(body)
    tol = GEOMETRY_TOLERANCE * shortest_side(model.basis.mesh)
    held = held_dofs(body, model.basis, tol)
    free = np.flatnonzero(~held)
    for alike in models:
        tied_alike = _tied(alike.body) == _tied(body)
        if np.array_equal(np.sort(alike.free), free) and tied_alike:
            u = prescribed(body.held, model.basis, tol) if body.is_displaced else None
            found = replace(alike, body=body, f_ext=forces.fixed, weight=forces.weight, prescribed=u)
            break
    else:
        new = fem_model(body, model.basis, forces.fixed, model.eliminate, kind=model.kind, weight=forces.weight)
        found = replace(new, forces_of=model.forces_of)
    check_work(found.force(np.ones(len(found.area)))[found.free], forces.size)
    return found


def _tied(body: Body) -> tuple[object, ...]:
    return body.edges, body.springs, body.beds


def states(models: tuple[FemModel, ...], moduli: Array, rho: Array) -> tuple[State, ...]:
    """Equilibrium in each case, under element moduli (e,) and the loads of densities rho (e,)."""
    inverses: dict[int, Solve] = {}
    found = []
    for model in models:
        if id(model.stiffness) not in inverses:
            inverses[id(model.stiffness)] = inverse_stiffness(model, moduli)
        inverse = inverses[id(model.stiffness)]
        found.append(State(moduli, displacements(model, moduli, inverse, model.force(rho)), inverse))
    return tuple(found)


class Part(NamedTuple):
    """factor J(state of a case)."""

    factor: float
    of: Objective
    case: int


class Sum(NamedTuple):
    """sum of its parts - bound, of one criterion."""

    criterion: Criterion
    parts: tuple[Part, ...]
    bound: float = 0.0

    def value(self, models: tuple[FemModel, ...], found: tuple[State, ...], rho: Array) -> float:
        """At densities rho (e,) and the states of all cases."""
        total = -self.bound
        for factor, of, case in self.parts:
            model, state = models[case], found[case]
            total += factor * of.value(model, rho, state.u)
            if model.prescribed is not None and isinstance(self.criterion, Compliance):
                # the work of prescribed displacements: minus twice the potential energy is left
                reaction = resistance(model, state.moduli, state.u) - model.force(rho)
                total -= factor * float(reaction @ model.prescribed)
        return total


def objective_sums(stated: Criterion | Worst, of: Objective, cases: tuple[LoadCase, ...]) -> tuple[Sum, ...]:
    """The weighted sum over the cases, or one for each of them of which the largest counts."""
    weighted = [(case.weight, k) for k, case in enumerate(cases) if case.weight > 0] or [(1.0, 0)]
    if isinstance(stated, Worst):
        return tuple(Sum(stated.criterion, (Part(weight, of, k),)) for weight, k in weighted)
    if isinstance(stated, Volume):
        weighted = [(1.0, 0)]
    return (Sum(stated, tuple(Part(weight, of, k) for weight, k in weighted)),)


def constraint_sums(
    stated: tuple[AtMost, ...], functional: Callable[[Criterion], Objective], cases: int
) -> tuple[Sum, ...]:
    """(J - bound) / scale, or its opposite, of each constraint in each case that it is held in."""
    found = []
    for each in stated:
        of = functional(each.criterion)
        held_in = [0] if isinstance(each.criterion, Volume) else range(cases) if each.case is None else [each.case]
        found += [Sum(each.criterion, (Part(each.factor, of, k),), each.factor * each.bound) for k in held_in]
    return tuple(found)
