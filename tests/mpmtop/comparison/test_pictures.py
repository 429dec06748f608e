"""Pictures of a comparison."""

import numpy as np
from matplotlib import rc_context

from mpmtop.comparison.pictures import design_picture
from mpmtop.points import seed
from mpmtop.region import Rectangle


def test_a_design_is_drawn_alike_whatever_a_user_has_set() -> None:
    """A layout of one's own has no room about axes that fill the picture, and warned of it; a tight one cut it."""
    at = seed(Rectangle((0, 0), (4, 2)), (0.5, 0.5))
    rho = np.linspace(0, 1, len(at.volume))
    with rc_context({"figure.constrained_layout.use": True, "savefig.bbox": "tight", "savefig.facecolor": "red"}):
        own = design_picture(at, rho)
    assert own == design_picture(at, rho)
