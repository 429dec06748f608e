"""Clamps: a cantilever at an angle to the grid, and a bar whose end lies between its lines."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from mpmtop.arrays import Array
from mpmtop.body import Body, EdgeSupport, Material
from mpmtop.equilibrium import equilibrium
from mpmtop.grid import Grid
from mpmtop.loads import RegionLoad, Traction
from mpmtop.points import MaterialPoints, seed
from mpmtop.region import HalfPlane, Polygon, Rectangle
from mpmtop.shape_functions import ShapeFunction, bspline2, gimp, tent
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.measures.orders import observed_order
from validation.studies.loads_and_supports.bodies import quiet

INF = np.inf
NU = 0.3
LENGTH, DEPTH, CLAMPED = 8.0, 2.0, 201.50
"""The cantilever, and its compliance by biquadratic elements, 128 x 32."""
ANGLES = (20.0, 30.0, 45.0)
SIZES = (0.5, 0.25, 0.125)


def turned(degrees: float) -> tuple[Body, Array]:
    """The cantilever at an angle to the grid, and the rotation (2, 2) that turns it."""
    t = np.radians(degrees)
    R = np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]])

    def box(x0: float) -> Polygon:
        corners = ((x0, -DEPTH / 2), (LENGTH, -DEPTH / 2), (LENGTH, DEPTH / 2), (x0, DEPTH / 2))
        return Polygon(tuple((float(x), float(y)) for x, y in np.array(corners) @ R.T))

    across, along = R @ (0.0, -1.0), R @ (1.0, 0.0)
    load = RegionLoad(box(LENGTH - 1), (float(across[0]), float(across[1])))
    edge = EdgeSupport(HalfPlane((0, 0), (float(along[0]), float(along[1]))))
    return Body(box(0.0), (edge,), (load,), Material(1.0, NU)), R


def cantilever(h: float, degrees: float, ppc: int, function: ShapeFunction, cut: bool = False) -> float:
    """Compliance, relative to CLAMPED less one, of the cantilever, turned with its points or `cut` out of the grid."""
    body, R = turned(degrees)
    if cut:
        model = quiet(body, h, ppc, function, cut=True)
    else:
        straight = seed(Rectangle((0, -DEPTH / 2), (LENGTH, DEPTH / 2)), (h / ppc, h / ppc))
        points = MaterialPoints(straight.x @ R.T, straight.volume, straight.half_length)
        model = quiet(body, h, None, function, points=points)
    return float(model.f_ext @ equilibrium(model, np.ones(len(model.points.x))).u) / CLAMPED - 1


TURNED = {
    "tent, 4 per cell": (4, tent, False),
    "GIMP, 2 per cell": (2, gimp, False),
    "tent, 2 per cell, cut": (2, tent, True),
    "quadratic B-spline, 2 per cell, cut": (2, bspline2, True),
}
ALSO = {
    "tent, 2 per cell": (2, tent, False),
    "quadratic B-spline, 2 per cell": (2, bspline2, False),
}
"""At the finest grid only."""


@pytest.mark.slow
def test_turned_cantilever(report: Report, lock: Lock) -> None:
    """A cantilever at an angle to the grid

    8 x 2, clamped along its short side by `EdgeSupport`; its points are turned with it, or cut out of the grid's cells
    along its outline (`discretise(cut=True)`). Domains of GIMP stay parallel to the axes; turned points of tents are no
    quadrature of the cells.
    """
    finest = SIZES[-1]
    of = {(name, d): [cantilever(h, d, *how) for h in SIZES] for name, how in TURNED.items() for d in ANGLES}
    of |= {(name, d): [np.nan, np.nan, cantilever(finest, d, *how)] for name, how in ALSO.items() for d in ANGLES}
    columns = [f"h = {h:g}" for h in SIZES]
    table = pd.DataFrame.from_dict(of, orient="index", columns=columns)
    table.index = pd.MultiIndex.from_tuples(table.index, names=["points", "degrees"])
    report.table("cantilever", table, f"Compliance over {CLAMPED:g} less one", percent=columns)
    errors = {name: np.abs([of[name, d] for d in ANGLES]) for name in (*TURNED, *ALSO)}
    most = {name: float(each[:, -1].max()) for name, each in errors.items()}
    checks = []
    for name in TURNED:
        spline = "B-spline" in name
        why = "asked; a clamp of nodes leaves 4 to 8 %"
        bound = 0.04 if spline else 0.02
        checks.append(
            report.check(f"largest error at h = 1/8, {name}", most[name], at_most=bound, source="Q2", why=why)
        )
        order = float(observed_order(errors[name][:, 0].mean(), errors[name][:, -1].mean(), 4.0))
        least = None if spline else 1.5  # asked of tent and GIMP
        checks.append(report.check(f"order in h, {name}", order, at_least=least, source="asked", why="mean of angles"))
    by_name = ", ".join(f"{name} within {most[name]:.1%}" for name in TURNED)
    report.found(f"A clamp at 20 to 45 degrees to the grid, 16 cells over the depth: {by_name}.")
    worst, cut = (max(most[f"{f}, 2 per cell{end}"] for f in ("tent", "quadratic B-spline")) for end in ("", ", cut"))
    report.so(
        "Clamp a body off the grid along its outline (`EdgeSupport`), and cut its points along it (`cut=True`): with "
        f"two per cell and direction {cut:.1%} instead of {worst:.1%} at worst."
        if cut < worst
        else "Points that are cut along the outline make the clamp no better here."
    )
    lock(
        {
            f"{name} {d:g} {column}": 1 + error
            for (name, d), row in of.items()
            for column, error in zip(columns, row, strict=True)
            if not np.isnan(error)
        },
        rtol=1e-6,
    )
    assert all(checks)


BAR, BAR_DEPTH = 8.0, 4.0
BETWEEN = (0.0, 0.1, 0.2, 0.2499, 0.2501, 0.3, 0.4, 0.5, 0.6, 0.7, 0.7499, 0.7501, 0.8, 0.9)
"""Where the clamped edge lies in its cell: a column of points changes cells at a quarter and at three."""


def bar(shift: float, function: ShapeFunction, cut: bool = False) -> float:
    """Extension, over the exact one less one, of a bar clamped `shift` of a cell behind a line of the grid."""
    held = EdgeSupport(Rectangle((0, -INF), (0, INF)))
    pull = Traction(Rectangle((BAR, -INF), (BAR, INF)), (1 / BAR_DEPTH, 0.0))
    body = Body(Rectangle((0, 0), (BAR, BAR_DEPTH)), (held,), (pull,), Material(1.0, 0.0))
    grid = Grid((-3.0 - shift, -3.0), (1.0, 1.0), (15, 10))
    model = quiet(body, None, 2, function, grid=grid, cut=cut)
    return float(model.f_ext @ equilibrium(model, np.ones(len(model.points.x))).u) * BAR_DEPTH / BAR - 1


def test_bar(report: Report, lock: Lock) -> None:
    """A bar clamped between the grid's lines

    8 x 4, two points per cell and direction, pulled by a traction, nu = 0; the grid is moved along it. A tent counts a
    point wholly to one cell, and so fills the cell at the edge too much or too little. GIMP shares a domain out among
    cells; points cut out of the cells fill each as the body does.
    """
    kinds = {"tent": (tent, False), "GIMP": (gimp, False), "tent, cut": (tent, True)}
    errors = {name: np.array([bar(shift, *how) for shift in BETWEEN]) for name, how in kinds.items()}
    figure, ax = plt.subplots(figsize=(4.6, 2.6))
    for (name, error), style in zip(errors.items(), ("o-", "s-", "x--"), strict=True):
        ax.plot(BETWEEN, 100 * error, style, markersize=4, label=name)
    ax.set(xlabel="clamped edge behind a line of the grid [cells]", ylabel="error of the extension [%]")
    ax.legend(fontsize="small")
    report.figure("bar", figure, "Extension of the bar by where the grid's lines run.")
    most = {name: float(np.abs(error).max()) for name, error in errors.items()}
    checks = [
        report.check(f"largest error at any shift, {name}", most[name], at_most=0.01, source="u = F L / (E W)")
        for name in ("GIMP", "tent, cut")
    ]
    report.check("largest error at any shift, tent", most["tent"], source="a cell is filled by half a point too much")
    report.found(
        f"A bar of eight cells clamped between lines: tent off by up to {most['tent']:.1%}, GIMP by "
        f"{most['GIMP']:.1%}, tent with points cut along the outline by {most['tent, cut']:.1%}."
    )
    lock({f"tent {shift:g}": 1 + error for shift, error in zip(BETWEEN, errors["tent"], strict=True)}, rtol=1e-9)
    assert all(checks)
