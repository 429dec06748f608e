"""What the judge is uncertain by falls as its elements do."""

import numpy as np

from mpmtop.points import seed
from reference_fem.reanalyse import reanalyse
from validation.bodies.scenes import SPACING, toy_cantilever
from validation.methods.analyser import DensityField
from validation.methods.judging import own_error


def test_own_error_falls_with_the_elements() -> None:
    scene = toy_cantilever()
    points = seed(scene.body.domain, (SPACING, SPACING))
    design = DensityField(points.x, points.half_length, np.linspace(0.3, 1.0, len(points.x)))
    judged = [reanalyse(scene, design.x, design.half_length, design.rho, split).compliance for split in (1, 2, 4)]
    errors = [own_error(scene, design, by, split) for by, split in zip(judged, (2, 4), strict=False)]
    assert errors == [judged[1] / judged[0] - 1, judged[2] / judged[1] - 1]
    assert abs(errors[1]) < abs(errors[0]) < 0.1
