"""Tolerances of the study's locks."""

RTOL_OPTIMUM = 2e-3
"""Another processor rounds differently, a hundred iterations of a non-convex optimisation amplify that, and the
stopping rule (1e-4 over four iterations) may then end a run earlier: a few times 1e-4 is what that can cost."""
RTOL_ANALYSIS = 1e-8
"""One analysis of a given design: condition number 1e6 times rounding 1e-16, with two digits to spare."""
