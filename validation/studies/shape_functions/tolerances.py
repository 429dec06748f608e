"""Tolerances of the study's locks."""

RTOL_ERRORS = 1e-5
"""Errors of single analyses: rounding of displacements, 1e-14 of them, beside the smallest error of 5e-8."""
RTOL_ANALYSIS = 1e-5
"""Single analyses of given points: condition number 1e6 times rounding, 1e-10, beside the smallest error of 2e-5."""
