"""Volumetric locking: Timoshenko's cantilever in plane strain, exact for every Poisson's ratio nu < 1/2.

Nothing of the solution is singular at nu = 1/2, where its dilatation vanishes; what fails there is the method's.
"""

from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from mpmtop.body import Material
from mpmtop.crossing import Crossing, Periodic, Uniform
from mpmtop.equilibrium import equilibrium
from mpmtop.model import discretise
from mpmtop.points import seed
from mpmtop.shape_functions import ShapeFunction
from reference_fem import elasticity
from validation.bodies.beam import beam, beam_body, beam_places, tip_error
from validation.measures.probe import displacement_at
from validation.methods.analyser import SHAPE_FUNCTIONS

POISSON = (-0.9, -0.5, 0.0, 0.3, 0.4, 0.45, 0.49, 0.499, 0.4999, 0.49999)
COARSE, FINE = 4, 8
"""Cells over the depth."""
SPACING = 0.5
"""Of the points [h]: 2 x 2 in a cell."""
UNCROSSED = Uniform(0.0)
SEEDED, CROSSED = "seeded", "crossed"
ARRANGEMENTS: dict[str, Crossing] = {SEEDED: UNCROSSED, CROSSED: Periodic(4)}
PLAIN, B_BAR = "plain", "B-bar"


class Errors(NamedTuple):
    """Tip displacement, relative and with its sign: negative is too stiff; and mean stress at the points, the root of
    the sum of V error^2 over that of V exact^2."""

    tip: float
    mean_stress: float


def plane_strain(poisson: float) -> Material:
    """E = 1 in plane strain."""
    return Material(1.0, poisson, "strain")


def by_points(
    n: int, shape_function: ShapeFunction, poisson: float, b_bar: bool, crossing: Crossing = UNCROSSED
) -> Errors:
    """Errors with n cells over the depth and 2 x 2 points in each, moved by `crossing`."""
    material = plane_strain(poisson)
    body = beam_body(n, material)
    points = crossing(seed(body.domain, (SPACING, SPACING)), body.domain)
    model = discretise(body, 1.0, points=points, shape_function=shape_function, b_bar=b_bar)
    state = equilibrium(model, np.ones(len(points.x)))
    at = model.at(beam_places(n)).displacement(state.u)
    # sigma_zz = nu (sigma_xx + sigma_yy): the sum of the two tells the mean of the three, up to a factor
    mean, exact = (stress[:, 0] + stress[:, 1] for stress in (state.strain @ model.D, beam(points.x, n).stress))
    V = points.volume
    return Errors(tip_error(at, n, material), float(np.sqrt(V @ (mean - exact) ** 2 / (V @ exact**2))))


def by_elements(n: int, order: int, poisson: float) -> float:
    """Error of the tip displacement with n elements over the depth."""
    material = plane_strain(poisson)
    model = elasticity.discretise(beam_body(n, material), 1.0, order)
    u = elasticity.solve(model, np.ones(len(model.area)))
    return tip_error(displacement_at(model, u, beam_places(n)), n, material)


def locking_errors(n: int = COARSE) -> dict[tuple[str, str], dict[float, float]]:
    """Error of the tip displacement for every nu of POISSON, by method and treatment of the dilatation.

    GIMP is left out: no point's domain leaves its cell, so that it is the standard method.
    """
    errors = {
        (name, treatment): {nu: by_points(n, function, nu, treatment == B_BAR).tip for nu in POISSON}
        for treatment in (PLAIN, B_BAR)
        for name, function in SHAPE_FUNCTIONS.items()
        if name != "GIMP"
    }
    return errors | {(f"FEM Q{order}", PLAIN): {nu: by_elements(n, order, nu) for nu in POISSON} for order in (1, 2)}


def arrangement_errors(poisson: tuple[float, ...], n: int = FINE) -> dict[tuple[str, str, str], dict[float, Errors]]:
    """Errors for the given nu, by arrangement of the points, shape function and treatment of the dilatation."""
    return {
        (arrangement, name, treatment): {nu: by_points(n, function, nu, treatment == B_BAR, crossing) for nu in poisson}
        for arrangement, crossing in ARRANGEMENTS.items()
        for name, function in SHAPE_FUNCTIONS.items()
        for treatment in (PLAIN, B_BAR)
    }


def locking_figure(errors: dict[tuple[str, str], dict[float, float]]) -> Figure:
    """|error| of `locking_errors` against 1/2 - nu, which falls from left to right; one panel for each treatment."""
    figure, axes = plt.subplots(1, 2, figsize=(8.0, 4.2), sharex=True, sharey=True)
    for ax, treatment in zip(axes, (PLAIN, B_BAR), strict=True):
        for method in (name for name, of in errors if of == treatment):
            nu, error = np.array(list(errors[method, treatment].items())).T
            ax.loglog(0.5 - nu, np.abs(error), marker="o", markersize=4, label=method)
        ax.set(title=treatment, xlabel="1/2 − ν")
    axes[0].set(ylabel="|relative error|, tip displacement")
    axes[0].invert_xaxis()
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure
