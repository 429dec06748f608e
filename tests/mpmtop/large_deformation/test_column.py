"""AMPLE's column under its own weight, compacted to half its length: stresses in closed form.

50 m high, one cell wide between rollers, E = 10 kPa, nu = 0, 800 N/m^3. With nu = 0 a dead weight leaves the first
Piola-Kirchhoff stress linear in the height, -w (L - Y), and the Cauchy stress is the same: areas stay.
Source: Coombs and Augarde (2020), Adv. Engng Software 146:102828, Sect. 5.
"""

import numpy as np
import pytest

from mpmtop.body import Body, Material, Support
from mpmtop.grid import Grid
from mpmtop.large_deformation.law import jacobian, kirchhoff, stress
from mpmtop.large_deformation.model import Domains, discretise
from mpmtop.large_deformation.steps import trajectory
from mpmtop.loads import RegionLoad
from mpmtop.region import Rectangle
from mpmtop.shape_functions import ShapeFunction, gimp, tent

INF = np.inf
LENGTH, WEIGHT, YOUNG = 50.0, 800.0, 1e4


def stress_error(cells: int, shape_function: ShapeFunction, domains: Domains) -> float:
    """Mean |stress error| over the points, by the stress at the bottom; 40 load steps."""
    h = LENGTH / cells
    base = Support(Rectangle((-INF, -INF), (INF, 0.0)))
    rollers = [
        Support(Rectangle(*sides), (True, False)) for sides in (((-INF, -INF), (0, INF)), ((h, -INF), (INF, INF)))
    ]
    load = RegionLoad(Rectangle((-INF, -INF), (INF, INF)), (0.0, -WEIGHT * h * LENGTH))
    domain = Rectangle((0, 0), (h, LENGTH))
    scene = Body(domain, (base, *rollers), (load,), Material(YOUNG, 0.0))
    box = Grid((-h, -h), (h, h), (3, cells + 2))
    model = discretise(scene, h, 2, shape_function, steps=40, domains=domains, alpha=0.0, grid=box)
    F = trajectory(model, np.full(len(model.points.x), YOUNG)).states[-1].F
    cauchy = YOUNG * kirchhoff(stress(model.law, F), F)[:, 1, 1] / jacobian(F)
    exact = -WEIGHT * (LENGTH - model.points.x[:, 1])
    return float(np.mean(np.abs(cauchy - exact)) / (WEIGHT * LENGTH))


def test_gimp_converges() -> None:
    """Domains that follow the points: second order or nearly, and 2e-3 at 32 cells."""
    coarse, fine = (stress_error(cells, gimp, "stretched") for cells in (16, 32))
    assert fine < 2e-3
    assert np.log2(coarse / fine) > 1.5


@pytest.mark.parametrize("cells", [16, 32])
def test_tent_does_not(cells: int) -> None:
    """Crossing leaves an error that refinement does not take away."""
    assert stress_error(cells, tent, "fixed") > 5e-2
