"""Scenes that several tests share, and all shape functions."""

import numpy as np

from mpmtop.scene import Material, PointLoad, Rectangle, RegionLoad, Scene, Support
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3, gimp, tent

SHAPE_FUNCTIONS: tuple[ShapeFunction, ...] = (tent, gimp, bspline2, bspline3)

LEFT_CLAMP = Support(Rectangle((-np.inf, -np.inf), (0.0, np.inf)))


def cantilever(
    nx: float = 8, ny: float = 4, *, shift: float = 0.0, load: PointLoad | RegionLoad | None = None, **changes: object
) -> Scene:
    """nx x ny body whose left edge starts at `shift`, held at x <= 0, pulled down at mid-height of the right edge."""
    scene = {
        "name": "cantilever",
        "domain": Rectangle((shift, 0.0), (nx + shift, ny)),
        "supports": (LEFT_CLAMP,),
        "loads": (load or PointLoad((nx + shift, ny / 2), (0.0, -1.0)),),
        "filter_radius": 1.5,
        "material": Material(young=1.0, poisson=0.3),
    }
    return Scene(**(scene | changes))  # type: ignore[arg-type]
