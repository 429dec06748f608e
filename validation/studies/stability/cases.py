"""Bodies to analyse far past what is sensible: positions, small cuts, densities, points and units.

All are variations of one cantilever of 5 x 2 cells, clamped at x <= 0 and pulled down at its tip; h = E0 = F = 1.
"""

from collections.abc import Callable, Iterator
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from mpmtop.arrays import Array, Index
from mpmtop.body import Body, Material, Support
from mpmtop.design import Design
from mpmtop.equilibrium import equilibrium
from mpmtop.errors import UnsupportedBody
from mpmtop.grid import Grid
from mpmtop.loads import PointLoad, RegionLoad
from mpmtop.model import Model, discretise
from mpmtop.objectives import compliance
from mpmtop.points import MaterialPoints, seed
from mpmtop.region import Rectangle
from mpmtop.scene import Scene
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3, gimp, tent
from validation.bodies.scenes import changed
from validation.studies.stability.judge import CONTRAST, FAR, PENAL, Analysis, Case, Finding, Limit, direct, multigrid

FUNCTIONS: dict[str, ShapeFunction] = {"tent": tent, "GIMP": gimp, "B-spline": bspline2}
FINER: dict[str, ShapeFunction] = FUNCTIONS | {"cubic B-spline": bspline3}
"""What positions and cuts are about."""
CELLS = np.array([5, 2])
GHOST = 0.01
"""Ghost penalty, as `mpmtop.ghost` recommends."""
LINES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Shifts at which 2 x 2 points, their domains or the body cross grid lines."""
DIRECTIONS = {"x": (1.0, 0.0), "y": (0.0, 1.0), "both": (1.0, 1.0)}
AMPLE = Path(__file__).parents[2] / "data" / "ample" / "smallcut_gimp20x10.csv"
LEFT_THE_CLAMP = Limit("hardly a point left at the clamp", least=1.0)
"""Limit: see `mpmtop.body.Support`."""
OUTER_EDGE = Limit("domain a hair over the outer edge, GIMP", least=1.0, most=1.15)
"""Limit: see `mpmtop.equilibrium.discretise`; a step by a tenth on two cells across."""
HAIR = 1e-2
"""Shifts up to this [h] are a hair, and should not change the compliance by more than STEP ..."""
STEP = 1.03
"""... of its value: a hundredth of a cell of five, with the force on it, does 0.6 %."""


def beam(offset: tuple[float, float] = (0.0, 0.0), h: tuple[float, float] = (1.0, 1.0), **changes: Any) -> Scene:
    """The cantilever with its lower left corner at `offset` and cells of size h."""
    x, y = offset
    length, height = CELLS * h
    clamp = Support(Rectangle((-np.inf, -np.inf), (x, np.inf)))
    tip = PointLoad((x + length, y + height / 2), (0.0, -1.0))
    body = Body(Rectangle((x, y), (x + length, y + height)), (clamp,), (tip,))
    return changed(Scene("beam", body, Design(0.4, 1.5 * min(h), PENAL, CONTRAST)), **changes)


@cache
def lattice(nx: int = 2, ny: int = 2) -> MaterialPoints:
    """nx x ny points per cell of the beam."""
    return seed(beam().body.domain, (1 / nx, 1 / ny))


def model_of(
    function: str,
    shift: Array | tuple[float, float] = (0.0, 0.0),
    *,
    points: MaterialPoints | None = None,
    scene: Scene | None = None,
    **how: Any,
) -> Model:
    """The beam, or another scene on the same grid, with its points or `points` moved by `shift`."""
    points = lattice() if points is None else points
    moved = points.moved(shift)
    scene = beam() if scene is None else scene
    settings: dict[str, Any] = {"solver": multigrid, "shape_function": FINER[function], "points": moved} | how
    return discretise(scene.body, **({} if "grid" in settings else {"h": 1.0}) | settings)


@cache
def still(function: str) -> float:
    """Compliance of the beam as seeded."""
    model = direct(model_of(function))
    return compliance(model, equilibrium(model, np.ones(len(model.points.x))))


def leaves_clamp(function: str, points: MaterialPoints, line: float = 1.0) -> type[Exception] | None:
    """The error to expect if no point reaches the clamped column of cells, which ends at `line`."""
    reach = points.x[:, 0] - (points.half_length[:, 0] if function == "GIMP" else 0)
    return UnsupportedBody if np.min(reach) >= line - 2e-12 else None


def positions() -> Iterator[Analysis]:
    """Shifts over a whole cell, grid lines and 1e-16 to 1e-2 on both sides of them; the origin moved."""
    near = [0.0] + [side * 10.0**-k for k in (2, 4, 6, 9, 12) for side in (-1, 1)]
    shifts = sorted({line + d for line, d in product(LINES, near)} | {k / 16 for k in range(17)})
    for function, (direction, along), s in product(FINER, DIRECTIONS.items(), shifts):
        if s == 0 and direction != "x":
            continue  # the same
        shift = np.multiply(along, s)
        yield Analysis(
            f"shift in {direction}, {function}",
            f"{s!r}",
            partial(model_of, function, shift),
            error=leaves_clamp(function, lattice().moved(shift)),
            sane=still(function),
            within=STEP if abs(s) <= HAIR else FAR,
            limit=over_edge(function, s) or (LEFT_THE_CLAMP if direction != "y" and s > 0.25 else None),
        )
    root, pi, e = 2**0.5, np.pi, np.e
    offsets = [
        (root, 0),
        (0, pi),
        (-pi, e),
        (1 / 3, -root),
        (1e3 * root, 7),
        (1e5 * pi, 0),
        (0, -1e6 * root),
        (1e6 + root, -1e6 * e),
    ]
    for function, offset, s in product(FINER, offsets, (0.0, 0.1, 0.25, 0.4, 0.6)):
        yield Analysis(
            f"scene moved, {function}",
            f"{offset}, {s}",
            partial(moved_scene, function, offset, s),
            compliance=shifted(function, s),
            # positions, so gradients too, are off by the rounding of the offset: 1e-10 h at 1e6 h
            rtol=1e-9 + 100 * np.finfo(float).eps * float(np.abs(offset).max()),
        )
    for function, dx, dy in product(FINER, (root / 2, pi - 3, 0.3, 1e-9, 1 - 1e-13), (0.0, e - 2, 0.5)):
        yield Analysis(
            f"grid moved, {function}",
            f"{dx}, {dy}",
            partial(model_of, function, grid=Grid((-3 + dx, -3 + dy), (1.0, 1.0), (11, 8))),
            error=leaves_clamp(function, lattice(), line=dx),
            sane=still(function),
            limit=LEFT_THE_CLAMP,
        )


def moved_scene(function: str, offset: tuple[float, float], s: float) -> Model:
    """The beam and its grid at another place, points shifted by s in both directions."""
    points = lattice().moved(np.add(offset, s))
    return model_of(function, points=points, scene=beam(offset))


@cache
def shifted(function: str, s: float) -> float:
    """Compliance of the beam with its points shifted by s in both directions."""
    model = direct(model_of(function, (s, s)))
    return compliance(model, equilibrium(model, np.ones(len(model.points.x))))


def over_edge(function: str, s: float) -> Limit | None:
    """The limit of a shift by a hair, if it has one."""
    return OUTER_EDGE if function == "GIMP" and 0 < abs(s) <= HAIR else None


def cuts() -> Iterator[Analysis]:
    """Points, for GIMP domains, that reach over a grid line by 0.2 to 2e-12 at an edge, a side or a corner."""
    for function, k in product(FINER, range(1, 13)):
        over = 2 * 10.0**-k + (0 if function == "GIMP" else 0.25)
        for where, along in DIRECTIONS.items():
            for ghost in (0.0,) if "B-spline" in function else (0.0, GHOST):
                yield Analysis(
                    f"cut, {function}" + (", ghost penalty" if ghost else ""),
                    f"2e-{k} in {where}",
                    partial(model_of, function, np.multiply(along, over), ghost=ghost),
                    sane=still(function),
                    within=STEP if function == "GIMP" and over <= HAIR else FAR,
                    limit=None if ghost else over_edge(function, over),
                )


def oracle() -> Iterator[Case]:
    """Bodies of 20 x 10 cells, GIMP, cut by 1e-1 to 1e-8 of a cell at both ends, as AMPLE analysed them."""
    for s, theirs in np.loadtxt(AMPLE, delimiter=",", skiprows=1):
        yield Case("cut, GIMP, 20 x 10 cells", f"{s}", "AMPLE, to 1e-10", partial(as_ample, float(s), float(theirs)))


def as_ample(s: float, theirs: float) -> Finding:
    """Compliance under a unit force on the last column of points, E = 1e6: see data/ample/README.md."""
    scene = beam(
        domain=Rectangle((s, 0.0), (20 + s, 10.0)),
        loads=(RegionLoad(Rectangle((19.5 + s, 0.0), (20 + s, 10.0)), (0.0, -1.0)),),
        material=Material(1e6),
        supports=beam().body.supports,
    )
    model = discretise(scene.body, shape_function=gimp, grid=Grid((0.0, 0.0), (1.0, 1.0), (22, 10)))
    ours = compliance(model, equilibrium(model, np.full(800, 1e6)))
    return Finding(abs(ours / theirs - 1) / 1e-10)


def fields(x: Array) -> Iterator[tuple[str, Array]]:
    """Densities (p,) of points at x (p, 2) in the beam as seeded."""
    cell, point = np.floor(x).astype(int), np.floor(2 * x).astype(int)
    yield "solid", np.ones(len(x))
    yield "void", np.zeros(len(x))
    yield "checkerboard of points", (point.sum(axis=1) % 2).astype(float)
    yield "checkerboard of cells", (cell.sum(axis=1) % 2).astype(float)
    yield "bridge of one point", np.where((point[:, 0] == 4) & (point[:, 1] != 2), 0.0, 1.0)
    yield "loaded end on void", np.where(cell[:, 0] == 2, 0.0, 1.0)
    rng = np.random.default_rng(11)
    for i in range(9):
        yield f"random islands {i}", (rng.random(len(x)) < 0.5).astype(float)
    yield "slit along the middle", np.where((point[:, 1] == 1) & (point[:, 0] > 0), 0.0, 1.0)
    yield "grey at random", rng.random(len(x))


def contrasts() -> Iterator[Analysis]:
    """Densities at contrasts from 1 to 1e-15, and zero; the paper's E_min = 1e-6 in both readings."""
    bodies = ("tent", 0.05, 0.0), ("GIMP", 0.1, 0.0), ("GIMP", 0.1, GHOST), ("B-spline", 0.3, 0.0)
    models = {
        f"{function}{', ghost penalty' if ghost else ''}": model_of(function, (s, s), ghost=ghost)
        for function, s, ghost in bodies
    }
    for (name, model), k in product(models.items(), range(17)):
        contrast = 0.0 if k == 16 else min(10.0**-k, 1 - 1e-16)
        for field, rho in fields(lattice().x):
            if (field == "solid" and k > 0) or (field == "void" and contrast == 0):
                continue  # no contrast in it, nothing at all
            yield Analysis(
                f"{field}, {name.partition(',')[0]}", f"{name}, 1e-{k}", partial(same, model), rho, contrast=contrast
            )
    for function, (reading, contrast) in product(FUNCTIONS, {"absolute": 1e-12, "relative": 1e-6}.items()):
        model = model_of(function, scene=beam(material=Material(1e6)))
        for field, rho in fields(lattice().x):
            if field == "solid" and reading == "relative":
                continue
            make = partial(same, model)
            yield Analysis(f"E_min = 1e-6, {reading}", f"{field}, {function}", make, rho, contrast=contrast)


def same(model: Model) -> Model:
    """A model that is there already."""
    return model


def clouds() -> Iterator[Analysis]:
    """Points per cell, equal or not, cells without points, a point alone, clouds at random."""
    numbers = [(n, n) for n in (1, 3, 4, 5, 6, 7, 8)] + [(2, 3), (1, 2), (2, 1), (1, 4), (3, 2), (8, 1), (2, 5)]
    for function, n, s in product(FUNCTIONS, numbers, (0.05, 0.3)):
        points = lattice(*n)
        yield Analysis(
            f"points per cell, {function}",
            f"{n}, {s}",
            partial(model_of, function, (s, s / 2), points=points),
            error=leaves_clamp(function, points.moved((s, 0.0))),
            sane=still(function),
            limit=LEFT_THE_CLAMP if s > 0.25 else None,
        )
    cell = np.floor(lattice().x).astype(int) @ (1, 5)
    for function, missing, s in product(FUNCTIONS, range(10), (0.0, 0.2)):
        kept = np.flatnonzero(cell != missing)
        yield Analysis(
            f"empty cell, {function}", f"{missing}, {s}", partial(model_of, function, (s, s / 2), points=some(kept))
        )
    for function, one in product(FUNCTIONS, range(0, 40, 4)):
        points = some(np.array([one]))
        scene = beam(loads=(PointLoad((5.0, 1.0), (0.0, -1.0), points=1),))
        make = partial(model_of, function, points=points, scene=scene)
        yield Analysis(f"one point alone, {function}", f"{one}", make, error=leaves_clamp(function, points))
    for number in range(1000):
        yield cloud(number)


def some(kept: Index) -> MaterialPoints:
    """These points of the beam only."""
    points = lattice()
    return MaterialPoints(points.x[kept], points.volume[kept], points.half_length[kept])


def cloud(number: int) -> Analysis:
    """Points of random number, place and size; every tenth one with a ghost penalty, where there is one."""
    rng = np.random.default_rng(number)
    function = list(FUNCTIONS)[number % 3]
    p = int(rng.integers(6, 40))
    half = rng.uniform(0.05, 0.5, (p, 2))
    points = MaterialPoints(rng.uniform((0, 0), CELLS, (p, 2)), np.prod(2 * half, axis=1), half)
    ghost = GHOST if function != "B-spline" and number % 10 == 0 else 0.0
    return Analysis(
        f"random cloud, {function}" + (", ghost penalty" if ghost else ""),
        f"{number}",
        partial(model_of, function, points=points, ghost=ghost),
        error=leaves_clamp(function, points),
    )


ANALYSES: dict[str, Callable[[], Iterator[Analysis]]] = {
    "Positions": positions,
    "Small cuts": cuts,
    "Contrast and density fields": contrasts,
    "Points": clouds,
}
"""By section of the report."""
