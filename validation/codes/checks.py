"""All checks, by the way in that they take."""

from validation.codes import analysis_checks, gradient, shape_checks, sheared, steps
from validation.codes.card import Check


def every() -> list[Check]:
    """In the order in which a failure is best looked at: functions, then an analysis, its gradient, and load steps."""
    return [*shape_checks.checks(), *sheared.checks(), *analysis_checks.checks(), *gradient.checks(), *steps.checks()]
