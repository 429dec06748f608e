"""A column under its own weight: AMPLE's finite-strain benchmark, and one linear analysis on the same points.

Column of height l0 = 50 and the width of one cell, E = 1e4, nu = 0, rho g l0 = 4e4, base held, sides on rollers. It is
statically determinate: the Cauchy stress at the point of initial height Y is -rho g (l0 - Y) whatever the law.

AMPLE's law is Hencky's, the Kirchhoff stress linear in the logarithmic strain. With nu = 0 the width stays, J is the
stretch l, and l sigma = E ln l, so that E ln(l) / l = -w(Y), w = rho g (l0 - Y). With ln l = -z this is
z exp(z) = w / E, so z = W(w / E) by Lambert's W, and as d(w / E) = (1 + z) exp(z) dz the height is closed, too:

    y(Y) = int_0^Y l dY = E / (rho g) [z + z^2 / 2] from z(Y) to z(0).

Source: W. M. Coombs and C. E. Augarde, AMPLE, Adv. Eng. Softw. 139 (2020) 102748.
"""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.special import lambertw

from mpmtop.arrays import Array
from mpmtop.body import Body, Material, Support
from mpmtop.equilibrium import equilibrium
from mpmtop.grid import Grid
from mpmtop.large_deformation import model as large
from mpmtop.large_deformation.kinematics import Domains
from mpmtop.large_deformation.law import jacobian, kirchhoff, stress
from mpmtop.large_deformation.steps import trajectory
from mpmtop.loads import RegionLoad
from mpmtop.model import discretise
from mpmtop.points import MaterialPoints, seed
from mpmtop.region import Rectangle
from mpmtop.shape_functions import ShapeFunction

LENGTH = 50.0  # l0
YOUNG = 1e4
BASE_STRESS = 4e4  # rho g l0
AMPLE = Path(__file__).parents[1] / "data" / "ample" / "selfweight_ample.csv"


class Deformed(NamedTuple):
    """Height y (p,) and stretch l (p,) of what was at the heights Y (p,)."""

    y: Array
    stretch: Array


def stretch_of(load: Array) -> Array:
    """Stretch l (p,) of Hencky's law under compressive Cauchy stresses load (p,), by E: E ln(l) / l = -load."""
    stretch: Array = np.exp(-lambertw(load).real)
    return stretch


def hencky(Y: Array) -> Deformed:
    """The column of AMPLE's law in equilibrium, at initial heights Y (p,); see the module's docstring."""
    z, base = (lambertw(BASE_STRESS / YOUNG * (1 - height / LENGTH)).real for height in (np.asarray(Y), 0.0))
    height = LENGTH * YOUNG / BASE_STRESS
    return Deformed(height * ((base + base**2 / 2) - (z + z**2 / 2)), np.exp(-z))


class ColumnErrors(NamedTuple):
    """Stress error sum |sigma_yy - exact| V / (rho g l0 sum V), V being initial volumes or the arrangement's."""

    initial_volume: float
    volume: float


def column(h: float) -> Body:
    """The column, one cell of size h wide; its weight is a body force."""
    inf = np.inf
    body = Rectangle((0.0, 0.0), (h, LENGTH))
    base, left, right = (
        Rectangle((-inf, -inf), (inf, 0.0)),
        Rectangle((-inf, -inf), (0.0, inf)),
        Rectangle((h, -inf), (inf, inf)),
    )
    return Body(
        body,
        (Support(base, (False, True)), Support(left, (True, False)), Support(right, (True, False))),
        material=Material(young=YOUNG, poisson=0.0, plane="strain"),
    )


def errors(cells: int, shape_function: ShapeFunction, *, deformed: bool) -> ColumnErrors:
    """Errors of one linear analysis, l0 / h = `cells`, 2 x 2 points per cell of the undeformed column.

    `deformed` puts the points where Hencky's law takes them, their volumes and half-lengths stretched with them.
    """
    h = LENGTH / cells
    body = column(h)
    points = initial = seed(body.domain, (h / 2, h / 2))
    Y = initial.x[:, 1]
    if deformed:
        y, stretch = hencky(Y)
        points = MaterialPoints(
            np.stack([initial.x[:, 0], y], axis=1),
            initial.volume * stretch,
            initial.half_length * np.stack([np.ones_like(stretch), stretch], axis=1),
        )
    model = discretise(body, h, shape_function=shape_function, points=points)
    weight = BASE_STRESS / LENGTH * initial.volume  # of the masses, which points keep
    f = model.transfer.N_matrix.T @ np.outer(weight, [0.0, -1.0])
    state = equilibrium(model, np.full(len(Y), YOUNG), f_ext=f.ravel())
    error = np.abs(model.stress(state.moduli, state.strain)[:, 1] + BASE_STRESS * (1 - Y / LENGTH)) / BASE_STRESS
    by_initial, by_volume = (float(np.average(error, weights=p.volume)) for p in (initial, points))
    return ColumnErrors(by_initial, by_volume)


def load_steps_error(cells: int, shape_function: ShapeFunction, domains: Domains, steps: int = 40) -> float:
    """Stress error of the column in load steps, by initial volumes; the Cauchy stress is what statics says."""
    h = LENGTH / cells
    body = column(h)
    body = replace(body, loads=(RegionLoad(body.domain, (0.0, -BASE_STRESS * h)),))
    box = Grid((-h, -h), (h, h), (3, cells + 2))
    model = large.discretise(body, shape_function=shape_function, steps=steps, domains=domains, alpha=0.0, grid=box)
    F = trajectory(model, np.full(len(model.points.x), YOUNG)).states[-1].F
    cauchy = YOUNG * kirchhoff(stress(model.law, F), F)[:, 1, 1] / jacobian(F)
    exact = -BASE_STRESS * (1 - model.points.x[:, 1] / LENGTH)
    return float(np.mean(np.abs(cauchy - exact)) / BASE_STRESS)


def ample() -> pd.DataFrame:
    """AMPLE's results: stress error and smallest displacement [length] by shape function and number of cells."""
    table = pd.read_csv(AMPLE).rename(columns={"nelsy": "cells", "stress_error_volume_weighted": "error"})
    return table.replace({"type": {"mpm": "standard", "gimp": "GIMP"}}).set_index(["type", "cells"])[
        ["error", "min_uy"]
    ]
