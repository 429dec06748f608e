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
    assert told["Use"].startswith("FEM or MPM or GIMP (one method here): ")
    assert "quadratic B-splines 1.3% higher" in told["Use"] and "is 100 to 101, which is equal" in told["Use"]
    alone = said(comparison(entry(MPM, 100.0, 101.0), twin, entry(SPLINE, 99.0, 110.0)))
    assert "of the design is 101. Beside" in alone["Use"]  # one design, to which nothing is equal


def test_what_violates_a_constraint_in_truth_is_not_taken() -> None:
    told = said(comparison(entry(FEM, 100.0, 101.0), entry(SPLINE, 80.0, 81.0, violation=0.2)))
    assert told["Use"].startswith("FEM: ") and "quadratic B-splines violates a constraint by 20.0%" in told["Use"]


def test_crossing_costs_what_the_truth_says() -> None:
    entries = [entry(MPM, 100.0, 100.0), entry(SPLINE, 100.0, 100.0)]
    entries += [entry(MPM, 90.0, 110.0, CROSSED), entry(SPLINE, 105.0, 100.0, CROSSED)]
    told = said(comparison(*entries))["Crossing"]
    assert "10.0% higher with MPM and unchanged (to 0.1%) with quadratic B-splines" in told
    assert "report -10.0% and +5.0%" in told and told.endswith("take quadratic B-splines.")


def test_a_negative_objective_is_better_the_lower() -> None:
    told = said(comparison(entry(FEM, -1.0, -0.9), entry(SPLINE, -1.0, -0.5)))
    assert told["Use"].startswith("FEM: ") and "quadratic B-splines 44.4% higher" in told["Use"]


def test_own_values_that_mislead_are_warned_of() -> None:
    told = said(comparison(entry(FEM, 100.0, 101.0), entry(SPLINE, 50.0, 102.0)))
    assert "Do not trust the own value of quadratic B-splines: the truth is up to 2.04 times it" in told["Mind"]
    assert "-51.0% (quadratic B-splines reports 50 for 102) to -1.0% (FEM, 100 for 101)" in told["Claims"]
    assert "Mind" not in said(comparison(entry(FEM, 100.0, 101.0)))


def test_what_failed_stopped_or_hangs_on_void_is_told() -> None:
    refused = Entry(MPM, NONE, None, None, refusal="no node is held")
    stopped = entry(SPLINE, 100.0, 100.0, outcome="stopped", error="Newton's method failed")
    short = entry(FEM, 100.0, 100.0, cut=np.nan, outcome="max iterations")
    told = said(comparison(refused, stopped, short, error=-0.004))
    assert "MPM cannot be asked: no node is held" in told["Mind"]
    assert "quadratic B-splines stopped: Newton's method failed" in told["Mind"]
    assert "Not converged after 300 iterations at most: FEM (max iterations)" in told["Mind"]
    assert "uncertain by 0.4%" in told["Mind"] and "the load hangs on void with FEM" in told["Cut"]


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
    assert told.startswith("FEM or quadratic B-splines: ") and "what the judge can tell (3.0%)" in told
