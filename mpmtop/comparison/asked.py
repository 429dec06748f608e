"""What is compared: a scene, the cells it is cut into, the methods, and the crossing that its points go through."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from mpmtop.arrays import Array
from mpmtop.criteria import Compliance
from mpmtop.crossing import named
from mpmtop.errors import InvalidScene
from mpmtop.optimizers import GCMMA
from mpmtop.optimizers.protocols import UpdateRule
from mpmtop.region import Region, divisions
from mpmtop.scene import Scene

FEM, MPM, GIMP, SPLINE, CUBIC = "fem", "mpm", "gimp", "bspline2", "bspline3"
METHODS = {
    FEM: "FEM",
    MPM: "MPM",
    GIMP: "GIMP",
    SPLINE: "quadratic B-splines",
    CUBIC: "cubic B-splines",
}
"""Names on the command line, and in words."""
USUAL_METHODS = (FEM, MPM, GIMP, SPLINE)
NONE = "none"
USUAL_CROSSING = (NONE, "periodic")
IN_LOAD_STEPS = (FEM, MPM, GIMP, SPLINE)
USUAL_POINTS, MORE_POINTS = 3200, 20000
"""Points where no cell size is given: those of the paper's cantilever; and as many as a filter radius below such a cell
may ask for."""
SAMPLES = 200
"""Positions along a side of the box by which the area of a domain is told: to a per cent or so."""
TYPED = 5e-4
"""Of a side: what four digits of a cell's side leave, 0.2963 for 8/27; the cells then divide the box exactly."""
MOVE = 0.3
"""The paper's move limit."""


@dataclass(frozen=True)
class Asked:
    """A comparison: `h` (2,) are the sides of a cell, `crossing` are "none" or families by what `str` says of them.

    `load_steps` is None in small strain. `ghost` is gamma of the ghost penalty of MPM and GIMP.
    """

    scene: Scene
    h: tuple[float, float]
    ppc: int = 2
    methods: tuple[str, ...] = USUAL_METHODS
    crossing: tuple[str, ...] = USUAL_CROSSING
    iterations: int = 300
    load_steps: int | None = None
    ghost: float = 0.0
    rule: UpdateRule = field(default_factory=lambda: GCMMA(move=MOVE))

    @property
    def spacing(self) -> tuple[float, float]:
        """Distances of neighbouring points, the sides of an element."""
        return self.h[0] / self.ppc, self.h[1] / self.ppc

    @property
    def runs(self) -> tuple[tuple[str, str], ...]:
        """Method and crossing of each run; elements have no points to move."""
        return tuple((method, crossing) for crossing in self.crossing for method in self.methods_in(crossing))

    def methods_in(self, crossing: str) -> tuple[str, ...]:
        """Those that can be crossed so."""
        return tuple(method for method in self.methods if crossing == NONE or method != FEM)

    @property
    def points(self) -> int:
        """Number of points of the domain's box: at least as many as the domain has."""
        lower, upper = self.scene.body.domain.bounds
        return int(np.prod(np.rint((upper - lower) / self.spacing)))


def ask(
    scene: Scene,
    *,
    h: float | tuple[float, float] | None = None,
    ppc: int = 2,
    methods: Iterable[str] = USUAL_METHODS,
    crossing: Iterable[str] | None = None,
    iterations: int = 300,
    load_steps: int | None = None,
    ghost: float = 0.0,
    rule: UpdateRule | None = None,
) -> Asked:
    """The comparison of a scene, on cells of side h, or of sides (hx, hy), which have to divide the domain's box to
    four digits. InvalidScene where it cannot be made as a whole.

    Unless h is given there are about 3,200 points, or as many more, up to 20,000, as make a cell no wider than the
    filter radius. Without `crossing` points are taken as seeded and by "periodic"; in load steps, where they cross by
    themselves, as seeded alone.
    """
    if not isinstance(scene, Scene):
        raise InvalidScene(f"compare is asked for {type(scene).__name__}: give a Scene")
    names = dict.fromkeys(methods)
    if unknown := [name for name in names if name not in METHODS]:
        raise InvalidScene(f"method {unknown[0]!r}: say some of {', '.join(METHODS)}")
    if not names:
        raise InvalidScene(f"no method: say some of {', '.join(METHODS)}")
    if not isinstance(ppc, int) or ppc < 1 or not isinstance(iterations, int) or iterations < 1:
        raise InvalidScene(f"{ppc} points per cell, {iterations} iterations: give whole numbers from 1 on")
    if load_steps is not None:
        _check_load_steps(scene, load_steps, names)
    patterns = ((NONE,) if load_steps else USUAL_CROSSING) if crossing is None else tuple(crossing)
    try:
        told = dict.fromkeys(NONE if text.strip() == NONE else str(named(text)) for text in patterns)
    except ValueError as error:
        raise InvalidScene(str(error)) from error
    if not told:
        raise InvalidScene("no crossing: say none, or a family such as periodic")
    if load_steps is not None and tuple(told) != (NONE,):
        raise InvalidScene("crossing in load steps: points cross by themselves there, say none")
    asked = Asked(
        scene, cells(scene, h), ppc, tuple(names), tuple(told), iterations, load_steps, ghost, rule or GCMMA(move=MOVE)
    )
    if not asked.runs:
        raise InvalidScene("finite elements have no points that cross: say none, or another method")
    return asked


def _check_load_steps(scene: Scene, load_steps: int, methods: Iterable[str]) -> None:
    if not isinstance(load_steps, int) or load_steps < 1:
        raise InvalidScene(f"{load_steps} load steps: give a whole number from 1 on")
    if other := [name for name in methods if name not in IN_LOAD_STEPS]:
        raise InvalidScene(f"{METHODS[other[0]]} in load steps: say some of {', '.join(IN_LOAD_STEPS)}")
    if scene.cases or scene.constraints or not isinstance(scene.objective, Compliance):
        raise InvalidScene(
            "a comparison in load steps is of the compliance of one load case under the volume constraint: leave out "
            "`load_steps`, or cases, constraints and other objectives"
        )


def cells(scene: Scene, h: float | tuple[float, float] | None) -> tuple[float, float]:
    """Sides (2,) of a cell: h, made to divide the domain's box exactly, or chosen, see `ask`."""
    lower, upper = scene.body.domain.bounds
    sides = upper - lower
    if h is not None:
        size = _typed(h)
        nearest = sides / np.maximum(np.rint(sides / size), 1)
        near = np.all(np.abs(nearest - size) <= TYPED * nearest)
        count = divisions("cell size h", (lower, upper), nearest if near else size)
        return float(sides[0] / count[0]), float(sides[1] / count[1])
    per_point = area(scene.body.domain) / np.array([USUAL_POINTS, MORE_POINTS])
    usual, least = np.sqrt(4 * per_point)  # four points in a cell
    wanted = float(np.clip(scene.design.filter_radius, least, usual))
    long = int(np.argmax(sides))
    counts = np.arange(max(1, int(0.7 * sides[long] / wanted)), int(1.4 * sides[long] / wanted) + 2)
    others = counts * sides[1 - long] / sides[long]
    square = np.abs(others - np.rint(others)) < 1e-6 * others
    distance = np.abs(np.log(counts * wanted / sides[long]))
    chosen = int(np.argmin(np.where(square, distance, np.inf if np.any(square) else distance)))
    size = np.empty(2)
    size[long], size[1 - long] = sides[long] / counts[chosen], sides[1 - long] / max(1, np.rint(others[chosen]))
    return float(size[0]), float(size[1])


def _typed(h: object) -> Array:
    """Both sides (2,) of a cell, of one number or of two."""
    pair = tuple(h) if isinstance(h, tuple | list | np.ndarray) else (h, h)
    if len(pair) != 2 or not all(isinstance(side, int | float | np.number) and 0 < side < np.inf for side in pair):
        raise InvalidScene(f"cell size h = {h!r}: give one positive number, or two, (hx, hy)")
    return np.array(pair, float)


def area(domain: Region) -> float:
    """Area of a domain, to a per cent or so."""
    lower, upper = domain.bounds
    axes = (a + (b - a) * (np.arange(SAMPLES) + 0.5) / SAMPLES for a, b in zip(lower, upper, strict=True))
    x = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    return float(np.prod(upper - lower)) * max(1, int(np.count_nonzero(domain.contains(x)))) / SAMPLES**2
