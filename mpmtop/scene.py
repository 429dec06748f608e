"""Scene: a body, what is sought in it and what for. What both solvers are given, and all that they share."""

from dataclasses import dataclass, field, replace

import numpy as np

from mpmtop.arrays import number
from mpmtop.body import Bed, Body, EdgeSupport, Spring, Support
from mpmtop.criteria import AtMost, Compliance, Criterion, PNormStress, Volume, Worst, check_criterion
from mpmtop.design import Design
from mpmtop.errors import InvalidScene, LoadOutsideBody
from mpmtop.loads import Load, positions


@dataclass(frozen=True)
class LoadCase:
    """One of the states that a design is judged in: loads beside those of the body, which act in every case.

    Supports, if given, stand in place of the body's. The `weight` is that of the case in the objective, see `Scene`.
    """

    loads: tuple[Load, ...]
    weight: float = 1.0
    supports: tuple[Support | EdgeSupport | Spring | Bed, ...] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.loads, tuple):
            raise InvalidScene("loads of a case: give a tuple, with a comma after a single one")
        if not 0 <= number(self.weight) < np.inf:
            raise InvalidScene(f"weight {self.weight} of a load case: give a finite number of at least 0")


@dataclass(frozen=True)
class Scene:
    """Minimise `objective` over the densities of a `design` in a `body` (Eq. 8).

    With load `cases` the objective is the sum of the cases' values, each times its weight, or the `Worst` of them.
    `constraints` stand beside that of the design's volume fraction; a fraction of 1 is then no constraint.
    """

    name: str
    body: Body
    design: Design
    objective: Criterion | Worst = field(default_factory=Compliance)
    constraints: tuple[AtMost, ...] = ()
    cases: tuple[LoadCase, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise InvalidScene(f"name {self.name!r} of a scene: give a text")
        check_together(self.body, self.design, self.objective, self.constraints, self.cases)


def case_bodies(body: Body, cases: tuple[LoadCase, ...]) -> tuple[Body, ...]:
    """The body in each load case; itself if there are none."""
    return tuple(
        replace(
            body, loads=(*body.loads, *case.loads), supports=body.supports if case.supports is None else case.supports
        )
        for case in cases
    ) or (body,)


def check_together(
    body: Body,
    design: Design,
    objective: Criterion | Worst,
    constraints: tuple[AtMost, ...] = (),
    cases: tuple[LoadCase, ...] = (),
) -> None:
    """Raise InvalidScene or LoadOutsideBody where a body, a design and criteria, each fine for itself, do not make a
    problem."""
    for what, given, wanted in (("body", body, Body), ("design", design, Design)):
        if not isinstance(given, wanted):
            raise InvalidScene(f"{what} {given!r} of a scene: give a `{wanted.__name__}`")
    for name, parts, kind in (("constraints", constraints, AtMost), ("cases", cases, LoadCase)):
        if not isinstance(parts, tuple) or not all(isinstance(part, kind) for part in parts):
            what = "AtMost(criterion, bound) or AtLeast" if kind is AtMost else "LoadCase(loads)"
            raise InvalidScene(f"{name} of a scene: give a tuple of {what}, with a comma after a single one")
    if not isinstance(objective, Worst):
        check_criterion("objective", objective)
    sought = objective.criterion if isinstance(objective, Worst) else objective
    for criterion in (sought, *(constraint.criterion for constraint in constraints)):
        if isinstance(criterion, PNormStress) and criterion.q >= design.penal:
            raise InvalidScene(f"stress relaxation q {criterion.q}: give one below the penalty {design.penal}")
    if isinstance(sought, Volume) and not constraints:
        raise InvalidScene(
            "least volume under no constraint is none at all: add one, such as AtMost(Compliance(), 100)"
        )
    _check_cases(objective, constraints, cases)
    for each in case_bodies(body, cases):
        _check_loads(each, design)


def _check_cases(objective: Criterion | Worst, constraints: tuple[AtMost, ...], cases: tuple[LoadCase, ...]) -> None:
    if isinstance(objective, Worst) and (len(cases) < 2 or isinstance(objective.criterion, Volume)):
        raise InvalidScene("Worst is the largest of several load cases' values: give `cases`, or leave it out")
    if cases and not any(case.weight > 0 for case in cases):
        raise InvalidScene("no load case has a weight: give one of them a positive one")
    for constraint in constraints:
        if constraint.case is not None and constraint.case >= max(len(cases), 1):
            raise InvalidScene(
                f"a constraint on load case {constraint.case} of {max(len(cases), 1)}: they count from 0"
            )


def _check_loads(body: Body, design: Design) -> None:
    if not body.loads and not body.is_displaced:
        raise InvalidScene("the body has no load and no displaced support, and nothing to minimise: add one")
    if design.passive_void is None:
        return
    tol = 1e-9 * float(np.max(np.subtract(*body.domain.bounds[::-1])))
    named = positions(body.loads)
    void = named[design.passive_void.contains(named, -tol)]
    if len(void):
        raise LoadOutsideBody(f"load at {tuple(void[0].tolist())} is in the passive void: move it onto material")
