"""What is checked and locked of the runs."""

from collections.abc import Mapping, Sequence

import pandas as pd

from validation.harness.report import Report
from validation.studies.work_precision.runs import CASE, slopes

LOCKED_FROM = 1e-4
"""Smallest error that is locked: RTOL_ERRORS of it is above rounding."""


def locked(frame: pd.DataFrame, methods: Sequence[str] = ()) -> dict[str, float]:
    """Errors at the finest level of each case that are large enough to be the same on every machine."""
    last = frame.groupby(CASE, sort=False).tail(1)
    last = last[(last["error"] > LOCKED_FROM) & (last["method"].isin(methods) if methods else True)]
    return {", ".join(map(str, case)): error for *case, error in last[[*CASE, "error"]].itertuples(index=False)}


def orders_hold(report: Report, frame: pd.DataFrame, expected: Mapping[tuple[str, str, int], float]) -> bool:
    """Check the slope of (quantity, method, ppc) uncrossed against orders in h, which are known a priori."""
    slope = slopes(frame)
    holds = [
        report.check(
            f"order in h of the {quantity}, {method}",
            -2 * slope[quantity, method, ppc, "uncrossed" if ppc else ""],
            at_least=0.85 * order,  # unknowns are (n + 1)^2 and the like: the slope on few cells is below its limit
            source=f"a priori: {order:g}",
        )
        for (quantity, method, ppc), order in expected.items()
    ]
    return all(holds)
