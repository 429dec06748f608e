"""Regions: parts of the plane that say where a domain, a support, a load or passive material is.

A region tells which positions lie in it and in what box it lies, so that a curved one needs no other grid than a
rectangle does; and, where something is to act on its boundary, by which curves it is bounded. All are closed, but a
`Difference` does not hold the boundary of its hole.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from mpmtop.arrays import Array, Index, Mask, number, numbers
from mpmtop.curves import Curve, Line, Round
from mpmtop.errors import InvalidScene

DIVIDES = 1e-6
"""Of a side: a length typed to seven digits (0.1428571) divides it. The lattice then takes the exact one."""


def divisions(what: str, bounds: tuple[Array, Array], size: tuple[float, float] | Array) -> Index:
    """How many lengths `size` (x, y) make up the sides of a box, (2,): the lattice of either solver.

    Raises InvalidScene, which names `what`, if they are not finite and positive or do not divide the sides.
    """
    sides, size = bounds[1] - bounds[0], np.asarray(size, float)
    if not (np.all(np.isfinite(size)) and np.all(size > 0)):
        raise InvalidScene(f"{what} {size.tolist()}: give finite, positive lengths")
    count = np.maximum(np.rint(sides / size), 1)
    if not np.all(np.abs(count * size - sides) <= DIVIDES * sides):  # also catches an infinite box
        raise InvalidScene(
            f"{what} {size.tolist()} does not divide the domain's sides {sides.tolist()}: the nearest that does is "
            f"{(sides / count).tolist()}"
        )
    return count.astype(np.intp)


def finite_pair(what: str, value: Any) -> tuple[float, float]:
    """The two numbers of `value` as floats; InvalidScene, which names `what`, if it is not two finite numbers."""
    if not numbers(value, 2):
        raise InvalidScene(f"{what} {value}: give two finite numbers")
    return float(value[0]), float(value[1])


def finite(what: str, value: Any) -> float:
    """The number as a float; InvalidScene, which names `what`, if it is not one finite number."""
    if not np.isfinite(number(value)):
        raise InvalidScene(f"{what} {value!r}: give a finite number")
    return float(value)


def check_region(what: str, value: object) -> None:
    """InvalidScene, which names `what`, if `value` is no region."""
    if not (hasattr(value, "contains") and hasattr(value, "bounds")):
        raise InvalidScene(f"{what} is {value!r}: give a region, such as Rectangle(lower, upper)")


Box = tuple[Array, Array]
"""Lower and upper corner, each (2,)."""


class Region(Protocol):
    """A part of the plane: `bounds` is its bounding box, `contains` tells which positions lie in it.

    Where something acts on its boundary a region has `outline(box)`, too: curves that hold all of its boundary within a
    finite box, and maybe more than that.
    """

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner, each (2,)."""
        ...

    def contains(self, x: Array, tol: float = 0.0) -> Mask:
        """Which of the positions x (n, 2) lie in the region grown by `tol`, or shrunk where it is negative: (n,)."""
        ...


def outline(region: Region, box: Box) -> tuple[Curve, ...]:
    """Curves that hold all of a region's boundary within a finite box; InvalidScene if it does not name them."""
    if not hasattr(region, "outline"):
        raise InvalidScene(
            f"{type(region).__name__} has no outline for something to act on: make the domain of rectangles, circles, "
            "polygons and half-planes, or give the region a method `outline`"
        )
    return tuple(region.outline(box))


@dataclass(frozen=True)
class Rectangle:
    """Axis-aligned closed rectangle; a side may be infinite, which makes it a half-plane or a strip."""

    lower: tuple[float, float]
    upper: tuple[float, float]

    def __post_init__(self) -> None:
        if np.shape(self.lower) != (2,) or np.shape(self.upper) != (2,):
            raise InvalidScene(f"rectangle {self.lower} to {self.upper}: give two coordinates for each corner")
        sides = np.subtract(self.upper, self.lower)
        if not np.all(sides >= 0):  # also catches NaN
            raise InvalidScene(f"rectangle {self.lower} to {self.upper}: make every upper bound at least its lower one")

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner, each (2,)."""
        return np.array(self.lower, float), np.array(self.upper, float)

    def contains(self, x: Array, tol: float = 0.0) -> Mask:
        """Which of the positions x (n, 2) lie in the rectangle grown by `tol`: (n,). Its corners stay sharp."""
        lower, upper = self.bounds
        return np.all((x >= lower - tol) & (x <= upper + tol), axis=1)

    def outline(self, box: Box) -> tuple[Curve, ...]:
        """Its sides; an infinite one ends with the box, and one at infinity is none."""
        (x0, y0), (x1, y1) = np.maximum(self.lower, box[0]), np.minimum(self.upper, box[1])
        upright = [Line((x, y0), (x, y1)) for x in (self.lower[0], self.upper[0]) if np.isfinite(x) and y1 > y0]
        level = [Line((x0, y), (x1, y)) for y in (self.lower[1], self.upper[1]) if np.isfinite(y) and x1 > x0]
        return *upright, *level


@dataclass(frozen=True)
class Circle:
    """Closed disc."""

    centre: tuple[float, float]
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", finite_pair("centre of a circle", self.centre))
        if not 0 < number(self.radius) < np.inf:
            raise InvalidScene(f"circle of radius {self.radius}: give a positive, finite length")

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner, each (2,)."""
        return np.subtract(self.centre, self.radius), np.add(self.centre, self.radius)

    def contains(self, x: Array, tol: float = 0.0) -> Mask:
        """Which of the positions x (n, 2) lie in the circle grown by `tol`: (n,)."""
        return np.hypot(*(x - self.centre).T) <= self.radius + tol

    def outline(self, box: Box) -> tuple[Curve, ...]:
        """The circle."""
        return (Round(self.centre, self.radius),)


@dataclass(frozen=True)
class HalfPlane:
    """(x - point) . normal <= 0: what lies behind a line, seen along its outward normal of any length."""

    point: tuple[float, float]
    normal: tuple[float, float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", finite_pair("point of a half-plane", self.point))
        object.__setattr__(self, "normal", finite_pair("normal of a half-plane", self.normal))
        if self.normal == (0, 0):
            raise InvalidScene("the normal of a half-plane is zero: give the direction that leads out of it")

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner, each (2,): infinite."""
        return np.full(2, -np.inf), np.full(2, np.inf)

    def contains(self, x: Array, tol: float = 0.0) -> Mask:
        """Which of the positions x (n, 2) lie in the half-plane grown by `tol`: (n,)."""
        unit = np.divide(self.normal, np.max(np.abs(self.normal)))  # against underflow of a short one
        return (x - self.point) @ (unit / np.hypot(*unit)) <= tol

    def outline(self, box: Box) -> tuple[Curve, ...]:
        """Its line, from end to end of the box."""
        along = np.array([-self.normal[1], self.normal[0]]) / np.hypot(*self.normal)
        corners = np.array([(x, y) for x in (box[0][0], box[1][0]) for y in (box[0][1], box[1][1])])
        reach = (corners - self.point) @ along
        (ax, ay), (bx, by) = (self.point + t * along for t in (reach.min(), reach.max()))
        return (Line((float(ax), float(ay)), (float(bx), float(by))),)


@dataclass(frozen=True)
class Polygon:
    """Closed polygon of any shape and orientation; where it crosses itself the even-odd rule says what is inside.

    A vertex given twice in a row, as the last one of a closed ring, counts once.
    """

    vertices: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        if np.ndim(self.vertices) != 2:
            raise InvalidScene("vertices of a polygon: give one (x, y) for each")
        given = [finite_pair("vertex of a polygon", vertex) for vertex in self.vertices]
        kept = tuple(vertex for vertex, then in zip(given, [*given[1:], given[0]], strict=True) if vertex != then)
        object.__setattr__(self, "vertices", kept)
        if len(kept) < 3:
            raise InvalidScene(f"polygon of {len(kept)} different vertices: give at least three")
        sides = np.subtract(kept, kept[0])
        if np.linalg.matrix_rank(sides / np.abs(sides).max(), tol=1e-12) < 2:
            raise InvalidScene("all vertices of a polygon lie on one line: move one off it")

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner, each (2,)."""
        return np.min(self.vertices, axis=0), np.max(self.vertices, axis=0)

    def contains(self, x: Array, tol: float = 0.0) -> Mask:
        """Which of the positions x (n, 2) lie in the polygon grown by `tol`: (n,). Grown corners are round.

        By the signed distance to the boundary; on an edge not parallel to an axis it is zero to rounding only.
        """
        distance, inside = np.full(len(x), np.inf), np.zeros(len(x), dtype=bool)
        for a, b in zip(self.vertices, [*self.vertices[1:], self.vertices[0]], strict=True):
            edge, (dx, dy) = np.subtract(b, a), (x - a).T
            cross, along = edge[0] * dy - edge[1] * dx, edge[0] * dx + edge[1] * dy
            beside = (along >= 0) & (along <= edge @ edge)
            # elsewhere the nearest point is a vertex, and every vertex is the start of some edge
            distance = np.minimum(distance, np.where(beside, np.abs(cross) / np.hypot(*edge), np.hypot(dx, dy)))
            # a ray along +x leaves through this edge
            inside ^= ((a[1] <= x[:, 1]) != (b[1] <= x[:, 1])) & ((cross > 0) == (edge[1] > 0))
        return np.where(inside, -distance, distance) <= tol

    def outline(self, box: Box) -> tuple[Curve, ...]:
        """Its edges."""
        return tuple(Line(a, b) for a, b in zip(self.vertices, [*self.vertices[1:], self.vertices[0]], strict=True))


@dataclass(frozen=True)
class LevelSet:
    """{phi(x) <= 0} within the box from `lower` to `upper`, whose sides may be infinite; phi maps (n, 2) to (n,).

    `tol` is compared with phi itself: the region grows by that length only where phi is a signed distance, so scale
    phi to a slope of about one at its zero line. Any other test of positions is one, too, and then not grown at all:
    phi = lambda x: np.where(inside(x), -1.0, 1.0), in a scene much larger than 1e-9.
    """

    lower: tuple[float, float]
    upper: tuple[float, float]
    phi: Callable[[Array], Array]

    def __post_init__(self) -> None:
        if not callable(self.phi):
            raise InvalidScene(f"level set of {self.phi!r}: give a function of positions (n, 2) with values (n,)")
        Rectangle(self.lower, self.upper)  # refuses what is no box

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner, each (2,)."""
        return np.array(self.lower, float), np.array(self.upper, float)

    def contains(self, x: Array, tol: float = 0.0) -> Mask:
        """Which of the positions x (n, 2) lie in the box grown by `tol` and have phi <= tol: (n,)."""
        phi = np.asarray(self.phi(x))
        if phi.shape != (len(x),) or np.any(np.isnan(phi)):
            raise InvalidScene(
                f"phi of a level set: {np.count_nonzero(np.isnan(phi))} NaN in shape {phi.shape} for {len(x)} "
                "positions; give one number for each"
            )
        return Rectangle(self.lower, self.upper).contains(x, tol) & (phi <= tol)


@dataclass(frozen=True)
class Difference:
    """What lies in `whole` and not in `hole`."""

    whole: Region
    hole: Region

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner of `whole`, each (2,)."""
        return self.whole.bounds

    def contains(self, x: Array, tol: float = 0.0) -> Mask:
        """Which of the positions x (n, 2) lie in the difference grown by `tol`: (n,)."""
        return self.whole.contains(x, tol) & ~self.hole.contains(x, -tol)

    def outline(self, box: Box) -> tuple[Curve, ...]:
        """Those of the whole and of the hole."""
        return *outline(self.whole, box), *outline(self.hole, box)


@dataclass(frozen=True, init=False, repr=False)
class Union:
    """What lies in at least one of the parts: Union(a, b, ...). Shrunk, it also loses a seam between two of them."""

    parts: tuple[Region, ...]

    def __init__(self, *parts: Region) -> None:
        object.__setattr__(self, "parts", _some("union", parts))

    def __repr__(self) -> str:
        return f"Union({', '.join(map(repr, self.parts))})"

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner, each (2,)."""
        lower, upper = zip(*(part.bounds for part in self.parts), strict=True)
        return np.min(lower, axis=0), np.max(upper, axis=0)

    def contains(self, x: Array, tol: float = 0.0) -> Mask:
        """Which of the positions x (n, 2) lie in a part grown by `tol`: (n,)."""
        return np.any([part.contains(x, tol) for part in self.parts], axis=0)

    def outline(self, box: Box) -> tuple[Curve, ...]:
        """Those of all parts."""
        return tuple(curve for part in self.parts for curve in outline(part, box))


@dataclass(frozen=True, init=False, repr=False)
class Intersection:
    """What lies in every one of the parts: Intersection(a, b, ...). Grown, its corners stay sharp."""

    parts: tuple[Region, ...]

    def __init__(self, *parts: Region) -> None:
        object.__setattr__(self, "parts", _some("intersection", parts))

    def __repr__(self) -> str:
        return f"Intersection({', '.join(map(repr, self.parts))})"

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner of what the parts' boxes share, each (2,); crossed over where that is nothing."""
        lower, upper = zip(*(part.bounds for part in self.parts), strict=True)
        return np.max(lower, axis=0), np.min(upper, axis=0)

    def contains(self, x: Array, tol: float = 0.0) -> Mask:
        """Which of the positions x (n, 2) lie in every part grown by `tol`: (n,)."""
        return np.all([part.contains(x, tol) for part in self.parts], axis=0)

    def outline(self, box: Box) -> tuple[Curve, ...]:
        """Those of all parts."""
        return tuple(curve for part in self.parts for curve in outline(part, box))


def _some(what: str, parts: tuple[Region, ...]) -> tuple[Region, ...]:
    if not parts or not all(hasattr(part, "contains") for part in parts):
        raise InvalidScene(f"{what} of {parts}: give one region or more, each as an argument of its own")
    return parts
