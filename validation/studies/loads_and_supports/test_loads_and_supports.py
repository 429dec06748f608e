"""Loads and supports off the grid

Do tractions, pressure, weight, displacements and clamps act where the body says, wherever the lines of the grid run?
Bodies with answers known otherwise: Lame's thick ring, a cantilever at an angle to the grid, a tensile test by a
displacement, a column under its weight, and a beam of two metals. Units: h = E0 = 1 unless said.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from mpmtop import plot
from mpmtop.arrays import Array
from mpmtop.at_points import fields_at_points
from mpmtop.body import Body, Material, Support
from mpmtop.design import Design
from mpmtop.equilibrium import equilibrium
from mpmtop.loads import Pressure, Weight
from mpmtop.points import seed
from mpmtop.region import Circle, Difference, Intersection, Rectangle
from mpmtop.scene import Scene
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3, gimp, tent
from reference_fem import elasticity
from validation.bodies.sketch import CHOSEN
from validation.harness.lock import Lock
from validation.harness.report import Report
from validation.measures.orders import observed_order
from validation.studies.loads_and_supports.bodies import quiet
from validation.studies.loads_and_supports.test_clamps import turned

ASKED = "Do loads and supports act where the body says, wherever the grid's lines run?"
THEN = ("test_clamps", "test_materials")

INF = np.inf
NU = 0.3
INNER, OUTER = 4.0, 8.0
RING = Body(
    Intersection(Difference(Circle((0, 0), OUTER), Circle((0, 0), INNER)), Rectangle((0, 0), (OUTER, OUTER))),
    (Support(Rectangle((0, -INF), (0, INF)), (True, False)), Support(Rectangle((-INF, 0), (INF, 0)), (False, True))),
    (Pressure(Circle((0, 0), INNER), 1.0),),
    Material(1.0, NU),
)
A = INNER**2 / (OUTER**2 - INNER**2)
RING_SIZES = (1.0, 0.5, 0.25)
STAIRS_POINTS, CUT_POINTS = 4, 2
"""Per cell and direction: two leave 0.5 % of stairs in the ring at h = 1/4, points that are cut along its outline
less than 0.05 %."""


def displaced(r: Array) -> Array:
    """Lame's u_r under a pressure of one in plane strain."""
    return (1 + NU) * A * ((1 - 2 * NU) * r + OUTER**2 / r)


def around(h: float, function: ShapeFunction, cut: bool = False) -> tuple[Array, Array, Array]:
    """Radius, radial displacement and hoop stress (p,) of the ring's points."""
    model = quiet(RING, h, CUT_POINTS if cut else STAIRS_POINTS, function, cut=cut)
    state = equilibrium(model, np.ones(len(model.points.x)))
    r = np.hypot(*model.points.x.T)
    n = model.points.x / r[:, None]
    xx, yy, xy = model.stress(state.moduli, state.strain).T
    hoop = n[:, 1] ** 2 * xx + n[:, 0] ** 2 * yy - 2 * n[:, 0] * n[:, 1] * xy
    return r, np.sum(model.transfer.interpolate(state.u) * n, axis=1), hoop


def ring(h: float, function: ShapeFunction, cut: bool = False) -> tuple[float, float]:
    """Root mean square of the error of u_r over u_r at the hole, and the error of the hoop stress there, by a parabola
    through the points within two cells of it."""
    r, u, hoop = around(h, function, cut)
    error = u - displaced(r)
    near = r < INNER + 2 * h
    at_hole = np.polyfit(r[near] - INNER, hoop[near], 2)[-1]
    return float(np.sqrt(np.mean(error**2)) / displaced(np.array(INNER))), float(
        at_hole / (A * (1 + OUTER**2 / INNER**2)) - 1
    )


def hole_on_stairs(h: float) -> float:
    """Radius of the hole, over that of the circle less one: of the disc as large as the rectangles that it lacks."""
    side = h / STAIRS_POINTS
    centres = seed(Rectangle((0, 0), (OUTER, OUTER)), (side, side)).x
    lacking = np.count_nonzero(~RING.domain.contains(centres) & (np.hypot(*centres.T) < INNER + h))
    return float(np.sqrt(4 * lacking * side**2 / np.pi)) / INNER - 1


def opening(report: Report) -> None:
    """The two bodies that fit no grid, on one, with points cut along their outlines."""
    figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.4))
    bodies = {"ring under pressure": RING, "cantilever at 30 degrees": turned(30.0)[0]}
    for ax, (name, body) in zip(axes, bodies.items(), strict=True):
        plot.scene(Scene(name, body, Design(1.0, 1.0)), quiet(body, 1.0, CUT_POINTS, tent, cut=True), ax)
        ax.get_legend().remove()
    caption = (
        "Blue: held, by nodes (circles in one component, squares) or along the edge; orange: loads. Cells of h = 1."
    )
    report.opening.figure("scene", figure, caption)
    rows = {
        "ring": "radii 4 and 8, a quarter on rollers, pressure 1, nu = 0.3, plane strain",
        "cantilever": "8 x 2 at 20, 30 and 45 degrees, nu = 0.3, plane strain, force 1 over its last unit",
        "bar": "8 x 4, clamped between two lines of the grid, nu = 0",
    }
    table = pd.DataFrame({"value": list(rows.values()), "source": CHOSEN}, index=pd.Index(rows, name="parameter"))
    report.opening.table("parameters", table, "Parameters; E0 = 1 unless stated.")


def test_ring(report: Report, lock: Lock) -> None:
    """Lame's ring under inner pressure

    A quarter of a ring (4 to 8) on rollers; the pressure acts on the circle itself. Its material is on stairs of the
    lattice, four points per cell and direction, or two that are cut along the outline (`discretise(cut=True)`). The
    hoop stress at the hole is read by a parabola through the points within two cells of it: the stress of a single
    point of the stairs is that of a corner.
    """
    opening(report)
    kinds = {"tent": (tent, False), "gimp": (gimp, False), "tent, cut": (tent, True)}
    rows = {(name, h): ring(h, *how) for name, how in kinds.items() for h in RING_SIZES}
    fem = {("Q1, one for each point", h): (q1_ring(h / 4), np.nan) for h in RING_SIZES[1:2]}
    shown = [
        (f"{name}, h = {h:g}", u, hoop, hole_on_stairs(h) if "cut" not in name else np.nan)
        for (name, h), (u, hoop) in (rows | fem).items()
    ]
    columns = ["displacement", "hoop stress at the hole", "radius of the hole"]
    table = pd.DataFrame([row[1:] for row in shown], index=[row[0] for row in shown], columns=columns)
    caption = (
        "Errors, relative: u_r in root mean square over the points or nodes, hoop stress by a parabola, and the radius "
        "of a hole as large as what the stairs leave open."
    )
    report.table("ring", table.rename_axis("method"), caption, percent=columns)
    draw_ring(report)
    best = rows["tent, cut", RING_SIZES[-1]]
    report.found(
        f"Lame's ring: displacement off by {rows['gimp', 0.25][0]:.2%}, hoop stress at the hole by "
        f"{abs(rows['gimp', 0.25][1]):.1%} on stairs of four points per cell and direction; {best[0]:.2%} and "
        f"{abs(best[1]):.1%} with two that are cut along the outline."
    )
    lock(
        {f"{n}, h = {h:g} {c}": v for (n, h), row in rows.items() for c, v in zip(columns[:2], row, strict=True)},
        rtol=1e-6,
    )
    assert ring_checks(report, rows)


def ring_checks(report: Report, rows: dict[tuple[str, float], tuple[float, float]]) -> bool:
    """Bounds at the finest grid, and what falls."""
    checks = []
    for name in ("tent", "gimp", "tent, cut"):
        at_point, at_hole = np.abs([rows[name, h] for h in RING_SIZES]).T
        asked = "asked: forces shared by points left 0.45 to 1.39 of it"
        checks += [
            report.check(f"displacement at h = 1/4, {name}", at_point[2], at_most=0.005, source="Lame", why=asked),
            report.check(f"hoop stress at h = 1/4, {name}", at_hole[2], at_most=0.05, source="Lame", why=asked),
            report.check(
                f"displacement falls, {name}", at_point[2] / at_point[0], at_most=0.5, source="Lame", why="h to h / 4"
            ),
        ]
    order = float(observed_order(*(rows["tent, cut", h][0] for h in RING_SIZES[1:])))
    hoop = [abs(rows["tent, cut", h][1]) for h in RING_SIZES]
    stall = abs(hole_on_stairs(RING_SIZES[2]) / hole_on_stairs(RING_SIZES[1]))
    checks += [
        report.check("last order of the displacement, cut", order, at_least=1.8, source="2, of bilinear functions"),
        report.check(
            "largest ratio of hoop stress errors from h to h / 2, cut",
            max(hoop[1] / hoop[0], hoop[2] / hoop[1]),
            at_most=0.75,
            source="it converges",
        ),
    ]
    report.check(
        "last ratio of displacement errors, stairs",
        rows["gimp", RING_SIZES[2]][0] / rows["gimp", RING_SIZES[1]][0],
        source=f"on stairs the radius of the hole is off by {stall:.2f} times as much as before",
    )
    return all(checks)


def q1_ring(side: float) -> float:
    """Error of u_r, as of `ring`, with bilinear elements on stairs."""
    fem = elasticity.discretise(RING, side)
    nodal = elasticity.solve(fem, np.ones(len(fem.area)))
    x, y = (fem.basis.split_indices()[k] for k in (0, 1))
    at = fem.basis.doflocs[:, x].T
    r = np.hypot(*at.T)
    error = (nodal[x] * at[:, 0] + nodal[y] * at[:, 1]) / r - displaced(r)
    return float(np.sqrt(np.mean(error**2)) / displaced(np.array(INNER)))


def draw_ring(report: Report) -> None:
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.0))
    exact = np.linspace(INNER, OUTER, 100)
    r, u, hoop = around(RING_SIZES[1], gimp)
    for ax, value in ((left, u), (right, hoop)):
        ax.plot(r, value, "o", markersize=2, linestyle="none", label="points", rasterized=True)
    left.plot(exact, displaced(exact), "k-", label="exact")
    right.plot(exact, A * (1 + OUTER**2 / exact**2), "k-", label="exact")
    left.set(xlabel="r", ylabel="radial displacement")
    right.set(xlabel="r", ylabel="hoop stress")
    right.legend(fontsize="small", markerscale=2)
    report.figure(
        "ring_around", figure, f"All points of the ring by GIMP at h = {RING_SIZES[1]:g}, beside Lame's solution."
    )


@pytest.mark.parametrize("function", [tent, gimp, bspline2, bspline3], ids=lambda f: f.__name__)
def test_tensile(report: Report, function: ShapeFunction) -> None:
    """A tensile test by displacement

    8 x 4, E = 100, its far end displaced by 0.01 in plane strain: sigma = E / (1 - nu^2) delta / L, and the grip takes
    sigma W.
    """
    grips = (
        Support(Rectangle((-INF, -INF), (0, INF)), (True, False)),
        Support(Rectangle((-INF, -INF), (INF, 0)), (False, True)),
        Support(Rectangle((8, -INF), (INF, INF)), (True, False), (0.01, 0.0)),
    )
    model = quiet(Body(Rectangle((0, 0), (8, 4)), grips, (), Material(100.0, NU)), 1.0, 2, function)
    state = equilibrium(model, np.full(len(model.points.x), 100.0))
    exact = 100 / (1 - NU**2) * 0.01 / 8
    stress = model.stress(state.moduli, state.strain)
    at = fields_at_points(model, state, np.ones(len(stress)))
    reaction = at.reaction[at.layout.nodes[:, 0] > 8 - 1e-9, 0].sum()
    why = "the field is linear: every function has it"
    error = float(np.abs(stress - [exact, 0, 0]).max() / exact)
    checks = [
        report.check(f"largest error of stress, {function.__name__}", error, at_most=1e-8, source="exact", why=why),
        report.check(f"reaction, {function.__name__}", reaction, exact * 4, rtol=1e-8, source="exact", why=why),
    ]
    assert all(checks)


@pytest.mark.parametrize("function", [tent, gimp], ids=lambda f: f.__name__)
def test_column(report: Report, function: ShapeFunction) -> None:
    """A column under its weight

    2 x 8, nu = 0, solid, `Weight` of 3 per volume: in every cell the stress at its points is the weight above its
    centre, the nearest to a linear stress that a constant one can be.
    """
    foot = Support(Rectangle((-INF, -INF), (INF, 0)), (False, True))
    side = Support(Rectangle((-INF, -INF), (0, INF)), (True, False))
    body = Body(Rectangle((0, 0), (2, 8)), (foot, side), (Weight((0.0, -3.0)),), Material(1.0, 0.0))
    model = quiet(body, 1.0, 2, function)
    solid = np.ones(len(model.points.x))
    state = equilibrium(model, solid, f_ext=model.force(solid))
    above = -3.0 * (7.5 - np.floor(model.points.x[:, 1]))
    error = float(np.abs(model.stress(state.moduli, state.strain)[:, 1] / above - 1).max())
    name = f"largest error of stress, {function.__name__}"
    assert report.check(name, error, at_most=1e-10, source="statics", why="rounding")
