"""What the paper states, each number with its place in it.

The paper: "Topology optimization with material point method: investigation into the design sensitivity and the effect
of shape functions".
"""

from collections.abc import Iterable
from typing import NamedTuple

import pandas as pd

from validation.harness.report import Report


class Stated(NamedTuple):
    """A number of the paper and where it stands."""

    value: float
    where: str


CANTILEVER_POINTS = Stated(3200, "Sect. 5.1.1")
CANTILEVER_COMPLIANCE = Stated(83.57, "Sect. 5.1.1, Fig. 9")
CANTILEVER_ITERATIONS = Stated(76, "Sect. 5.1.1, Fig. 9")
CANTILEVER_CROSSING_STANDARD = Stated(90.99, "Sect. 5.2.1, Fig. 13")
CANTILEVER_CROSSING_GIMP = Stated(86.5, "Sect. 5.2.1, Fig. 13")
CANTILEVER_CROSSING_STANDARD_INCREASE = Stated(0.096, "Sect. 5.2.1")
CANTILEVER_CROSSING_GIMP_INCREASE = Stated(0.037, "Sect. 5.2.1")
L_BRACKET_POINTS = Stated(6400, "Sect. 5.1.2")
L_BRACKET_REDUCTION = Stated(0.97, "Sect. 5.1.2")
HOLE_DIFFERENCE = Stated(0.014, "Sect. 6.1")
LOW_RESOLUTION_POINTS = Stated(4050, "Sect. 6.2, Fig. 18b")
HIGH_RESOLUTION_POINTS = Stated(16200, "Sect. 6.2, Fig. 18c")
MULTI_RESOLUTION_POINTS = Stated(10170, "Sect. 6.2, Fig. 18d")
SENSITIVITY_STEP = Stated(1e-4, "Appendix, Eq. A.1")
SENSITIVITY_COMPLIANCE_ERROR = Stated(0.02, "Appendix, Fig. 20a")  # percent
SENSITIVITY_COMPLIANCE_SHARE = Stated(0.9915, "Appendix, Fig. 20a")
SENSITIVITY_P_NORM_ERROR = Stated(0.3, "Appendix, Fig. 20b")  # percent
SENSITIVITY_P_NORM_SHARE = Stated(0.9897, "Appendix, Fig. 20b")
CANTILEVER_CROSSING_TIP_STANDARD = Stated(0.138, "Sect. 5.2.1")
CANTILEVER_CROSSING_TIP_GIMP = Stated(0.018, "Sect. 5.2.1")
L_BRACKET_CROSSING_P_NORM = Stated(0.10, "Sect. 5.2.2")
L_BRACKET_CROSSING_STANDARD = (Stated(2.48, "Sect. 5.2.2, Fig. 15"), Stated(1.81, "Sect. 5.2.2, Fig. 15"))  # Pa
L_BRACKET_CROSSING_GIMP = (Stated(2.24, "Sect. 5.2.2, Fig. 15"), Stated(1.62, "Sect. 5.2.2, Fig. 15"))  # Pa


class Compared(NamedTuple):
    """A number of the paper beside ours, what ours depends on, and when they agree: within `rtol`, or if the paper
    gives a bound (`rtol` None), when ours is no larger."""

    number: str
    stated: Stated
    ours: float
    depends_on: str
    rtol: float | None


def compare(report: Report, name: str, numbers: Iterable[Compared], caption: str) -> None:
    """A claim for each number, and all of them in a table."""
    rows = []
    for number, stated, ours, depends_on, rtol in numbers:
        bound = {"at_most": stated.value} if rtol is None else {"expected": stated.value, "rtol": rtol}
        agrees = report.check(number, ours, source=stated.where, **bound)
        rows.append(
            {
                "number": number,
                "paper": f"< {stated.value:g}" if rtol is None else f"{stated.value:.4g}",
                "ours": ours,
                "verdict": "agrees" if agrees else "differs",
                "ours depends on": depends_on,
            }
        )
    report.table(name, pd.DataFrame(rows), caption, 4)
