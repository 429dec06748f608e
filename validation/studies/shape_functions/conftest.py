"""Points of the solid cantilever, as seeded."""

import pytest

from mpmtop.points import MaterialPoints, seed
from validation.bodies.scenes import SPACING, cantilever


@pytest.fixture(scope="package")
def body_points() -> MaterialPoints:
    return seed(cantilever().body.domain, (SPACING, SPACING))
