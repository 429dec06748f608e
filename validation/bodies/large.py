"""Bodies in large deformation, and the methods that analyse them, by name."""

from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipeinc, ellipkinc

from mpmtop.arrays import Array
from mpmtop.body import Body, Material, Support
from mpmtop.grid import Grid
from mpmtop.large_deformation.model import Model, discretise
from mpmtop.large_deformation.steps import Trajectory
from mpmtop.loads import RegionLoad
from mpmtop.region import Rectangle
from mpmtop.shape_functions import bspline2, gimp, tent
from reference_fem import elasticity
from reference_fem.large_deformation import LargeModel, LogarithmicLaw, large_model, load_steps

TOTAL, TENT, GIMP, STRETCHED, SPLINE = "total Lagrange", "tent", "GIMP", "GIMP, stretched", "B-spline"
METHODS: dict[str, dict[str, Any]] = {
    TOTAL: {"shape_function": tent, "frame": "total", "alpha": 0.0},
    TENT: {"shape_function": tent},
    GIMP: {"shape_function": gimp},
    STRETCHED: {"shape_function": gimp, "domains": "stretched"},
    SPLINE: {"shape_function": bspline2},
}
"""`mpmtop.large_deformation.model.discretise`: all but the first in the updated frame, on the soft background."""
Q2 = "FEM Q2"
INF = np.inf


def beam(length: float, poisson: float, load: float, tip: float) -> Body:
    """Cantilever of depth 1 in plane strain, E = 1, under P L^2 / EI = `load` across it, with E / (1 - nu^2) for E.

    P is spread evenly over the part within `tip` of its end; L is the arm of its middle.
    """
    arm = length - tip / 2
    force = load / 12 / (1 - poisson**2) / arm**2
    end = Rectangle((length - tip, 0.0), (length, 1.0))
    clamp = Support(Rectangle((-INF, -INF), (0.0, INF)))
    return Body(
        Rectangle((0.0, 0.0), (length, 1.0)), (clamp,), (RegionLoad(end, (0.0, -force)),), Material(1.0, poisson)
    )


def box(body: Body, h: float) -> Grid:
    """Cells of side h that hold a cantilever whose tip goes down, all the way; two units of length are left around."""
    lower, upper = body.domain.bounds
    length, side = float(upper[0]), int(np.ceil(2 / h))
    across, down = int(np.ceil(length / h)), int(np.ceil((upper[1] - lower[1]) / h))
    return Grid((-side * h, -(across + side) * h), (h, h), (across + 2 * side, across + down + 2 * side))


def points_of(body: Body, h: float, ppc: int, steps: int, method: str, **how: float) -> Model:
    """A cantilever of depth 1 by a method, on cells of side h with ppc x ppc points; `how` goes before the method's."""
    return discretise(body, ppc=ppc, steps=steps, grid=box(body, h), **(METHODS[method] | how))


def elements_of(body: Body, h: float, order: int = 2) -> LargeModel:
    """The body by elements of side h, in the law of `points_of`."""
    return large_model(elasticity.discretise(body, h, order), LogarithmicLaw(body.material.poisson))


def deflections(model: Model, path: Trajectory) -> Array:
    """Deflection (steps,) of the load, the mean of what it acts on, at the end of each step."""
    share = model.force[:, 1] / model.force[:, 1].sum()
    return np.array([-share @ path.displacement(n)[:, 1] for n in range(1, model.steps + 1)])


def deflections_of_elements(model: LargeModel, levels: Array) -> Array:
    """The same (levels,) at the load levels."""
    f = model.fem.f_ext
    moduli = np.full(len(model.fem.area), model.fem.body.material.young)
    return np.array([-f @ u / f.sum() for u in load_steps(model, moduli, levels)])


def elastica(load: float) -> tuple[float, float]:
    """Tip displacements (along, across) by length of a cantilever under P L^2 / EI = `load` across it, in closed form.

    With the angle a at the tip, k^2 = (1 + sin a) / 2 and sin p = 1 / (k sqrt 2): sqrt(load) = K(k) - F(p, k), across
    = 1 - 2 (E(k) - E(p, k)) / sqrt(load), along = 1 - sqrt(2 sin a / load). Source: Bisshopp and Drucker (1945),
    Quart. Appl. Math. 3:272.
    """

    def part(a: float) -> tuple[float, float]:
        m = (1 + np.sin(a)) / 2
        p = np.arcsin(1 / np.sqrt(2 * m))
        return ellipkinc(np.pi / 2, m) - ellipkinc(p, m), ellipeinc(np.pi / 2, m) - ellipeinc(p, m)

    a = brentq(lambda a: part(a)[0] - np.sqrt(load), 1e-9, np.pi / 2 - 1e-9, xtol=1e-14)
    return 1 - np.sqrt(2 * np.sin(a) / load), 1 - 2 * part(a)[1] / np.sqrt(load)
