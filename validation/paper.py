"""What the paper states: every sentence and number that a study compares, in its words, with its place and its kind.

The paper: "Topology optimization with material point method: investigation into the design sensitivity and the effect
of shape functions". Words in quotation marks are the paper's own; ratios are given as such, 13.8 % as 0.138.
"""

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from validation.harness.claims import Statement
from validation.harness.report import Report

# Inputs: a scene that has other numbers is another scene.
CANTILEVER_POINTS = Statement("Sect. 5.1.1", "cantilever: “3,200 material points”", "input", 3200)
L_BRACKET_POINTS = Statement("Sect. 5.1.2", "L-bracket: “6,400 material points”", "input", 6400)
LOW_RESOLUTION_POINTS = Statement("Sect. 6.2, Fig. 18b", "low resolution: “4,050 points”", "input", 4050)
HIGH_RESOLUTION_POINTS = Statement("Sect. 6.2, Fig. 18c", "high resolution: “16,200 points”", "input", 16200)
MULTI_RESOLUTION_POINTS = Statement("Sect. 6.2, Fig. 18d", "multi-resolution: “10,170 material points”", "input", 10170)
NO_CROSSING = Statement("Sect. 5.1.1", "“free from the cell crossing error”: no domain leaves its cell", "input", 0)
SENSITIVITY_STEP = Statement("Appendix, Eq. A.1", "perturbation 1e-4", "input", 1e-4)

# Identities: GIMP is the average of the tent over a domain inside one cell, and the tent is linear there.
IDENTICAL = Statement(
    "Sects. 5.1.1, 5.1.2, Appendix", "standard MPM and GIMP “exhibit identical displacement and stress”", "identity"
)
EQUIVALENT = Statement(
    "Sect. 3.2, Fig. 4", "“a zero-density material point is equivalent to the absence of a material”", "identity"
)
CONSISTENT = Statement("Appendix", "crossing does “not impact the discrepancy between these sensitivities”", "identity")

# Numbers printed as results.
CANTILEVER_COMPLIANCE = Statement("Sect. 5.1.1, Fig. 9", "cantilever: objective 83.57", "calibrated", 83.57)
CANTILEVER_ITERATIONS = Statement("Sect. 5.1.1, Fig. 9", "cantilever: converged at the 76th iteration", "result", 76)
L_BRACKET_REDUCTION = Statement("Sect. 5.1.2", "L-bracket: p-norm “decreased by 97%”", "result", 0.97, "%")
L_BRACKET_ITERATIONS = Statement("Sect. 5.1.2, Fig. 11", "L-bracket: more than 201 iterations", "result", 201)
CANTILEVER_CROSSING_TIP_STANDARD = Statement(
    "Sect. 5.2.1", "crossing: tip “overestimated by 13.8%”, standard", "calibrated", 0.138, "%"
)
CANTILEVER_CROSSING_TIP_GIMP = Statement("Sect. 5.2.1", "crossing: tip “less than 1.8%”, GIMP", "result", 0.018, "%")
CANTILEVER_CROSSING_STANDARD = Statement("Sect. 5.2.1, Fig. 13", "crossing: objective 90.99, standard", "result", 90.99)
CANTILEVER_CROSSING_GIMP = Statement("Sect. 5.2.1, Fig. 13", "crossing: objective 86.5, GIMP", "result", 86.5)
CANTILEVER_CROSSING_STANDARD_INCREASE = Statement(
    "Sect. 5.2.1", "crossing: objective up by 9.6%, standard", "result", 0.096, "%"
)
CANTILEVER_CROSSING_GIMP_INCREASE = Statement(
    "Sect. 5.2.1", "crossing: objective up by 3.7%, GIMP", "result", 0.037, "%"
)
L_BRACKET_CROSSING_P_NORM = Statement(
    "Sect. 5.2.2", "crossing: p-norm over by “approximately 10%”, standard", "result", 0.10, "%"
)
L_BRACKET_CROSSING_STANDARD = (
    Statement("Sect. 5.2.2, Fig. 15", "crossing: stress from 2.48 Pa, standard", "result", 2.48),
    Statement("Sect. 5.2.2, Fig. 15", "crossing: stress to 1.81 Pa, standard", "result", 1.81),
)
L_BRACKET_CROSSING_GIMP = (
    Statement("Sect. 5.2.2, Fig. 15", "crossing: stress from 2.24 Pa, GIMP", "calibrated", 2.24),
    Statement("Sect. 5.2.2, Fig. 15", "crossing: stress to 1.62 Pa, GIMP", "result", 1.62),
)
HOLE_DIFFERENCE = Statement("Sect. 6.1", "hole: “only a 1.4% difference”", "result", 0.014, "%")
REMOVAL_ERROR = Statement("Sect. 3.2, Fig. 4", "divided points: errors “smaller than 1.0%”", "result", 0.01, "%")
SENSITIVITY_COMPLIANCE_ERROR = 0.02  # percent, Appendix
SENSITIVITY_COMPLIANCE_SHARE = Statement(
    "Appendix, Fig. 20a", "compliance: 99.15% of variables below 0.02%", "result", 0.9915, "%"
)
SENSITIVITY_P_NORM_ERROR = 0.3  # percent, Appendix
SENSITIVITY_P_NORM_SHARE = Statement("Appendix, Fig. 20b", "p-norm: 98.97% of variables at 0.3%", "result", 0.9897, "%")

OPTIMUM_SCATTER: dict[str, float] = {
    "cantilever, mid-height": 0.0125,
    "cantilever, bottom corner": 0.05,
    "cantilever with a hole": 0.01,
    "L-bracket": 0.03,
}
"""What rule and start make of an optimum, largest over least less one, by body: the least
tolerance of a claim on it. Held by the study of open choices."""
STRESS_SCATTER = 0.05
"""The same of the largest stress of an optimised bracket."""

# Comparisons and directions.
VOLUME_ACTIVE = Statement("Sect. 5.1.1", "“the volume constraint remained active”", "trend", 0.4)
ALIGNS_WITH_FEM = Statement(
    "Sect. 5.1.1", "layout “aligns with well-established material layouts” of FEA-based SIMP", "trend"
)
EMPTY_CORNER = Statement(
    "Sect. 5.1.2", "designs “avoid placing material at the internal corner where maximum stress occurs”", "trend"
)
MITIGATES = Statement("Sect. 2.2", "smoother functions, such as GIMP's, mitigate the error of crossing", "trend")
DISCONTINUOUS = Statement(
    "Sect. 2.2", "standard MPM: “discontinuity of the gradients of the shape” functions at cell boundaries", "trend"
)
OVERSHOOTS = Statement(
    "Sect. 5.2.1, Fig. 12", "von Mises stress “shows periodic overshoots in the x direction”", "trend"
)
OVERSHOOTS_MITIGATED = Statement(
    "Sect. 5.2.1, Fig. 12", "“mitigated by using the smoother shape function provided by the GIMP method”", "trend"
)
STRUTS = Statement("Sect. 5.2.1, Fig. 13a", "standard: “fictitious materials aligned along the y-axis”", "trend")
GIMP_ALIGNS = Statement(
    "Sect. 5.2.1, Fig. 13b", "GIMP's layout “aligns with designs without cell crossing errors”", "trend"
)
STANDARD_HIGHER = Statement(
    "Sect. 5.2.1", "struts make the objective “converge at a higher value (90.99) compared to” GIMP's 86.5", "trend"
)
STRESS_OSCILLATES = Statement(
    "Sect. 5.2.2, Fig. 14", "standard: “an oscillatory deviation in the stress”; GIMP: close to FEM", "trend"
)
STRESS_GIMP_MARGINAL = Statement(
    "Sect. 5.2.2", "GIMP: “only a marginal difference compared to the FEM results”", "trend", unit="%"
)
STRESS_STANDARD_HIGHER = Statement(
    "Sect. 5.2.2", "objective and stress “higher in the design obtained with the standard MPM”", "trend"
)
LESS_CRISP = Statement("Sect. 5.2.2", "standard's layout “had poor crispness”", "trend")
STRESS_HIT_HARDER = Statement(
    "Sect. 5.2.2", "crossing “on stress optimization is more pronounced than on compliance optimization”", "trend"
)
HOLE_SLOWER = Statement("Sect. 6.1", "hole: “slower rate of convergence observed in case 2”", "trend")
REMOVAL_EVEN = Statement("Sect. 3.2", "errors “do not vary with the location of node”", "trend")
MORE_POINTS_LESS_COMPLIANCE = Statement(
    "Sect. 6.2, Fig. 19", "more points, less compliance: “significantly reducing compliance”", "trend"
)
MULTI_NEAR_HIGH = Statement("Sect. 6.2", "multi-resolution “closely resembling the high-resolution”", "trend")
MULTI_CHEAPER = Statement("Sect. 6.2", "multi-resolution: “minimizing computational costs elsewhere”", "trend")

# Misprints.
GIMP_MISPRINT = Statement("Eq. (7)", "middle branch 1 - d²/(2 h l_p)", "erratum")
PERCENTAGE_MISPRINT = Statement("Sect. 5.2.1", "90.99 and 86.5 are 9.6 % and 3.7 % above 83.57", "erratum", unit="%")


TELLING = 0.5
"""Largest relative tolerance with which agreement says anything."""


class Compared(NamedTuple):
    """A number of the paper beside ours, what ours depends on, when they agree and why: within `rtol`, or if the paper
    gives a bound (`rtol` None), when ours is no larger; infinite where it cannot be told. And the most likely reason if
    they differ."""

    number: str
    stated: Statement
    ours: float
    depends_on: str
    rtol: float | None
    why: str
    reason: str = ""


def under_a_pattern(
    choice: str, rise: Mapping[str, float], final: Mapping[str, float], still: float, scatter: float, reason: str
) -> list[Compared]:
    """The numbers of Sect. 5.2.1 beside those under one pattern of crossing, by method: rise of the solid's tip, and
    the optimum, which scatters by so much; `still` is the optimum without crossing. The pattern was chosen for the
    first of them."""
    width = f"{scatter:.2%}: what the optimum scatters by rule and start (study of open choices)"
    tenth = "10 % of it: a rise is what crossing makes"
    known = f"it is known to the optimum's scatter, {scatter:.2%} of the optimum; more than half of it tells nothing"
    base = f"the optimum without crossing is {still / CANTILEVER_COMPLIANCE.value - 1:+.1%} off already; {reason}"
    stated = {
        "standard": (CANTILEVER_CROSSING_STANDARD, CANTILEVER_CROSSING_STANDARD_INCREASE),
        "GIMP": (CANTILEVER_CROSSING_GIMP, CANTILEVER_CROSSING_GIMP_INCREASE),
    }
    tip, over = "rise of the tip displacement of the solid", "rise of the optimum"
    tip_standard, tip_gimp = CANTILEVER_CROSSING_TIP_STANDARD, CANTILEVER_CROSSING_TIP_GIMP
    numbers = [
        Compared(f"{tip}, standard", tip_standard, rise["standard"], f"{choice}, chosen for it", 0.1, tenth, reason),
        Compared(f"{tip}, GIMP", tip_gimp, rise["GIMP"], choice, None, "the paper's bound", reason),
    ]
    for name, (optimum, increase) in stated.items():
        numbers += [
            Compared(f"optimum, {name}", optimum, final[name], choice, scatter, width, base),
            Compared(
                *(f"{over}, {name}", increase, final[name] / still - 1, choice),
                *(share if (share := scatter / increase.value) <= TELLING else math.inf, known, reason),
            ),
        ]
    return numbers


def compare(report: Report, numbers: Iterable[Compared]) -> None:
    """A claim for each number."""
    for number, stated, ours, depends_on, rtol, why, reason in numbers:
        expected, at_most = (None, stated.value) if rtol is None else (stated.value, None)
        if rtol == math.inf:
            expected, rtol = None, None
        claim = f"{number}; {depends_on}"
        report.check(claim, ours, expected, rtol=rtol, at_most=at_most, source=stated, why=why, reason=reason)


def compare_identical(report: Report, of: str, pairs: Mapping[str, tuple[NDArray[Any], NDArray[Any]]]) -> list[bool]:
    """Whether standard MPM and GIMP are one where nothing crosses: a claim for each quantity of the body named."""
    return [
        report.check(
            f"{what} of the {of}, standard against GIMP: largest difference over largest value",
            float(np.abs(a - b).max() / np.abs(a).max()),
            at_most=1e-14,
            source=IDENTICAL,
            why="identical but for the last digits of double precision",
        )
        for what, (a, b) in pairs.items()
    ]
