"""What the paper states, each number with its place in it.

The paper: "Topology optimization with material point method: investigation into the design sensitivity and the effect
of shape functions".
"""

from typing import NamedTuple


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
SENSITIVITY_STEP = Stated(1e-4, "Appendix, Eq. A.1")
SENSITIVITY_COMPLIANCE_ERROR = Stated(0.02, "Appendix, Fig. 20a")  # percent
SENSITIVITY_COMPLIANCE_SHARE = Stated(0.9915, "Appendix, Fig. 20a")
SENSITIVITY_P_NORM_ERROR = Stated(0.3, "Appendix, Fig. 20b")  # percent
SENSITIVITY_P_NORM_SHARE = Stated(0.9897, "Appendix, Fig. 20b")
