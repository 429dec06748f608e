"""The bodies of the independent codes' results, see validation/data/large_deformation, and all methods by name."""

from pathlib import Path

import numpy as np
import pandas as pd

from mpmtop.body import Body, Material, Support
from mpmtop.grid import Grid
from mpmtop.large_deformation.law import Law
from mpmtop.large_deformation.model import Model, discretise
from mpmtop.loads import RegionLoad
from mpmtop.region import Rectangle
from mpmtop.shape_functions import ShapeFunction, bspline2, gimp, tent

DATA = Path(__file__).parents[3] / "validation" / "data" / "large_deformation"
INF = np.inf
PROTOTYPE = {
    "tl_tent": {"shape_function": tent, "frame": "total", "alpha": 0.0},
    "ul_gimp": {"shape_function": gimp, "alpha": 0.0},
    "ul_gimpU": {"shape_function": gimp, "domains": "stretched", "alpha": 0.0},
    "ul_gimpU_soft": {"shape_function": gimp, "domains": "stretched"},
    "ul_tent_soft": {"shape_function": tent},
}
METHODS = {
    "total": {"shape_function": tent, "frame": "total", "alpha": 0.0},
    "total, GIMP, background": {"shape_function": gimp, "frame": "total"},
    "tent": {"shape_function": tent},
    "GIMP": {"shape_function": gimp},
    "GIMP, free": {"shape_function": gimp, "alpha": 0.0},
    "GIMP, stretched": {"shape_function": gimp, "domains": "stretched"},
    "bspline2": {"shape_function": bspline2},
}


def cantilever(load: float = 0.06, loaded: float = 2.0) -> Body:
    """The prototype's: 20 x 10, held at x <= 0, a load downwards on the points within `loaded` of the tip's middle."""
    tip = Rectangle((18.0, 5.0 - loaded), (20.0, 5.0 + loaded))
    clamp = Support(Rectangle((-INF, -INF), (0.0, INF)))
    return Body(Rectangle((0, 0), (20, 10)), (clamp,), (RegionLoad(tip, (0.0, -load)),))


def model(method: dict, *, load: float = 0.06, steps: int = 8, law: Law | None = None) -> Model:
    """The prototype's cantilever by a method: 200 points."""
    box = Grid((-8.0, -20.0), (2.0, 2.0), (20, 23))
    return discretise(cantilever(load), steps=steps, law=law, grid=box, **method)


def moduli() -> np.ndarray:
    """The prototype's point moduli."""
    return pd.read_csv(DATA / "gradient.csv").E.to_numpy()


def ample(shape_function: ShapeFunction) -> Model:
    """AMPLE's beam. Its grid ends at x = 0; here nodes beyond are held."""
    supports = (
        Support(Rectangle((-INF, -INF), (-0.1, INF))),
        Support(Rectangle((0.0, -INF), (0.0, INF)), (True, False)),
        Support(Rectangle((0.0, 9.5), (0.0, 9.5)), (False, True)),
    )
    load = RegionLoad(Rectangle((9.875, 9.375), (10.0, 9.625)), (0.0, -30e3))
    body = Body(Rectangle((0, 9), (10, 10)), supports, (load,), Material(12e6, 0.2))
    box = Grid((-0.5, 0.0), (0.5, 0.5), (23, 20))
    domains = "stretched" if shape_function is gimp else "fixed"
    return discretise(body, None, 4, shape_function, steps=6, domains=domains, alpha=0.0, grid=box)
