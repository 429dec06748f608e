"""Body: what is analysed, free of any discretisation.

Both solvers read the same `Body`; how it is cut into grid cells, material points or finite elements is theirs.
Lengths, forces and moduli are in any consistent units, so compliance comes in force^2 / modulus (per unit thickness).
"""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from mpmtop.arrays import Array, numbers
from mpmtop.errors import EmptyDomain, InvalidScene, LoadOutsideBody, UnsupportedBody
from mpmtop.loads import Load, action, positions
from mpmtop.region import Region, check_region, finite, finite_pair


@dataclass(frozen=True)
class Material:
    """Isotropic linear elasticity: Young's modulus E0 of the solid, Poisson's ratio, plane strain or plane stress.

    Limit: in plane strain the body is too stiff as Poisson's ratio nears 0.5, with tent and GIMP from about 0.45 on,
    with B-splines from about 0.49, in the end several times, unless `discretise(..., b_bar=True)`.
    """

    young: float = 1.0
    poisson: float = 0.3
    plane: Literal["strain", "stress"] = "strain"

    def __post_init__(self) -> None:
        if not finite("Young's modulus", self.young) > 0:
            raise InvalidScene(f"Young's modulus {self.young}: give a positive, finite number")
        if not -1 < finite("Poisson's ratio", self.poisson) < 0.5:
            raise InvalidScene(f"Poisson's ratio {self.poisson}: give a number above -1 and below 0.5")
        if not isinstance(self.plane, str) or self.plane not in ("strain", "stress"):
            raise InvalidScene(f"plane {self.plane!r}: say 'strain' or 'stress'")


@dataclass(frozen=True)
class Part:
    """What lies in `region` is of a `material` of its own, not of the body's: a layer, an inclusion, a weld.

    A material point or an element is of the part that holds its centre. Parts may touch, and what lies on the edge
    between two is of the first; they must not overlap.
    """

    region: Region
    material: Material

    def __post_init__(self) -> None:
        check_region("the region of a part", self.region)
        if not isinstance(self.material, Material):
            raise InvalidScene(f"material {self.material!r} of a part: give a Material(young, poisson, plane)")


@dataclass(frozen=True, eq=False)
class Elastic:
    """Young's modulus E0 and Poisson's ratio at n places: each a number where it is the same everywhere, else (n,)."""

    young: float | Array
    poisson: float | Array
    plane: Literal["strain", "stress"]


@dataclass(frozen=True)
class Support:
    """Every node in `region` is held in the components marked in `fixed` (x, y), true or false, or 1 or 0, at the
    `displacement` (2,) [length], zero unless given.

    Limit: a support holds nodes, not points. A body whose points have left the cells at its clamp by more than half a
    cell hangs on what is left there, and is far too compliant; once nothing is left, that is an error.
    """

    region: Region
    fixed: tuple[bool, bool] = (True, True)
    displacement: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        check_region("the region of a support", self.region)
        flags = list(self.fixed) if numbers(self.fixed, 2) else []
        if len(flags) != 2 or any(flag not in (0, 1) for flag in flags):
            raise InvalidScene(
                f"support fixed in {self.fixed!r}: say which of the two components, (x, y), are held, as (True, False)"
            )
        if not any(flags):
            raise InvalidScene("a support fixed in (False, False) holds nothing: hold a component, or leave it out")
        object.__setattr__(self, "fixed", (bool(flags[0]), bool(flags[1])))
        object.__setattr__(self, "displacement", finite_pair("displacement of a support", self.displacement))
        if any(u != 0 and not held for u, held in zip(self.displacement, self.fixed, strict=True)):
            raise InvalidScene(
                f"displacement {self.displacement} of a support fixed in {self.fixed}: fix what is displaced"
            )


@dataclass(frozen=True)
class EdgeSupport:
    """The part of the domain's boundary that lies in `region` is held, wherever the grid's lines run: in both
    components, along a `direction` (2,) only, or along the "normal", so that the edge slides along itself.

    It is held weakly, by Nitsche's method, see `mpmtop.ties`. Nodes of small cuts are as loose as elsewhere: with tent
    and GIMP a ghost penalty ties them, `discretise(..., ghost=0.01)`.

    Limit: tents count a point wholly to the cell of its centre, so that a cell at the edge is filled by up to half a
    point more or less than the body fills it. A bar of eight cells is longer by up to 4.4 % with 2 x 2 points per cell,
    2.5 % with 3 x 3, 1.5 % with 4 x 4 and 0.9 % with 6 x 6, over all shifts of the grid; GIMP is exact at each, and so
    are tents on points that are cut along the outline, `discretise(..., cut=True)`.
    """

    region: Region
    direction: tuple[float, float] | Literal["normal"] | None = None

    def __post_init__(self) -> None:
        check_region("the region of an edge support", self.region)
        object.__setattr__(self, "direction", _along_what("an edge support", self.direction))

    def directions(self, normal: Array) -> tuple[Array, ...]:
        """Unit vectors (n, 2) along which positions of outward normals (n, 2) are held."""
        return _along(self.direction, normal)


@dataclass(frozen=True)
class Spring:
    """Spring of `stiffness` [force / length] between the ground and `position`, along a `direction` (2,) of any length.

    It pulls with -stiffness u at the position itself, through the functions that the grid or the mesh has there.
    """

    position: tuple[float, float]
    stiffness: float
    direction: tuple[float, float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", finite_pair("position of a spring", self.position))
        object.__setattr__(self, "direction", _direction("a spring", self.direction))
        if not finite("stiffness of a spring", self.stiffness) > 0:
            raise InvalidScene(f"stiffness {self.stiffness} of a spring: give a positive number")


@dataclass(frozen=True)
class Bed:
    """Elastic bed of `stiffness` [force / length^2] along the part of the domain's boundary that lies in `region`: it
    pulls with -stiffness u per length, in both components, along a `direction` (2,), or along the "normal" only.

    It has no slack: it pulls where the body lifts off as it pushes where the body sinks in.
    """

    region: Region
    stiffness: float
    direction: tuple[float, float] | Literal["normal"] | None = None

    def __post_init__(self) -> None:
        check_region("the region of a bed", self.region)
        if not finite("stiffness of a bed", self.stiffness) > 0:
            raise InvalidScene(f"stiffness {self.stiffness} of a bed: give a positive number")
        object.__setattr__(self, "direction", _along_what("a bed", self.direction))

    def directions(self, normal: Array) -> tuple[Array, ...]:
        """Unit vectors (n, 2) along which it pulls at positions of outward normals (n, 2)."""
        return _along(self.direction, normal)


def _along(direction: tuple[float, float] | Literal["normal"] | None, normal: Array) -> tuple[Array, ...]:
    """Unit vectors (n, 2): the axes, the normals (n, 2), or one direction for all."""
    if direction is None:
        return np.tile([1.0, 0.0], (len(normal), 1)), np.tile([0.0, 1.0], (len(normal), 1))
    return (normal if direction == "normal" else np.tile(direction, (len(normal), 1)),)


def _along_what(of: str, value: Any) -> Any:
    return value if value is None or (isinstance(value, str) and value == "normal") else _direction(of, value)


def _direction(of: str, value: Any) -> tuple[float, float]:
    x, y = finite_pair(f"direction of {of}", value)
    length = float(np.hypot(x, y))
    if length == 0:
        raise InvalidScene(f"direction of {of} is zero: give the direction in which it acts")
    return x / length, y / length


@dataclass(frozen=True)
class Body:
    """Material in a domain, held by supports and pulled by loads; `parts` of it may be of other materials.

    Loads may be left out where an analysis is given its nodal forces.
    """

    domain: Region
    supports: tuple[Support | EdgeSupport | Spring | Bed, ...]
    loads: tuple[Load, ...] = ()
    material: Material = field(default_factory=Material)
    parts: tuple[Part, ...] = ()

    def __post_init__(self) -> None:
        check_region("the domain", self.domain)
        lower, upper = self.domain.bounds
        if not (np.all(np.isfinite([lower, upper])) and np.all(upper > lower)):
            raise EmptyDomain(f"the domain spans {lower} to {upper}: give it a finite, positive area")
        if not isinstance(self.material, Material):
            raise InvalidScene(
                f"material {self.material!r}: give one Material for the body, and `parts` for what is of another"
            )
        for name, given in (("supports", self.supports), ("loads", self.loads), ("parts", self.parts)):
            if not isinstance(given, tuple):
                raise InvalidScene(f"{name} of a body: give a tuple, with a comma after a single one")
        for part in self.parts:
            if not isinstance(part, Part):
                raise InvalidScene(f"part {part!r}: give a `Part(region, material)`")
            if part.material.plane != self.material.plane:
                raise InvalidScene(
                    f"a part in plane {part.material.plane} of a body in plane {self.material.plane}: a body is as "
                    "thick everywhere, let all of its materials be in plane strain or all in plane stress"
                )
        if not self.supports:
            raise UnsupportedBody("the body has no support: add one")
        for support in self.supports:
            if not isinstance(support, Support | EdgeSupport | Spring | Bed):
                raise InvalidScene(f"support {support!r}: give a `Support`, an `EdgeSupport`, a `Spring` or a `Bed`")
        for load in self.loads:
            if not hasattr(load, "act"):
                raise InvalidScene(f"load {load!r}: give a `PointLoad`, `RegionLoad` or `PositionLoad`")
        named = np.concatenate([positions(self.loads), np.reshape([s.position for s in self.springs], (-1, 2))])
        outside = named[~self.domain.contains(named, 1e-9 * float(np.max(upper - lower)))]
        if len(outside):
            raise LoadOutsideBody(
                f"load or spring at {tuple(outside[0].tolist())} is outside the domain: move it into {lower} to {upper}"
            )

    @property
    def held(self) -> tuple[Support, ...]:
        """The supports that hold nodes."""
        return tuple(support for support in self.supports if isinstance(support, Support))

    @property
    def edges(self) -> tuple[EdgeSupport, ...]:
        """The supports along the outline."""
        return tuple(support for support in self.supports if isinstance(support, EdgeSupport))

    @property
    def springs(self) -> tuple[Spring, ...]:
        """The springs."""
        return tuple(support for support in self.supports if isinstance(support, Spring))

    @property
    def beds(self) -> tuple[Bed, ...]:
        """The elastic beds."""
        return tuple(support for support in self.supports if isinstance(support, Bed))

    @property
    def is_displaced(self) -> bool:
        """Whether a support prescribes a displacement other than zero."""
        return any(any(support.displacement) for support in self.held)


def elastic(body: Body, x: Array, of: str) -> Elastic:
    """Elastic constants at x (n, 2), the centres of points or elements, which `of` names.

    InvalidScene for parts that overlap, and for one that holds none of the centres.
    """
    own = body.material
    if not body.parts:
        return Elastic(own.young, own.poisson, own.plane)
    lower, upper = body.domain.bounds
    tol = 1e-9 * float(np.max(upper - lower))
    held, inside = (np.array([part.region.contains(x, by) for part in body.parts]) for by in (tol, -tol))
    for k, part in enumerate(body.parts):
        if not np.any(held[k]):
            start, end = (corner.tolist() for corner in part.region.bounds)
            raise InvalidScene(
                f"part {k}, from {start} to {end}, holds the centre of no {of}: move it onto the body, or use smaller "
                "ones"
            )
    both = np.flatnonzero((held.sum(axis=0) > 1) & inside.any(axis=0))
    if len(both):
        first, second = np.flatnonzero(held[:, both[0]])[:2]
        raise InvalidScene(
            f"parts {first} and {second} both hold {len(both)} of the {of}s, the first at {x[both[0]]}: take one "
            "region out of the other (`Difference`)"
        )
    number = np.where(held.any(axis=0), held.argmax(axis=0), len(body.parts))
    materials = (*(part.material for part in body.parts), own)
    young, poisson = (np.array([getattr(each, name) for each in materials])[number] for name in ("young", "poisson"))
    return Elastic(_one_or_each(young), _one_or_each(poisson), own.plane)


def _one_or_each(values: Array) -> float | Array:
    return float(values[0]) if np.all(values == values[0]) else values


def check_load_steps(body: Body, x: Array, volume: Array, tol: float) -> None:
    """InvalidScene for what load steps do not have: supports other than nodes that stay where they are, loads along the
    outline or by volume, and several materials. Arguments as for `Load.act`."""
    if body.parts:
        raise InvalidScene("parts of another material are of small strain: in large deformation leave out `parts`")
    if body.springs or body.edges or body.beds or body.is_displaced:
        raise InvalidScene(
            "springs, beds, supports along the outline and prescribed displacements are of small strain: in large "
            "deformation give each `Support` a region of nodes, without a displacement"
        )
    acts = action(body.loads, x, volume, tol)
    if acts.along or acts.throughout:
        raise InvalidScene(
            "loads along the outline and by volume are of small strain: in large deformation give a `PointLoad` or a "
            "`RegionLoad`, dead loads that points carry"
        )
