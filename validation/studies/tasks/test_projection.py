"""Black and white."""

from dataclasses import replace

import pandas as pd
import pytest

from mpmtop.body import Body, Material, Support
from mpmtop.design import Design, Projection
from mpmtop.loads import PointLoad
from mpmtop.optimizers import MMA, OptimalityCriteria, Stage, continuation, design_change, optimize
from mpmtop.region import Rectangle
from mpmtop.scene import Scene
from reference_fem.simp import design_problem
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.studies.tasks.designs import RTOL, Designed, grayness, judged

RADIUS = 6.0
CANTILEVER = Scene(
    "cantilever",
    Body(
        Rectangle((0.0, 0.0), (60.0, 30.0)),
        (Support(Rectangle((-1.0, 0.0), (0.0, 30.0))),),
        (PointLoad((60.0, 15.0), (0.0, -1.0)),),
        Material(plane="stress"),
    ),
    Design(0.4, RADIUS),
)
MOVE = 0.1
COLUMNS = ["design", "densities", "compliance, fine reference", "compliance", "grayness", "volume"]
BETAS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)


@pytest.mark.slow
def test_projected_and_grey(report: Report, lock: Lock) -> None:
    """A projected and a grey cantilever

    60 x 30 elements and a filter radius of six of them: members are thick, and their edges grey over the radius. The
    projection, `Projection(beta)` with the threshold at 1/2, is sharpened in six stages of 30 iterations (MMA), beta
    from 1 to 32. Both designs are judged by the fine reference as they are, and cut to black and white at their own
    volume. Grayness is 4 mean(rho (1 - rho)).
    """
    problem = design_problem(CANTILEVER, 1.0)
    *_, grey = optimize(problem, OptimalityCriteria(), stop=design_change(0.01), max_iterations=100)
    designs = [replace(CANTILEVER.design, projection=Projection(beta)) for beta in BETAS]
    stages = [Stage(replace(problem, design=design), MMA(MOVE), max_iterations=30) for design in designs]
    *_, sharp = continuation(stages)
    found = {"grey": Designed(CANTILEVER, problem, grey), "projected": Designed(CANTILEVER, problem, sharp)}
    judge = found["grey"].judge()
    own: dict[tuple[str, str], float] = {}
    true: dict[tuple[str, str], float] = {}
    rows = []
    for name, design in found.items():
        for cut, rho in (("as it is", design.rho), ("cut", design.black)):
            true[name, cut], own[name, cut] = float(judged(judge, rho)[0]), problem.analyse(rho).objective
            volume = float(problem.model.area @ rho / problem.model.area.sum())
            rows.append((name, cut, true[name, cut], own[name, cut], grayness(rho), volume))
            report.design(
                f"{name}_{cut.replace(' ', '_')}",
                *(design.x, design.half_length, rho),
                body=f"Cantilever, filter radius {RADIUS:g} h",
                method=f"{name}, {cut}",
                measure="compliance [F²/E0]",
                own=own[name, cut],
                true=true[name, cut],
            )
    report.table("projection", pd.DataFrame(rows, columns=COLUMNS), "Compliance [F²/E0].")
    C, M, M_grey = own["projected", "as it is"], found["projected"].grayness, found["grey"].grayness
    lost = {name: true[name, "cut"] / true[name, "as it is"] - 1 for name in found}
    holds = [
        report.check("projected: compliance", C, at_most=80.0, source="a projection written by hand: 79.0"),
        report.check("projected: grayness", M, at_most=0.12, source="a projection written by hand: 0.10"),
        report.check(
            "projected: constraint on the volume", float(sharp.constraints[0]), at_most=1e-3, source="feasible"
        ),
        report.check(
            "change of the true compliance by the cut, projected over grey",
            abs(lost["projected"] / lost["grey"]),
            at_most=1.0,
            source="what is nearly black and white changes less",
        ),
    ]
    report.found(
        f"Radius of six spacings: {M_grey:.0%} grey at compliance {own['grey', 'as it is']:.1f}; projected {M:.0%} at "
        f"{C:.1f}. Cut to black and white, the fine reference finds {true['grey', 'cut']:.1f} and "
        f"{true['projected', 'cut']:.1f}."
    )
    report.so(
        f"Judge the design that will be made: the cut changes the grey one by {lost['grey']:+.0%}, the projected one "
        f"by {lost['projected']:+.0%}."
    )
    lock({f"{name}, {cut}": value for (name, cut), value in own.items()}, rtol=5 * RTOL)
    assert all(holds)
