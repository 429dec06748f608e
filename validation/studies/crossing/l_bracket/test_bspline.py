"""The bracket optimised with crossing by quadratic B-splines."""

import pandas as pd
import pytest

from reference_fem.reanalyse import Judge, judge_stress
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.methods.analyser import Analyser
from validation.studies.crossing.l_bracket.bracket import CROSSING, RTOL_OPTIMUM, optimise, relaxed

# points are moved over grid lines on purpose
pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

NAME = "quadratic B-spline"


@pytest.mark.benchmark
def test_bspline(report: Report, lock: Lock, analysers: dict[str, Analyser], judge: Judge) -> None:
    """Quadratic B-splines, optimised with crossing

    As above: the same points, uniform start, filter and rule, by functions that the paper does not have. Its own p-norm
    and that on the fine reference, one biquadratic element for each point. Another start ends elsewhere: see the
    scatter of optima on the page of open choices.
    """
    run = optimise(NAME)
    rho = run.design.at(analysers["FEM"].x)
    fine = judge_stress(judge, rho, judge(rho))
    row = {
        "p-norm": run.final,
        "largest rho^q vm": float(relaxed(analysers[NAME], run.design.rho).max()),
        "iterations": run.iterations,
        "grayness": run.design.grayness,
        "p-norm, fine reference": fine.p_norm,
        "largest rho^q vm, fine reference": fine.largest,
    }
    table = pd.DataFrame.from_dict({NAME: row}, orient="index").rename_axis("design of")
    report.table("bspline", table, f"Optimised bracket, {CROSSING}; stress in F/h.", 4)
    report.check(
        f"p-norm of the design of {NAME}, fine reference over its own value",
        fine.p_norm / run.final,
        source="for comparison",
    )
    report.design(
        "design_B-spline",
        *(run.design.x, run.design.half_length, run.design.rho),
        body="L-bracket",
        method="B-spline, crossed",
        measure="p-norm of stress [F/h]",
        own=run.final,
        true=fine.p_norm,
        front=True,
    )
    lock({f"optimised p-norm, {NAME}": run.final}, rtol=RTOL_OPTIMUM)
