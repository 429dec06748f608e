"""Tolerances of the study."""

ROUNDING = 1e-12
RTOL = 1e-6
"""Newton's tolerance, 1e-11 of the forces, times the condition of what the background holds, 1e5."""
