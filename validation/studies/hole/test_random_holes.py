"""Hundred holes of random place and size in the solid cantilever."""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pytest
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from mpmtop.arrays import Array, Mask
from mpmtop.body import Body
from mpmtop.equilibrium import equilibrium
from mpmtop.errors import UnsupportedBody
from mpmtop.material import simp
from mpmtop.model import Model, discretise
from mpmtop.points import MaterialPoints, seed
from mpmtop.region import Circle
from mpmtop.scene import Scene
from validation.bodies.scenes import perforated
from validation.harness.lock import Lock
from validation.harness.progress import ShowProgress
from validation.harness.report import Report
from validation.measures.conditioning import Condition, condition, shown
from validation.methods.analyser import SHAPE_FUNCTIONS

# points are moved off the clamp and over grid lines on purpose
pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

COARSE = 2.5
"""Cell size of the random holes [h]."""
GHOST = 0.01
"""Ghost penalty, as `mpmtop.ghost` recommends."""


class Holed(NamedTuple):
    """Outcome of one analysis: "solved", or the name of the error; condition numbers if solved."""

    outcome: str
    condition: Condition | None


def in_pieces(points: MaterialPoints) -> bool:
    """Whether some points are not connected to the rest through neighbours on the lattice."""
    spacing = 2 * points.half_length[0, 0]
    p, q = KDTree(points.x).query_pairs(1.01 * spacing, output_type="ndarray").T
    graph = sp.coo_array((np.ones(len(p)), (p, q)), shape=(len(points.x),) * 2)
    return bool(connected_components(graph, directed=False)[0] > 1)


@lru_cache(maxsize=8)  # where points in the hole are only void, all holes are of one body
def discretised(body: Body, function: str, shift: tuple[float, float], ghost: float) -> Model:
    """2 x 2 points per cell of COARSE moved by `shift`."""
    points = seed(body.domain, (COARSE / 2, COARSE / 2)).moved(shift)
    return discretise(body, COARSE, points=points, shape_function=SHAPE_FUNCTIONS[function], ghost=ghost)


def analysed(scene: Scene, function: str, shift: Array, ghost: float) -> Holed:
    """The solid body, but for passive void, its points moved by `shift` (2,)."""
    points = seed(scene.body.domain, (COARSE / 2, COARSE / 2))
    rho = np.ones(len(points.x))
    if scene.design.passive_void is not None:
        rho[scene.design.passive_void.contains(points.x)] = 0
    try:
        model = discretised(scene.body, function, (float(shift[0]), float(shift[1])), ghost)
        state = equilibrium(model, simp(rho, scene.design.penal, scene.design.contrast)[0])
    except UnsupportedBody as error:
        return Holed(type(error).__name__, None)
    return Holed("solved", condition(model, state))


def random_circles(count: int) -> list[Circle]:
    """Circles of random place and radius that leave the loaded corner alone."""
    rng = np.random.default_rng(16)
    circles: list[Circle] = []
    while len(circles) < count:
        circle = Circle(tuple(rng.uniform((0, 0), (45, 30))), float(rng.uniform(0.3, 12)))
        if np.hypot(circle.centre[0] - 45, circle.centre[1]) > circle.radius + 3 * COARSE:
            circles.append(circle)
    return circles


@pytest.mark.benchmark
def test_random_holes(report: Report, lock: Lock, progress: ShowProgress) -> None:
    """A hole anywhere

    100 circles of random place and radius (0.3 h to 12 h, the loaded corner left out), cut from the solid cantilever on
    cells of 2.5 h. Slivers and spikes remain, single points that hang on the rest by a corner of their cell.
    **Standard** as seeded; **GIMP** with all points moved by (0.13, 0.07) cells, so that domains overlap the cells
    beside the body by a little. Remedies: none; the **ghost penalty**, which ties a cut cell to its neighbours;
    **void**, points in the hole with zero density, hence E_min = 1e-9 E0. A piece that the circle cuts off hangs on
    nothing, or on the clamp by a single point: unless void fills the gap, that is an error, by its name.
    """
    circles = random_circles(100)
    domains = (perforated(circle, absent=True).body.domain for circle in circles)
    pieces = np.array([in_pieces(seed(domain, (COARSE / 2, COARSE / 2))) for domain in domains])
    cases: dict[str, tuple[bool, str, float, float]] = {
        "standard, none": (True, "standard", 0.0, 0.0),
        "standard, ghost penalty": (True, "standard", 0.0, GHOST),
        "standard, void": (False, "standard", 0.0, 0.0),
        "GIMP, none": (True, "GIMP", 1.0, 0.0),
        "GIMP, ghost penalty": (True, "GIMP", 1.0, GHOST),
        "GIMP, void and ghost penalty": (False, "GIMP", 1.0, GHOST),
    }
    outcomes: dict[str, list[Holed]] = {name: [] for name in cases}
    for circle in progress(circles, "random holes"):
        for name, (absent, function, moved, ghost) in cases.items():
            shift = moved * COARSE * np.array([0.13, 0.07])
            outcomes[name].append(analysed(perforated(circle, absent=absent), function, shift, ghost))
    rows = counted(outcomes, pieces)
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("method, remedy")
    report.table("random_holes", table, "100 random holes in the solid cantilever.", 2)
    holds = remedies_hold(report, rows)
    lock({name: row["solved, in one piece"] for name, row in rows.items()}, rtol=1e-12)
    assert all(holds)


def counted(outcomes: dict[str, list[Holed]], pieces: Mask) -> dict[str, dict[str, Any]]:
    """Outcomes and condition numbers by method and remedy; `pieces` says which bodies are in several."""
    rows: dict[str, dict[str, Any]] = {}
    for name, holed in outcomes.items():
        solved = np.array([h.outcome == "solved" for h in holed])
        rows[name] = {
            "solved, in one piece": int(np.sum(solved & ~pieces)),
            "error, in one piece": int(np.sum(~solved & ~pieces)),
            "solved, in pieces": int(np.sum(solved & pieces)),
            "error, in pieces": int(np.sum(~solved & pieces)),
        }
    # the same bodies in every row, those that some remedy was needed for being infinitely ill-conditioned without
    by_all = np.all([[h.condition is not None for h in holed] for holed in outcomes.values()], axis=0)
    for name, holed in outcomes.items():
        conditions = [h.condition for h, kept in zip(holed, by_all, strict=True) if kept and h.condition is not None]
        rows[name]["largest condition, solved by all"] = shown(max(c.plain for c in conditions))
        rows[name]["the same, scaled"] = shown(max(c.scaled for c in conditions))
        whole = [h.condition for h, piece in zip(holed, pieces, strict=True) if not piece]
        rows[name]["largest condition, in one piece"] = shown(max(np.inf if c is None else c.plain for c in whole))
    return rows


def remedies_hold(report: Report, rows: dict[str, dict[str, Any]]) -> list[bool]:
    """Claims on the remedies: which leave no error, and how large a condition number."""
    holds = [
        report.check(
            f"random holes that leave one piece: errors, {name}",
            rows[name]["error, in one piece"],
            0,
            source="small cuts are handled",
        )
        for name in ("standard, ghost penalty", "GIMP, ghost penalty")
    ]
    holds += [
        report.check(
            f"all random holes: errors, {name}",
            rows[name]["error, in one piece"] + rows[name]["error, in pieces"],
            0,
            source="small cuts are handled",
        )
        for name in ("standard, void", "GIMP, void and ghost penalty")
    ]
    report.check(
        "random holes that leave one piece: errors without a remedy, standard",
        rows["standard, none"]["error, in one piece"],
        source="for comparison",
    )
    holds.append(
        report.check(
            "random holes that leave one piece: largest condition number with the ghost penalty",
            max(
                rows[name]["largest condition, in one piece"]
                for name in ("standard, ghost penalty", "GIMP, ghost penalty")
            ),
            at_most=1e7,  # 7e3 without a hole; a thin ligament adds its own softness
            source="our bound",
        )
    )
    return holds
