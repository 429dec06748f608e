"""What the sections share: a model of a body that lies off the grid."""

import warnings
from typing import Any

from mpmtop.body import Body
from mpmtop.diagnose import ModelWarning
from mpmtop.model import Model, discretise
from mpmtop.shape_functions import ShapeFunction, gimp, tent


def quiet(body: Body, h: float | None, ppc: int | None, function: ShapeFunction, **how: Any) -> Model:
    """A model; that bodies lie off the grid is what is looked at, not to be warned of."""
    ghost = 0.01 if function in (tent, gimp) else 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        return discretise(body, h, ppc, function, ghost=ghost, **how)
