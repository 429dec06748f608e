"""Load cases: one body in several states. Cases on the same supports share one stiffness and its factorisation."""

import warnings
from dataclasses import replace

import numpy as np

from mpmtop.arrays import Array
from mpmtop.diagnose import NearMechanism, support_warning
from mpmtop.equilibrium import Equilibrium, equilibrium, tangent
from mpmtop.model import Model, check_loads, held_otherwise
from mpmtop.scene import LoadCase, case_bodies
from mpmtop.solvers import Solve


def case_models(model: Model, cases: tuple[LoadCase, ...]) -> tuple[Model, ...]:
    """The model in each load case, of one stiffness for all on the same supports; itself if there are none.

    LoadOutsideBody if the loads of a case do no work, UnsupportedBody if its supports hold no node. Warns of a
    NearMechanism under the loads of a case, which no model without them can weigh.
    """
    if not cases:
        return (model,)
    found: list[Model] = []
    for body in case_bodies(model.body, cases):
        found.append(held_otherwise((model, *found), body))
        check_loads(found[-1])
    return _weighed(tuple(found))


def _weighed(models: tuple[Model, ...]) -> tuple[Model, ...]:
    """The models with what their supports do under the loads of their cases among the findings, and warned of."""
    texts: dict[str, list[int]] = {}
    for case, model in enumerate(models):
        if not any(isinstance(finding, NearMechanism) for finding in model.findings):
            force = model.force(np.ones(len(model.points.volume)))
            loose = support_warning(model.grid, model.points, model.transfer, model.body.held, force)
            if loose is not None:
                texts.setdefault(str(loose), []).append(case)
    for text, of in texts.items():
        finding = NearMechanism(f"load case{'s' if len(of) > 1 else ''} {', '.join(map(str, of))}: {text}")
        warnings.warn(finding, stacklevel=2)
        models = tuple(
            replace(model, findings=(*model.findings, finding)) if case in of else model
            for case, model in enumerate(models)
        )
    return models


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
