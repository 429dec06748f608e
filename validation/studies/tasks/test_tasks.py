"""Other tasks

A part is seldom asked to be stiff under one force at a given volume. Here are four other things that a scene can say,
each short and each beside a number that comes from elsewhere: load cases, that is forces that act one at a time;
limits, such as a deflection, with the volume as the objective; a mechanism, whose output is to move; and designs that
are nearly black and white. Both solvers take all of it; the runs shown are by finite elements unless said otherwise,
every gradient is compared with complex steps in `tests/mpmtop/test_criteria.py`, and all designs are judged by the fine
reference.
"""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from mpmtop.body import Body, Material, Support
from mpmtop.criteria import Compliance, Criterion, Worst
from mpmtop.design import Design
from mpmtop.errors import NotConverged
from mpmtop.loads import PositionLoad
from mpmtop.optimizers import MMA, OptimalityCriteria, design_change, optimize, relative_change
from mpmtop.points import seed
from mpmtop.region import Rectangle
from mpmtop.scene import LoadCase, Scene
from reference_fem.simp import design_problem
from validation.bodies.sketch import CHOSEN, body_opening
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.studies.tasks.designs import RTOL, Designed, judged

ASKED = "Does the code do what a part asks for: several loads, limits, mechanisms, black and white?"

SIDE = 40.0
LOW, HIGH = PositionLoad((SIDE, 0.0), (0.0, -1.0)), PositionLoad((SIDE, SIDE), (0.0, 1.0))
PLATE = Body(
    Rectangle((0.0, 0.0), (SIDE, SIDE)), (Support(Rectangle((0.0, 0.0), (0.0, SIDE))),), (), Material(plane="stress")
)
BOTH = LoadCase((LOW,)), LoadCase((HIGH,))
SUM = Scene("two cases", PLATE, Design(0.4, 1.5), cases=BOTH)
THE_SUM, AT_ONCE = "the sum of both", "both at once"
HEAVIER = 1.5  # weight of the second case, where the worst of both is sought


def mirrored(rho: np.ndarray, x: np.ndarray) -> float:
    """Largest difference of densities from their image in the mid-line of the plate."""
    place = np.lexsort((x[:, 1], x[:, 0]))
    image = np.lexsort((SIDE - x[:, 1], x[:, 0]))
    return float(np.abs(rho[place] - rho[image]).max())


@pytest.mark.slow
def test_load_cases(report: Report, lock: Lock) -> None:
    """Two load cases, and both loads at once

    A square plate, clamped on the left; a force down at its lower right corner, or a force up at the upper one, never
    both. The sum of the two compliances is sought, by optimality criteria. With both forces in one scene the plate is
    pulled apart, and the right end needs no more than a bar that hangs on nothing else. The fine reference has the same
    forces at the corners themselves, whose energy grows as elements get finer: its numbers compare designs.
    """
    rows = {
        "size": (f"{SIDE:g} h x {SIDE:g} h", CHOSEN),
        "loads": ("F down at the lower right corner; F up at the upper one", CHOSEN),
        "volume fraction, filter radius": ("0.4; 1.5 h", CHOSEN),
        "material": ("nu = 0.3, plane stress", CHOSEN),
    }
    at_once = replace(PLATE, loads=(LOW, HIGH))
    body_opening(report, at_once, seed(PLATE.domain, (1.0, 1.0)), rows, note="Other sections have their own body.")
    found = {}
    for name, scene in {THE_SUM: SUM, AT_ONCE: replace(SUM, body=at_once, cases=())}.items():
        problem = design_problem(scene, 1.0)
        *_, last = optimize(problem, OptimalityCriteria(0.2), stop=design_change(0.01), max_iterations=60)
        found[name] = Designed(scene, problem, last)
    by_case = record_cases(report, found)
    best, stands = found[THE_SUM].last.objective, not np.isnan(by_case[AT_ONCE][0])
    asymmetry = mirrored(found[THE_SUM].rho, found[THE_SUM].x)
    holds = [
        report.check("sum of two cases", best, 66.83, rtol=RTOL, source="two problems of one case each, added by hand"),
        report.check(
            "largest difference of the sum's densities from their mirror image",
            asymmetry,
            at_most=1e-9,
            source="symmetry",
            why="neither case is more than the other; rounding of 60 iterations is 1e-12",
        ),
        report.check(
            "the plate designed for both forces at once, under one at a time",
            "stands" if stands else "hangs on void",
            "hangs on void",
            source="two opposite forces need no support",
        ),
    ]
    report.found(
        f"Two load cases: {best:.2f} for their sum, symmetric to {asymmetry:.0e}; the plate designed for both forces "
        f"at once {'stands' if stands else 'does not stand'} when they come one at a time."
    )
    lock({name: design.last.objective for name, design in found.items()}, rtol=RTOL)
    assert all(holds)


def record_cases(report: Report, found: dict[str, Designed]) -> dict[str, tuple[float, float, float]]:
    """Designs and table: the sum of both cases, and each of them by the fine reference; NaN where a design hangs on
    void, which both refuse."""
    each_case, one = replace(SUM, objective=Worst(Compliance())), found[THE_SUM].problem
    judge = found[THE_SUM].judge(each_case)
    by_case = {}
    for name, design in found.items():
        try:
            low, high = judged(judge, design.rho)
            by_case[name] = one.analyse(design.rho).objective, float(low), float(high)
        except NotConverged:
            by_case[name] = np.nan, np.nan, np.nan
        report.design(
            name.replace(" ", "_"),
            *(design.x, design.half_length, design.rho),
            body="Plate",
            method=f"elements, for {name}",
            measure="compliance [F²/E0]",
            own=design.last.objective,
            true=None if np.isnan(by_case[name][0]) else by_case[name][1] + by_case[name][2],
        )
    table = pd.DataFrame(
        [(design.last.objective, *by_case[name]) for name, design in found.items()],
        columns=["own objective", "sum of both cases", "lower case, fine reference", "upper case, fine reference"],
        index=pd.Index(found, name="designed for"),
    )
    report.table("load_cases", table, "Compliance [F²/E0]; blank where the body hangs on void, which is refused.")
    return by_case


@pytest.mark.slow
def test_worst_case(report: Report, lock: Lock) -> None:
    """The worst of two cases

    The same plate by elements of 2 h, the upper force counting 1.5 times. The larger of the two compliances is sought
    (MMA): a bound variable that both stay below. At the optimum both are as large as each other, or one would be
    stiffer than need be.
    """
    cases = BOTH[0], replace(BOTH[1], weight=HEAVIER)
    found = {}
    asked: dict[str, Criterion | Worst] = {"their sum": Compliance(), "the worst of them": Worst(Compliance())}
    for name, objective in asked.items():
        scene = replace(SUM, objective=objective, cases=cases)
        problem = design_problem(scene, 2.0)
        *_, last = optimize(problem, MMA(0.2), stop=relative_change(1e-6), max_iterations=200)
        found[name] = Designed(scene, problem, last)
    judge = found["the worst of them"].problem
    values = {name: judge.analyse(design.rho).objectives for name, design in found.items()}
    table = pd.DataFrame(
        [(*each, each.max()) for each in values.values()],
        columns=["lower case", f"upper case, {HEAVIER:g} times", "the larger"],
        index=pd.Index(found, name="designed for"),
    )
    report.table("worst_case", table, "Weighted compliance of each case [F²/E0].", 6)
    low, high = values["the worst of them"]
    holds = [
        report.check(
            "worst of two: one case over the other",
            float(low / high),
            1.0,
            rtol=1e-4,
            source="both are active",
            why="the run stops at changes of 1e-6",
        ),
        report.check(
            "larger case, designed for the sum over designed for the worst",
            float(table["the larger"].iloc[0] / table["the larger"].iloc[1]),
            at_least=1.0,
            source="a design for another problem is no better",
        ),
    ]
    gain = 1 - table["the larger"].iloc[1] / table["the larger"].iloc[0]
    report.found(f"Worst of two cases: both reach {high:.2f}, {gain:.1%} below the worst of the design for their sum.")
    lock({"worst": float(high), "sum": found["their sum"].last.objective}, rtol=RTOL)
    assert all(holds)
