"""Cases that codes are asked: small bodies on grids from (0, 0), with two cells of grid around them.

Units: cells are of size one, Young's modulus is one. Where a case is asked again elsewhere, in other units or seen in a
mirror, that is said by the functions at the end.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mpmtop.arrays import Array, Index, Mask
from mpmtop.body import Body, Material, Support
from mpmtop.crossing import Crossing
from mpmtop.grid import Grid
from mpmtop.loads import Load, PositionLoad
from mpmtop.points import MaterialPoints, seed, to_gauss_points
from mpmtop.region import HalfPlane, Rectangle, Region
from validation.bodies import beam as timoshenko
from validation.methods.protocol import Case

HOME = 2.0
"""Cells between the grid's origin and the body: what functions may reach beyond it."""
SOLID = Material(1.0, 0.3, "strain")
ROD = Material(1.0, 0.0, "strain")
"""Without Poisson's ratio, so that what is pulled along one axis is a line's problem."""
Field = Callable[[Array], Array]


def clamped(coordinate: float = HOME, fixed: tuple[bool, bool] = (True, True)) -> Support:
    """All nodes left of a place along x, on it included."""
    return Support(HalfPlane((coordinate, 0.0), (1.0, 0.0)), fixed)


def around(lower: Array, upper: Array) -> tuple[Support, ...]:
    """All nodes on the outline of a box and outside."""
    sides = ((lower, (1.0, 0.0)), (lower, (0.0, 1.0)), (upper, (-1.0, 0.0)), (upper, (0.0, -1.0)))
    return tuple(Support(HalfPlane((float(x[0]), float(x[1])), normal)) for x, normal in sides)


def box(cells: tuple[int, int]) -> Rectangle:
    """Of so many cells, at home."""
    return Rectangle((HOME, HOME), (HOME + cells[0], HOME + cells[1]))


def case(
    name: str,
    cells: tuple[int, int],
    supports: tuple[Support, ...],
    loads: tuple[Load, ...] = (),
    *,
    material: Material = SOLID,
    points: MaterialPoints | None = None,
    **acts: Any,
) -> Case:
    """A box of solid material, 2 x 2 points for each of its cells unless they are given."""
    domain = box(cells)
    points = seed(domain, (0.5, 0.5)) if points is None else points
    grid = Grid((0.0, 0.0), (1.0, 1.0), (cells[0] + 4, cells[1] + 4))
    body = Body(domain, supports, loads, material)
    return Case(name, body, points, grid, np.full(len(points.x), material.young), **acts)


def uneven(cells: tuple[int, int]) -> MaterialPoints:
    """Points of a box, moved at random by up to 0.3 cells but for those beside its edges: no domain leaves the box."""
    domain = box(cells)
    points = seed(domain, (0.5, 0.5))
    inner = domain.contains(points.x, -0.5)
    return points.moved(np.random.default_rng(20).uniform(-0.3, 0.3, points.x.shape) * inner[:, None])


def on_lines(cells: tuple[int, int]) -> MaterialPoints:
    """Points of a box, moved by a quarter of a cell along x: every other column lies on a grid line."""
    return seed(box(cells), (0.5, 0.5)).moved((0.25, 0.0))


def rigid(x: Array) -> Array:
    """A translation, and a small rotation about the origin."""
    return np.stack([0.3 - 0.1 * x[:, 1], -0.2 + 0.1 * x[:, 0]], axis=1)


def rigid_motion(name: str, points: MaterialPoints | None = None) -> Case:
    """A block whose left edge is moved, and which follows."""
    return case(name, (6, 4), (clamped(),), points=points, prescribed=rigid)


GRADIENT = np.array([[0.02, 0.05], [-0.01, 0.03]])
"""Of the linear field of the patch test."""


def linear(x: Array) -> Array:
    """u = G x."""
    u: Array = x @ GRADIENT.T
    return u


def patch(name: str, points: MaterialPoints | None = None) -> Case:
    """A block held all around at a linear field."""
    domain = box((6, 4))
    return case(name, (6, 4), around(*domain.bounds), points=points, prescribed=linear)


def shared(points: MaterialPoints, loaded: Mask, force: tuple[float, float]) -> Array:
    """Forces (p, 2) on the points that are `loaded`, by their volumes."""
    weight = points.volume * loaded
    return np.outer(weight / weight.sum(), force)


def pulled_at_end(name: str) -> Case:
    """A rod without Poisson's ratio, pulled by a unit force at positions on its end: two in each cell."""
    y = HOME + np.array([0.0, 1.0])[:, None] + (1 + np.array([-1, 1]) / np.sqrt(3)) / 2
    loads = tuple(PositionLoad((HOME + 16, float(at)), (0.25, 0.0)) for at in y.ravel())
    return case(name, (16, 2), (clamped(),), loads, material=ROD)


def levers(case: Case) -> tuple[Array, Array]:
    """Forces (n, 2) of all that acts on a clamped case, and their arms (n,) from the clamp, along x."""
    place, force = case.acts.places(case.points.x)
    if case.body_force is not None:
        place = np.concatenate([place, case.points.x])
        force = np.concatenate([force, case.points.volume[:, None] * case.body_force])
    return force, place[:, 0] - HOME


def layered(name: str) -> Case:
    """Two layers, one twice as stiff, without Poisson ratio, stretched by 1 %; layers meet on a grid line."""
    lower, upper = box((6, 4)).bounds
    ends = (clamped(), Support(HalfPlane((float(upper[0]), 0.0), (-1.0, 0.0))))
    made = case(name, (6, 4), ends, material=ROD, prescribed=lambda x: (x - lower) * [0.01, 0.0])
    return replace(made, moduli=np.where(made.points.x[:, 1] < HOME + 2, 1.0, 2.0))


def cantilever(name: str, points: MaterialPoints | None = None, material: Material = SOLID) -> Case:
    """Clamped at the left, a force aslant on the upper part of its last column, wherever its points are."""
    made = case(name, (12, 6), (clamped(),), points=points, material=material)
    seeded = seed(box((12, 6)), (0.5, 0.5))
    loaded = (seeded.x[:, 0] > HOME + 11.5) & (seeded.x[:, 1] > HOME + 4)
    return replace(made, forces=shared(seeded, loaded, (0.3, -1.0)))


def under_weight(name: str, points: MaterialPoints | None = None) -> Case:
    """The same body under a body force aslant."""
    made = cantilever(name, points)
    return replace(made, forces=None, body_force=np.tile([0.05, -0.02], (len(made.points.x), 1)))


def crossed(name: str, crossing: Crossing) -> Case:
    """The cantilever with points moved by a family, which goes by distances from a body's corner."""
    domain = Rectangle((0.0, 0.0), (12.0, 6.0))
    return cantilever(name, crossing(seed(domain, (0.5, 0.5)), domain).moved((HOME, HOME)))


def slender(name: str, load: float) -> Case:
    """A cantilever ten times as long as deep, two cells deep, without Poisson's ratio, high enough on its grid to bend
    down: P L^2 / EI = `load` on its last column of points, 3 x 3 in each cell; L is the arm of that column."""
    length, depth = 20, 2
    domain = Rectangle((HOME, HOME + length), (HOME + length, HOME + length + depth))
    points = seed(domain, (1 / 3, 1 / 3))
    last = points.x[:, 0] > HOME + length - 1 / 3
    arm = float(points.x[:, 0].max()) - HOME
    force = np.outer(last / last.sum(), [0.0, -load * depth**3 / 12 / arm**2])
    grid = Grid((0.0, 0.0), (1.0, 1.0), (length + 4, length + depth + 4))
    return Case(name, Body(domain, (clamped(),), (), ROD), points, grid, np.ones(len(points.x)), force)


def column(name: str, cells: int, *, unequal: bool = False, weight: float = 1.0) -> Case:
    """One cell wide on rollers, without Poisson's ratio, under its weight, of stress `weight` at the base; `unequal`
    points are 4 x 4 in each cell of the upper half."""
    inf = np.inf
    base = Support(Rectangle((-inf, -inf), (inf, HOME)), (False, True))
    sides = (Support(Rectangle((-inf, -inf), (HOME, inf)), (True, False)), clamped_right(HOME + 1))
    points = seed(box((1, cells)), (0.5, 0.5))
    if unequal:
        middle = HOME + cells / 2
        fine = seed(Rectangle((HOME, middle), (HOME + 1, HOME + cells)), (0.25, 0.25))
        kept = points.x[:, 1] < middle
        points = MaterialPoints(
            *(
                np.concatenate([getattr(points, what)[kept], getattr(fine, what)])
                for what in ("x", "volume", "half_length")
            )
        )
    force = np.tile([0.0, -weight / cells], (len(points.x), 1))
    return case(name, (1, cells), (base, *sides), material=ROD, points=points, body_force=force)


def clamped_right(coordinate: float) -> Support:
    """Rollers on all nodes right of a place along x."""
    return Support(HalfPlane((coordinate, 0.0), (-1.0, 0.0)), (True, False))


def manufactured(name: str, cells: int, points: MaterialPoints | None = None) -> Case:
    """A square held at zero all around under the body force of `waves`."""
    domain = box((cells, cells))
    made = case(name, (cells, cells), around(*domain.bounds), points=points)
    return replace(made, body_force=waves(made.points.x - HOME, cells)[2])


def waves(x: Array, side: float) -> tuple[Array, Array, Array]:
    """u (p, 2), stress (p, 3) and body force (p, 2) at x (p, 2) in a square that holds u at zero: with a = pi / side,

        u_x = sin(a x) sin(2 a y),    u_y = 0.7 sin(2 a x) sin(a y),

    b = -div sigma in plane strain. Second derivatives across an edge vanish there, too.
    """
    a, nu = np.pi / side, SOLID.poisson
    lam, mu = SOLID.young * np.array([nu / (1 - 2 * nu), 0.5]) / (1 + nu)
    s1, c1, s2, c2 = (f(k * a * x) for k in (1, 2) for f in (np.sin, np.cos))
    (sx, sy), (cx, cy), (sxx, syy), (cxx, cyy) = s1.T, c1.T, s2.T, c2.T
    ux, uy = sx * syy, 0.7 * sxx * sy
    ux_x, ux_y, uy_x, uy_y = a * cx * syy, 2 * a * sx * cyy, 1.4 * a * cxx * sy, 0.7 * a * sxx * cy
    dilatation = ux_x + uy_y
    stress = np.stack([lam * dilatation + 2 * mu * ux_x, lam * dilatation + 2 * mu * uy_y, mu * (ux_y + uy_x)], axis=1)
    grad_div = np.stack(
        [-(a**2) * ux + 1.4 * a**2 * cxx * cy, 2 * a**2 * cx * cyy - 0.7 * a**2 * sxx * sy],
        axis=1,
    )
    u = np.stack([ux, uy], axis=1)
    return u, stress, -(lam + mu) * grad_div + 5 * a**2 * mu * u


def beam(name: str, depth: int) -> Case:
    """Timoshenko's cantilever, both ends held at the closed form, no load."""
    length = timoshenko.SLENDER * depth
    ends = (clamped(), Support(HalfPlane((HOME + length, 0.0), (-1.0, 0.0))))
    return case(name, (length, depth), ends, prescribed=lambda x: timoshenko.beam(x - HOME, depth, SOLID).u)


def refined(name: str, per_cell: int) -> Case:
    """A cantilever, 8 x 4, under a body force on its last quarter, with its cells cut into so many along each axis."""
    domain, h = box((8, 4)), 1 / per_cell
    points = seed(domain, (h / 2, h / 2))
    grid = Grid((0.0, 0.0), (h, h), (12 * per_cell, 8 * per_cell))
    force = np.outer(points.x[:, 0] > HOME + 6, [0.0, -1 / 8])
    return Case(name, Body(domain, (clamped(),), (), SOLID), points, grid, np.ones(len(points.x)), body_force=force)


def gauss(name: str) -> Case:
    """The cantilever under weight with points at the cells' Gauss points: bilinear elements, for the tent."""
    return under_weight(name, to_gauss_points(seed(box((12, 6)), (0.5, 0.5))))


@dataclass(frozen=True)
class Map:
    """What is done to a case: places, vectors and forces go to new ones, lengths and moduli times numbers."""

    place: Field
    vector: Field
    length: float = 1.0
    force: float = 1.0
    modulus: float = 1.0

    def __call__(self, made: Case, name: str) -> Case:
        """The case, mapped; no prescribed displacements, and no loads of the body."""
        if made.prescribed is not None or made.body.loads:
            raise ValueError(f"{made.name}: prescribed displacements and loads of the body are not mapped")
        body, points, grid = made.body, made.points, made.grid
        ends = np.array([grid.origin, np.add(grid.origin, np.multiply(grid.cells, grid.h))])
        low = np.sort(self.place(ends), axis=0)[0]
        h, cells = np.abs(self.length * self.vector(np.array(grid.h))), np.abs(self.vector(np.array(grid.cells)))
        density = self.force / self.length**2
        return Case(
            name,
            Body(
                self.rectangle(body.domain),
                tuple(Support(self.half_plane(s.region), self.flags(s.fixed)) for s in body.held),
                (),
                replace(body.material, young=self.modulus * body.material.young),
            ),
            MaterialPoints(
                self.place(points.x),
                self.length**2 * points.volume,
                np.abs(self.length * self.vector(points.half_length)),
            ),
            Grid(tuple(low.tolist()), tuple(h.tolist()), tuple(np.rint(cells).astype(int).tolist())),
            self.modulus * made.moduli,
            None if made.forces is None else self.force * self.vector(made.forces),
            None if made.body_force is None else density * self.vector(made.body_force),
        )

    def rectangle(self, region: Region) -> Rectangle:
        """A domain."""
        low, high = np.sort(self.place(np.array(region.bounds)), axis=0).tolist()
        return Rectangle((low[0], low[1]), (high[0], high[1]))

    def half_plane(self, region: Region) -> HalfPlane:
        """The region of a support, which is one."""
        assert isinstance(region, HalfPlane)
        point, normal = self.place(np.array(region.point)).tolist(), self.vector(np.array(region.normal)).tolist()
        return HalfPlane((point[0], point[1]), (normal[0], normal[1]))

    def flags(self, fixed: tuple[bool, bool]) -> tuple[bool, bool]:
        """The components that a support holds."""
        first, second = self.vector(np.array(fixed, float)) != 0
        return bool(first), bool(second)


def moved(shift: tuple[float, float]) -> Map:
    """The whole case elsewhere: grid, points, body and supports."""
    return Map(lambda x: x + shift, lambda v: v)


def in_units(length: float, force: float, modulus: float) -> Map:
    """Other units; a displacement is then force / modulus times the old one, a stress force / length."""
    return Map(lambda x: x * length, lambda v: v, length, force, modulus)


MIRRORED = Map(lambda x: x * [-1.0, 1.0], lambda v: v * [-1.0, 1.0])
"""Left and right exchanged."""
TURNED = Map(lambda x: np.stack([-x[..., 1], x[..., 0]], -1), lambda v: np.stack([-v[..., 1], v[..., 0]], -1))
"""By a quarter."""
TRANSPOSED = Map(lambda x: x[..., ::-1], lambda v: v[..., ::-1])
"""x and y exchanged."""


def shuffled(made: Case, name: str, order: Index) -> Case:
    """The points in another order."""
    points = made.points
    return replace(
        made,
        name=name,
        points=MaterialPoints(points.x[order], points.volume[order], points.half_length[order]),
        moduli=made.moduli[order],
        forces=None if made.forces is None else made.forces[order],
        body_force=None if made.body_force is None else made.body_force[order],
    )
