"""Designs that change as the points left of every fourth cell boundary are pushed over it."""

import numpy as np

from mpmtop.arrays import Array
from mpmtop.crossing import Periodic
from validation.bodies.scenes import SPACING, cantilever
from validation.harness.report import Report
from validation.methods.analyser import METHODS, SHAPE_FUNCTIONS, Optimisation, material_points

PLACES = np.round(np.arange(0.0, 0.49, 0.04), 2)
"""Distances [h]."""
CROSSES = 0.25
"""Distance [h] of the points from the boundary before them."""
ITERATIONS = 40
"""From here on the objective falls by less than a per cent, and the pictures no longer change."""
METHODS_SHOWN = ("standard", "GIMP")


def slide(report: Report) -> dict[str, Array]:
    """Record the designs on a slider; gives each method's objectives (k,) at PLACES."""
    scene = cantilever()
    seeded = METHODS["standard"](scene)
    fields: dict[str, list[Array]] = {}
    said: dict[str, list[str]] = {}
    own: dict[str, Array] = {}
    for name in METHODS_SHOWN:
        build = [material_points(SHAPE_FUNCTIONS[name], name, Periodic(4, float(d))) for d in PLACES]
        runs = [Optimisation.of(analyse(scene), iterations=ITERATIONS) for analyse in build]
        own[name] = np.array([run.final for run in runs])
        fields[f"{name} MPM" if name == "standard" else name] = [run.design.rho for run in runs]
        said[f"{name} MPM" if name == "standard" else name] = [
            f"own {run.final:.1f}, by points as seeded {seeded.compliance(run.design):.1f}" for run in runs
        ]
    report.frames(
        "slide",
        seeded.x,
        np.full(2, SPACING / 2),
        fields,
        PLACES.tolist(),
        f"Cantilevers after {ITERATIONS} iterations, the points left of one in four cell boundaries moved by a "
        f"distance; they cross at {CROSSES:g} h. Compliance [F²/E0] by the method's own points, and by standard MPM as "
        "seeded.",
        slides="distance / h",
        said=said,
    )
    return own
