"""Errors by name: what is asked of either solver cannot be answered; the message says what to change."""


class InvalidScene(ValueError):
    """A number of the body, the design or the objective is outside its admissible range."""


class EmptyDomain(InvalidScene):
    """The domain holds no area, or no material point."""


class LoadOutsideBody(InvalidScene):
    """A load acts where there is no material."""


class UnsupportedBody(ValueError):
    """The supports leave the body, or a part of it, free to move: the stiffness is singular."""


class PointOutsideGrid(ValueError):
    """A material point, or its domain, leaves the background grid."""


class PositionOutsideBody(ValueError):
    """A position where the functions have a node that no material point touches."""


class NotConverged(RuntimeError):
    """An iteration ended before it met its tolerance."""
