"""Scene: a body, what is sought in it and what for. What both solvers are given, and all that they share."""

from dataclasses import dataclass, field

import numpy as np

from mpmtop.body import Body
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.design import Design
from mpmtop.errors import InvalidScene, LoadOutsideBody
from mpmtop.loads import positions


@dataclass(frozen=True)
class Scene:
    """Minimise `objective` over the densities of a `design` in a `body` (Eq. 8)."""

    name: str
    body: Body
    design: Design
    objective: Compliance | PNormStress = field(default_factory=Compliance)

    def __post_init__(self) -> None:
        check_together(self.body, self.design, self.objective)


def check_together(body: Body, design: Design, objective: Compliance | PNormStress) -> None:
    """Raise InvalidScene or LoadOutsideBody where a body, a design and an objective, each fine for itself, do not
    make a problem."""
    if not isinstance(objective, Compliance | PNormStress):
        raise InvalidScene(f"objective {objective!r}: give Compliance() or PNormStress(p, q)")
    if isinstance(objective, PNormStress) and objective.q >= design.penal:
        raise InvalidScene(f"stress relaxation q {objective.q}: give one below the penalty {design.penal}")
    if not body.loads:
        raise InvalidScene("the body has no load, and nothing to minimise: add one")
    if design.passive_void is None:
        return
    tol = 1e-9 * float(np.max(np.subtract(*body.domain.bounds[::-1])))
    named = positions(body.loads)
    void = named[design.passive_void.contains(named, -tol)]
    if len(void):
        raise LoadOutsideBody(f"load at {tuple(void[0].tolist())} is in the passive void: move it onto material")
