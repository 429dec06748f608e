"""Load cases: one body in several states. Cases on the same supports share one stiffness and its factorisation."""

from mpmtop.arrays import Array
from mpmtop.equilibrium import Equilibrium, equilibrium, tangent
from mpmtop.model import Model, check_loads, held_otherwise
from mpmtop.scene import LoadCase, case_bodies
from mpmtop.solvers import Solve


def case_models(model: Model, cases: tuple[LoadCase, ...]) -> tuple[Model, ...]:
    """The model in each load case, of one stiffness for all on the same supports; itself if there are none.

    LoadOutsideBody if the loads of a case do no work, UnsupportedBody if its supports hold no node.
    """
    if not cases:
        return (model,)
    found: list[Model] = []
    for body in case_bodies(model.body, cases):
        found.append(held_otherwise((model, *found), body))
        check_loads(found[-1])
    return tuple(found)


def shared_with(models: tuple[Model, ...]) -> list[int]:
    """For each case the first one of the same stiffness: that one factors, the others only solve."""
    return [next(k for k, other in enumerate(models) if other.stiffness is model.stiffness) for model in models]


def states(models: tuple[Model, ...], moduli: Array, rho: Array, tol: float) -> tuple[Equilibrium, ...]:
    """Equilibrium of each case under Young's moduli (p,) and densities (p,), which some loads follow: a
    factorisation for each stiffness, a solve for each case."""
    factored: dict[int, Solve] = {}
    found = []
    for model, first in zip(models, shared_with(models), strict=True):
        if first not in factored and len(models) > 1:
            factored[first] = tangent(model, moduli, tol)
        found.append(equilibrium(model, moduli, f_ext=model.force(rho), tol=tol, factored=factored.get(first)))
    return tuple(found)
