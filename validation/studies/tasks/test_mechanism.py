"""A compliant mechanism."""

import warnings

import numpy as np
import pandas as pd
import pytest

from mpmtop.body import Body, Material, Spring, Support
from mpmtop.criteria import Displacement, NothingMoves
from mpmtop.design import Design
from mpmtop.loads import PositionLoad
from mpmtop.optimizers import GCMMA, MMA, Iterate, UpdateRule, design_change, optimize
from mpmtop.region import Rectangle
from mpmtop.scene import Scene
from reference_fem.simp import DesignProblem, Evaluation, design_problem
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.studies.tasks.designs import RTOL, Designed, judged

WIDE, HIGH = 40.0, 20.0
IN, OUT = (0.0, HIGH), (WIDE, HIGH)
INVERTER = Scene(
    "force inverter, lower half",
    Body(
        Rectangle((0.0, 0.0), OUT),
        (
            Support(Rectangle((0.0, 0.0), (0.0, 1.0))),
            Support(Rectangle((0.0, HIGH), OUT), (False, True)),
            Spring(IN, 0.1, (1.0, 0.0)),
            Spring(OUT, 0.1, (1.0, 0.0)),
        ),
        (PositionLoad(IN, (1.0, 0.0)),),
        Material(plane="stress"),
    ),
    Design(0.3, 1.5),
    Displacement(OUT, (1.0, 0.0)),
)


def ending(problem: DesignProblem, last: Iterate[Evaluation]) -> str:
    """What a run has come to, in words."""
    if any(isinstance(said, NothingMoves) for said in problem.remarks(last.evaluation)):
        return "the trivial design: nothing connects the ports, and the output stays where it is"
    return "an inverter" if last.objective < 0 else "no inverter: the output moves with the input"


@pytest.mark.slow
def test_force_inverter(report: Report, lock: Lock) -> None:
    """A force inverter

    The lower half of the published problem (Bendsøe and Sigmund 2003): push at the upper left corner, the upper right
    one is to move to the left; springs of 0.1 E0 at both, a corner held at the lower left, symmetry above. The output's
    displacement u_out is the objective, which no longer is self-adjoint. A design that connects nothing has u_out = 0,
    which a rule that never lets the objective rise may well prefer on its way.
    """
    problem = design_problem(INVERTER, 1.0)
    random = np.random.default_rng(0).uniform(0.2, 0.9, len(problem.x0))
    analysed = problem.evaluate(random).objective
    rules: dict[str, UpdateRule] = {"MMA, move 0.1": MMA(0.1), "MMA, move 0.2": MMA(0.2), "GCMMA, move 0.1": GCMMA(0.1)}
    rows, ends = [], {}
    for name, rule in rules.items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NothingMoves)  # told in the table
            *_, last = optimize(problem, rule, stop=design_change(0.01), max_iterations=100)
        ends[name] = last
        design = Designed(INVERTER, problem, last)
        true = float(judged(design.judge(), design.rho)[0])
        rows.append((name, true, last.objective, 0.3 * (1 + last.constraints[0]), last.solves, ending(problem, last)))
        report.design(
            f"inverter_{len(rows)}",
            *(design.x, design.half_length, design.rho),
            body="Force inverter, lower half",
            method=name,
            measure="u_out [F/E0]",
            own=last.objective,
            true=true,
        )
    columns = ["rule", "u_out, fine reference", "u_out", "volume", "solves", "what it is"]
    report.table("inverter", pd.DataFrame(rows, columns=columns), "From a uniform start of 30 %; u_out in F/E0.")
    best = min(ends.values(), key=lambda last: last.objective)
    trivial = [name for name, last in ends.items() if ending(problem, last).startswith("the trivial")]
    holds = [
        report.check(
            "u_out of a random design",
            analysed,
            0.6494410966,
            rtol=1e-9,
            source="scikit-fem, springs put into K by hand",
            why="ten digits are given",
        ),
        report.check(
            "u_out of the best run from a uniform start",
            best.objective,
            at_most=-0.9,
            source="published inverters move by about as much as the force would do alone",
        ),
    ]
    report.found(
        f"Force inverter: u_out = {best.objective:.3f} from a uniform start"
        + (f"; {', '.join(trivial)} ends in the trivial design, where nothing connects the ports." if trivial else ".")
    )
    lock({"random": analysed} | {name: ends[name].objective for name in rules if name not in trivial}, rtol=5 * RTOL)
    assert all(holds)
