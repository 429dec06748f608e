"""Scenes that several tests share, and all shape functions."""

from typing import Any

import numpy as np

from mpmtop.body import Body, Support
from mpmtop.design import Design
from mpmtop.loads import PointLoad, RegionLoad
from mpmtop.region import Rectangle
from mpmtop.scene import Scene
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3, gimp, tent
from validation.bodies.scenes import changed

SHAPE_FUNCTIONS: tuple[ShapeFunction, ...] = (tent, gimp, bspline2, bspline3)

LEFT_CLAMP = Support(Rectangle((-np.inf, -np.inf), (0.0, np.inf)))


def cantilever(
    nx: float = 8, ny: float = 4, *, shift: float = 0.0, load: PointLoad | RegionLoad | None = None, **changes: Any
) -> Scene:
    """nx x ny body whose left edge starts at `shift`, held at x <= 0, pulled down at mid-height of the right edge."""
    tip = PointLoad((nx + shift, ny / 2), (0.0, -1.0))
    body = Body(Rectangle((shift, 0.0), (nx + shift, ny)), (LEFT_CLAMP,), (tip,))
    return changed(Scene("cantilever", body, Design(0.4, 1.5)), **({"loads": (load or tip,)} | changes))
