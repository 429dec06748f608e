"""Several materials: a body with a closed form, its layers on and off the lines of the grid."""

import numpy as np
import pandas as pd

from mpmtop.arrays import Array
from mpmtop.body import Body, Material, Part, Support
from mpmtop.equilibrium import equilibrium
from mpmtop.loads import Traction
from mpmtop.region import Rectangle
from mpmtop.shape_functions import ShapeFunction, bspline2, gimp, tent
from reference_fem import elasticity
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.measures.orders import observed_order
from validation.studies.loads_and_supports.bodies import quiet

INF = np.inf
SIZES = (0.5, 0.25)
LENGTH, LOWER, UPPER = 8.0, 1.0, 1.0
SOFT, STIFF = 1.0, 10.0
NEUTRAL = (SOFT * LOWER**2 / 2 + STIFF * UPPER * (LOWER + UPPER / 2)) / (SOFT * LOWER + STIFF * UPPER)
"""Height of the neutral axis: of no force under any curvature."""
BENT = (
    SOFT * (NEUTRAL**3 - (NEUTRAL - LOWER) ** 3) + STIFF * ((LOWER + UPPER - NEUTRAL) ** 3 - (LOWER - NEUTRAL) ** 3)
) / 3
"""sum of E I of the layers about it: the moment of unit curvature."""


def modulus(x: Array) -> Array:
    """Young's modulus (n,) at x (n, 2)."""
    return np.where(x[:, 1] < LOWER, SOFT, STIFF)


def bimetal() -> Body:
    """Two layers on rollers, bent to unit curvature by the stresses E (y - NEUTRAL) of its far end."""
    rollers = Support(Rectangle((-INF, -INF), (0, INF)), (True, False))
    corner = Support(Rectangle((0, 0), (0, 0)), (False, True))
    height = LOWER + UPPER

    def bending(x: Array) -> Array:
        return np.column_stack([modulus(x) * (x[:, 1] - NEUTRAL), np.zeros(len(x))])

    load = Traction(Rectangle((LENGTH, 0), (LENGTH, height)), bending)
    upper = Part(Rectangle((0, LOWER), (LENGTH, height)), Material(STIFF, 0.0, "stress"))
    return Body(
        Rectangle((0, 0), (LENGTH, height)), (rollers, corner), (load,), Material(SOFT, 0.0, "stress"), (upper,)
    )


def by_points(h: float, function: ShapeFunction) -> tuple[float, float]:
    """Work of the end's stresses over that of the closed form less one, and the largest error of stress at a point by
    the largest stress."""
    model = quiet(bimetal(), h, 2, function)
    state = equilibrium(model, modulus(model.points.x))
    exact = modulus(model.points.x) * (model.points.x[:, 1] - NEUTRAL)
    stress = model.stress(state.moduli, state.strain)[:, 0]
    error = float(np.abs(stress - exact).max() / np.abs(exact).max())
    return float(model.f_ext @ state.u) / (BENT * LENGTH) - 1, error


def test_bimetal(report: Report, lock: Lock) -> None:
    """A beam of two metals

    8 x 2 in plane stress, nu = 0, the upper half ten times as stiff, bent by stresses E (y - y0) at its end, y0 the
    axis of no force. Composite beams have u_x = kappa x (y - y0) throughout, with the moment kappa sum(E I): exactly,
    for nu = 0. The work of the end's stresses is kappa times that moment times the length.
    """
    rows = {}
    for function in (tent, gimp, bspline2):
        for h in SIZES:
            rows[function.__name__, h] = by_points(h, function)
    for h in SIZES:
        fem = elasticity.discretise(bimetal(), h)
        work = float(fem.f_ext @ elasticity.solve(fem, modulus(fem.centres)))
        rows["Q1, on the grid's cells", h] = (work / (BENT * LENGTH) - 1, np.nan)
    table = pd.DataFrame.from_dict(rows, orient="index", columns=["work", "stress"])
    table.index = pd.MultiIndex.from_tuples(table.index, names=["function", "h"])
    report.table("bimetal", table, "Errors, relative", percent=["work", "stress"])
    checks = []
    for name in ("tent", "gimp", "bspline2"):
        coarse, fine = (abs(rows[name, h][0]) for h in SIZES)
        elements = abs(rows["Q1, on the grid's cells", SIZES[-1]][0])
        why = "composite beam; not worse than elements of the size of a cell"
        checks.append(report.check(f"work at h = 1/4, {name}", fine, at_most=elements, source="Q1", why=why))
        order = float(observed_order(coarse, fine))
        least = None if name == "bspline2" else 1.8
        checks.append(report.check(f"order in h, {name}", order, at_least=least, source="bilinear", why="2 less 10 %"))
    report.found(
        f"A beam of two metals, one ten times as stiff: work within {abs(rows['gimp', SIZES[-1]][0]):.1%} of the "
        "composite beam's (GIMP, eight cells over the depth)."
    )
    lock({f"{of} h = {h:g} work": 1 + row[0] for (of, h), row in rows.items()}, rtol=1e-6)
    assert all(checks)
