"""The sentences of a comparison say what the numbers do, and the opposite where these do."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mpmtop.comparison.asked import FEM, GIMP, MPM, NONE, SPLINE, ask
from mpmtop.comparison.entries import Comparison, Entry
from mpmtop.comparison.methods import Prepared
from mpmtop.comparison.runs import Numbers, Run
from mpmtop.comparison.verdict import verdict
from mpmtop.points import seed
from tests.mpmtop.comparison.scenes import BEAM

CROSSED = "periodic(4, 0.26)"
AT = seed(BEAM.body.domain, (0.5, 0.5))


def entry(method: str, own: float, true: float, crossing: str = NONE, **numbers: Any) -> Entry:
    told = Numbers("converged", 10, true, 0.0, 0.8 * true, 0.0)
    history = np.array([2 * own, own])
    run = Run(np.full(len(AT.x), 0.4), history, np.zeros(2), replace(told, **numbers))
    return Entry(method, crossing, Prepared(None, None, AT, 1), run)


def comparison(*entries: Entry, error: float | None = None, **asked: Any) -> Comparison:
    return Comparison(ask(BEAM, **({"h": 1.0, "crossing": (NONE, CROSSED)} | asked)), entries, error)


def said(found: Comparison) -> dict[str, str]:
    return {word: " ".join(sentences) for word, sentences in verdict(found).rows}


def test_the_best_in_truth_is_taken_whatever_the_methods_claim() -> None:
    told = said(comparison(entry(FEM, 100.0, 101.0), entry(SPLINE, 80.0, 120.0)))
    assert told["Use"].startswith("FEM: ") and "quadratic B-splines 18.8% higher" in told["Use"]
    turned = said(comparison(entry(FEM, 100.0, 140.0), entry(SPLINE, 130.0, 120.0)))
    assert turned["Use"].startswith("quadratic B-splines: ")


def test_designs_within_the_scatter_are_equal_and_twins_are_named() -> None:
    twin = replace(entry(GIMP, 100.0, 101.0), same_as=MPM)
    told = said(comparison(entry(FEM, 99.0, 100.0), entry(MPM, 100.0, 101.0), twin, entry(SPLINE, 99.0, 101.3)))
    assert told["Use"].startswith("FEM or MPM = GIMP: ")
    assert "Beside the best, quadratic B-splines 1.3% higher" in told["Use"]
    assert "is 100 to 101, which is equal" in told["Use"] and "(within 1.25%): take any." in told["Use"]
    alone = said(comparison(entry(MPM, 100.0, 101.0), twin, entry(SPLINE, 99.0, 110.0)))
    assert "of the design is 101. Beside" in alone["Use"]  # one design, to which nothing is equal


def test_what_violates_a_constraint_in_truth_is_not_taken() -> None:
    told = said(comparison(entry(FEM, 100.0, 101.0), entry(SPLINE, 80.0, 81.0, violation=0.2)))
    assert told["Use"].startswith("FEM: ") and "quadratic B-splines violates a constraint by 20.0%" in told["Use"]


def test_crossing_costs_what_the_truth_says() -> None:
    entries = [entry(MPM, 100.0, 100.0), entry(SPLINE, 100.0, 100.0)]
    entries += [entry(MPM, 90.0, 110.0, CROSSED), entry(SPLINE, 105.0, 100.0, CROSSED)]
    told = said(comparison(*entries))["Crossing"]
    assert "is 10.0% higher with MPM than as seeded" in told
    assert "; with quadratic B-splines the change is not distinguishable from none (below 1.25%)" in told
    assert "report -10.0% (MPM) and +5.0% (quadratic B-splines)" in told
    assert "take quadratic B-splines. FEM is not among them: its mesh does not cross." in told


def test_crossing_that_is_not_felt_crowns_no_method() -> None:
    entries = [entry(MPM, 100.0, 100.0), entry(SPLINE, 90.0, 100.0)]
    entries += [entry(MPM, 100.0, 101.0, CROSSED), entry(SPLINE, 90.0, 99.9, CROSSED)]
    told = said(comparison(*entries, methods=(MPM, SPLINE)))["Crossing"]
    assert "the change of the true compliance of designs is not distinguishable from none (below 1.25%) with" in told
    assert "take quadratic B-splines or MPM, any. The own value of MPM (-1.0%) is nearest the truth." in told
    assert "higher" not in told and "FEM" not in told
    assert (
        "with MPM and quadratic B-splines"
        not in said(comparison(*entries[:3], entry(SPLINE, 90.0, 105.0, CROSSED)))["Crossing"]
    )


def test_of_equal_designs_the_own_value_nearest_the_truth_is_told() -> None:
    told = said(comparison(entry(FEM, 96.9, 100.0), entry(MPM, 90.0, 100.5), entry(SPLINE, 96.0, 100.0)))["Use"]
    assert "The own values of FEM (-3.1%) and quadratic B-splines (-4.0%) are nearest the truth." in told


def test_what_failed_is_named_in_use_and_crossing() -> None:
    lost = entry(SPLINE, 100.0, np.nan)
    none = Entry(MPM, NONE, None, None, refusal="no node is held")
    crossed = [entry(GIMP, 100.0, 100.0, CROSSED), entry(MPM, 100.0, np.nan, CROSSED)]
    told = said(comparison(entry(FEM, 100.0, 100.0), entry(GIMP, 100.0, 100.0), lost, none, *crossed))
    named = "There is no design by MPM, see Mind. The judge finds no equilibrium in the design by quadratic B-splines."
    assert named in told["Use"]
    assert "The judge finds no equilibrium in the design by MPM." in told["Crossing"]
    assert "No method can be told from another" in said(comparison(lost))["Use"]


def test_no_best_or_worst_cut_is_crowned_within_the_tolerance() -> None:
    near = entry(FEM, 100.0, 100.0, cut=80.0), entry(MPM, 100.0, 100.0, cut=80.9)
    assert "every design is as good: 80 to 80.9, within 1.25%" in said(comparison(*near))["Cut"]
    far = *near, entry(GIMP, 100.0, 100.0, cut=95.0), entry(SPLINE, 100.0, 100.0, cut=96.0)
    told = said(comparison(*far))["Cut"]
    assert "the best designs are those of FEM and MPM: 80 to 80.9" in told
    assert "the worst designs are those of GIMP and quadratic B-splines, 20.0% higher" in told


def test_a_negative_objective_is_better_the_lower() -> None:
    told = said(comparison(entry(FEM, -1.0, -0.9), entry(SPLINE, -1.0, -0.5)))
    assert told["Use"].startswith("FEM: ") and "quadratic B-splines 44.4% higher" in told["Use"]


def test_own_values_that_mislead_are_warned_of() -> None:
    told = said(comparison(entry(FEM, 100.0, 101.0), entry(SPLINE, 50.0, 102.0)))
    assert "optimistic by more than 5.0%: quadratic B-splines, the truth is 2.04 times its own value." in told["Mind"]
    assert "-51.0% (quadratic B-splines reports 50 for 102) to -1.0% (FEM, 100 for 101)" in told["Claims"]
    assert "Mind" not in said(comparison(entry(FEM, 100.0, 101.0)))
    both = said(comparison(entry(MPM, 100.0, 110.0), entry(FEM, 110.0, 100.0, cut=180.0), entry(SPLINE, 100.0, 104.0)))
    assert "optimistic by more than 5.0%: MPM, the truth is 1.1 times its own value." in both["Mind"]
    assert "pessimistic by more than 5.0%: FEM, the truth is 0.909 times its own value." in both["Mind"]
    assert "Cut to black and white, worse than grey and than its own value" in both["Mind"]
    assert "by more than 5.0%: FEM, the truth is 1.64 times its own value." in both["Mind"]
    sign = said(comparison(entry(MPM, -1.0, 0.5)))["Mind"]
    assert "MPM, -1 for 0.5." in sign


def test_what_failed_stopped_or_hangs_on_void_is_told() -> None:
    refused = Entry(MPM, NONE, None, None, refusal="no node is held")
    stopped = entry(SPLINE, 100.0, 100.0, outcome="stopped", error="Newton's method failed")
    short = entry(FEM, 100.0, 100.0, cut=np.nan, outcome="max iterations", remark="a place is that of void")
    told = said(comparison(refused, stopped, short, error=-0.004))
    assert "MPM cannot be asked: no node is held" in told["Mind"]
    assert "quadratic B-splines stopped: Newton's method failed" in told["Mind"]
    assert "FEM: a place is that of void." in told["Mind"]
    assert "Not converged after 300 iterations at most: FEM (max iterations)" in told["Mind"]
    assert "uncertain by 0.4%" in told["Mind"] and "the load hangs on void with FEM" in told["Cut"]


def test_commas_of_a_crossing_do_not_separate_runs() -> None:
    entries = [entry(MPM, 100.0, 100.0, cut=80.0), entry(SPLINE, 100.0, 100.0, cut=95.0)]
    told = said(comparison(*entries, entry(SPLINE, 100.0, 100.0, CROSSED, cut=95.0)))["Cut"]
    assert "those of quadratic B-splines; quadratic B-splines, periodic(4, 0.26), 18.8% higher" in told


def test_a_filter_radius_below_a_cell_is_told() -> None:
    narrow = replace(BEAM, design=replace(BEAM.design, filter_radius=0.6))
    found = Comparison(ask(narrow, h=1.0), (entry(MPM, 100.0, 101.0),))
    assert "The filter radius 0.6 is below the cells' side 1" in said(found)["Mind"]


@pytest.mark.parametrize("value", [100.0, -1.0])
def test_one_method_alone_is_told_without_a_comparison(value: float) -> None:
    told = said(comparison(entry(FEM, value, value)))
    assert "finds a true compliance of" in told["Use"] and "Beside" not in told["Use"]


def test_designs_are_equal_within_the_judge_s_own_error() -> None:
    entries = (entry(FEM, 100.0, 100.0), entry(SPLINE, 99.0, 102.0))
    assert said(comparison(*entries, error=0.004))["Use"].startswith("FEM: ")
    told = said(comparison(*entries, error=-0.03))["Use"]
    assert told.startswith("FEM or quadratic B-splines: ") and "what the judge can tell (within 3.00%)" in told
