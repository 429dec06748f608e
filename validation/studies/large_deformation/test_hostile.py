"""Bodies at random, of which load steps make something right or say what is wrong."""

import pandas as pd
import pytest

from validation.bodies.hostile import DOCUMENTED, outcomes
from validation.harness.report import Report

CASES = 2000


@pytest.mark.benchmark
def test_hostile(report: Report) -> None:
    """Two thousand hostile cases

    Cells of any size, ratio and place; one to three points in a cell and direction; every function, frame and rule for
    domains, with and without background; both laws; moduli alike, over three decades or partly void; loads of 1e-5 to
    1 of E in bending, one to four steps. What is found must be finite, in equilibrium and have the gradient that a
    complex step says; an error must name step and place. Two limits are documented, and counted: a body at its limit
    may end on another branch when it is run again with moduli that differ by 1e-30; and the gradient of one without
    background, of which a part hangs on void, may be one of the moduli's last bits.
    """
    count, other = outcomes(0, CASES)
    kinds = {kind: count[kind] for kind in DOCUMENTED} | {"anything else": len(other)}
    report.table("hostile", pd.DataFrame(kinds.items(), columns=["outcome", "cases"]), f"Outcome of {CASES:,} cases.")
    none = report.check(
        f"cases of {CASES:,} that are neither right nor named nor at their limit",
        len(other),
        0,
        source="nothing is passed over in silence",
    )
    assert none, other
