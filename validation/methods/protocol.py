"""What every method is asked and answers: a case, an analysis of it, and what the method can do, said beforehand.

A case is a body with its points on a grid. A method states its capabilities; whoever asks compares them with what the
case needs (`lacking`) and gets a word in place of a number, never an exception: "not supported" for what the method
cannot be asked, "not stated" for what it does not tell.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple, Protocol

import numpy as np

from mpmtop.arrays import Array, Index, Mask
from mpmtop.body import Body
from mpmtop.errors import InvalidScene
from mpmtop.grid import Grid
from mpmtop.loads import Action, action
from mpmtop.points import MaterialPoints, seed
from mpmtop.region import Rectangle, Region

Capability = Literal[
    "analysis",  # `analyse`: displacement and stress at the points of a case
    "gradient",  # `gradient`: of its compliance by the points' moduli
    "shape functions",  # `shape`: nodes, values and gradients at positions
    "sheared domains",  # `shape_of_corners`: the same of parallelograms, by their corners
    "load steps",  # `steps`: positions and stress after each step of large deformation
    "quadrature at points",  # the points' stresses, by their volumes, make the internal force
    "moduli by point",
    "body forces",
    "loads at positions",
    "tractions",  # loads along the boundary or throughout, which the method integrates
    "prescribed displacements",
    "plane stress",
    "materials by region",
    "any outline",  # of the body, and not only a rectangle
    "points anywhere",  # of any size, and not only a lattice that fills the body
]
NOT_SUPPORTED: Literal["not supported"] = "not supported"
NOT_STATED: Literal["not stated"] = "not stated"
ON_LATTICE = 1e-9
"""Part of its spacing by which a point may miss its place on a lattice: rounding."""


class Held(NamedTuple):
    """Nodes of the grid, their lattice indices (m, 2) and positions (m, 2), that are held in the components marked in
    `fixed` (m, 2), at the displacements `value` (m, 2)."""

    node: Index
    position: Array
    fixed: Mask
    value: Array


@dataclass(frozen=True, eq=False)
class Case:
    """A body with `points` on a `grid`, Young's moduli (p,) by point, under its loads, `forces` (p, 2) that points
    carry beside them, and `body_force` (p, 2).

    A body force is per volume: a point carries V_p b_p. `prescribed` gives the displacements (n, 2) at which supports
    hold nodes at positions (n, 2), zero unless given.
    """

    name: str
    body: Body
    points: MaterialPoints
    grid: Grid
    moduli: Array
    forces: Array | None = None
    body_force: Array | None = None
    prescribed: Callable[[Array], Array] | None = None

    def __post_init__(self) -> None:
        if self.body.edges or self.body.springs or self.body.is_displaced:
            raise InvalidScene(
                f"{self.name}: springs, supports on edges and displaced ones are not asked of methods; hold nodes and "
                "say by `prescribed` where"
            )

    @cached_property
    def acts(self) -> Action:
        """Forces of the body's loads, on points and at positions, and those that points carry beside them."""
        acts = action(self.body.loads, self.points.x, self.points.volume, 1e-9 * min(self.grid.h))
        if self.forces is None:
            return acts
        loaded = np.flatnonzero(np.any(self.forces != 0, axis=1))
        points, carried = np.append(acts.points, loaded), np.concatenate([acts.carried, self.forces[loaded]])
        return acts._replace(points=points, carried=carried)

    @cached_property
    def point_forces(self) -> Array:
        """Forces (p, 2) that points carry; the body force is not among them."""
        forces = np.zeros_like(self.points.x)
        np.add.at(forces, self.acts.points, self.acts.carried)
        return forces

    @cached_property
    def carried(self) -> Array:
        """All that points carry (p, 2), body force included: nodal forces are sum_p N_ip carried_p, and what acts at
        positions."""
        if self.body_force is None:
            return self.point_forces
        return self.point_forces + self.points.volume[:, None] * self.body_force

    @cached_property
    def held(self) -> Held:
        """The nodes of the grid that the supports hold, also those that no point touches."""
        position = self.grid.node_positions()
        fixed = np.zeros(position.shape, bool)
        for support in self.body.held:
            fixed |= np.outer(support.region.contains(position, 1e-9 * min(self.grid.h)), support.fixed)
        index = np.flatnonzero(fixed.any(axis=1))
        node = np.stack(np.divmod(index, self.grid.nodes[1]), axis=1)
        return Held(node, position[index], fixed[index], self.displaced(position[index]))

    def displaced(self, x: Array) -> Array:
        """Displacements (n, 2) at which the supports hold nodes at x (n, 2)."""
        return np.zeros_like(x) if self.prescribed is None else self.prescribed(x)

    @cached_property
    def needs(self) -> frozenset[Capability]:
        """What a method must be able to do to analyse it."""
        asked: dict[Capability, bool] = {
            "analysis": True,
            "moduli by point": bool(np.any(self.moduli != self.moduli[0])),
            "body forces": self.body_force is not None,
            "loads at positions": len(self.acts.position) > 0,
            "tractions": bool(self.acts.along or self.acts.throughout),
            "prescribed displacements": self.prescribed is not None,
            "plane stress": self.body.material.plane == "stress",
            "materials by region": bool(self.body.parts),
            "any outline": not _a_rectangle(self.body.domain),
            "points anywhere": not _fill(self.body, self.points),
        }
        return frozenset(capability for capability, needed in asked.items() if needed)


def _a_rectangle(domain: Region) -> bool:
    """Whether the domain is its bounding box, as far as can be told: `Rectangle` says so, of others it is not known."""
    return isinstance(domain, Rectangle)


def _fill(body: Body, points: MaterialPoints) -> bool:
    """Whether the points are a lattice of equal ones that fills the domain, as `seed` makes it, in any order."""
    spacing = 2 * points.half_length[0]
    if np.any(np.abs(2 * points.half_length - spacing) > ON_LATTICE * spacing):
        return False
    try:
        lattice = seed(body.domain, (float(spacing[0]), float(spacing[1])))
    except InvalidScene:
        return False
    if len(lattice.x) != len(points.x):
        return False
    by_place = (np.lexsort(np.rint(p.x / (0.5 * spacing)).T) for p in (lattice, points))
    ours, theirs = (p.x[order] for p, order in zip((lattice, points), by_place, strict=True))
    return bool(np.all(np.abs(ours - theirs) <= ON_LATTICE * spacing))


@dataclass(frozen=True, eq=False)
class Answer:
    """Displacement u (p, 2), stress (p, 3) in the order xx, yy, xy, and compliance f.u; None for what is not stated.

    Of a code that steps in time `kinetic` is the kinetic energy that is left, by the strain energy.
    """

    u: Array
    stress: Array | None = None
    compliance: float | None = None
    kinetic: float | None = None


class Shape(NamedTuple):
    """Functions at k positions: lattice indices (k, n, 2) of n nodes each, values N (k, n) and gradients (k, n, 2)
    [1/length]; a node with zeros only is none."""

    node: Index
    N: Array
    grad_N: Array


class Step(NamedTuple):
    """After a load step: positions x (p, 2) and Cauchy stress (p, 3) in the order xx, yy, xy."""

    x: Array
    stress: Array


class Method(Protocol):
    """A method, by name and version; it is asked for what is in its `capabilities` only, and has these methods."""

    @property
    def name(self) -> str: ...

    @property
    def version(self) -> str: ...

    @property
    def capabilities(self) -> frozenset[Capability]: ...


class Analyses(Method, Protocol):
    """Capable of "analysis"."""

    def analyse(self, case: Case) -> Answer:
        """Static equilibrium of small strains, one answer for each point in the case's order."""
        ...


class Differentiates(Analyses, Protocol):
    """Capable of "gradient"."""

    def gradient(self, case: Case) -> Array:
        """dC/dE (p,): of the compliance by each point's Young's modulus, supports holding at zero."""
        ...


class HasShape(Method, Protocol):
    """Capable of "shape functions"."""

    def shape(self, x: Array, half_length: Array, grid: Grid) -> Shape:
        """Functions of the grid's nodes at positions x (k, 2) with domains of half_length (k, 2)."""
        ...


class HasCorners(Method, Protocol):
    """Capable of "sheared domains"."""

    def shape_of_corners(self, corners: Array, grid: Grid) -> Shape:
        """Functions of the grid's nodes of parallelograms by their corners (k, 4, 2), counter-clockwise from any."""
        ...


class Steps(Method, Protocol):
    """Capable of "load steps"."""

    def steps(self, case: Case, count: int) -> list[Step]:
        """The case's loads in `count` equal steps of large deformation, carried by the points, of fixed direction."""
        ...


def lacking(method: Method, case: Case, also: frozenset[Capability] = frozenset()) -> str:
    """What the method cannot do that the case, or the question `also`, needs: "" if nothing."""
    lacks = sorted((case.needs | also) - method.capabilities)
    return f"{NOT_SUPPORTED}: {', '.join(lacks)}" if lacks else ""


def compliance(method: Analyses, case: Case) -> float | str:
    """By the method, or the word for why it gives none."""
    return lacking(method, case) or stated(method.analyse(case).compliance)


def stated(number: float | None) -> float | str:
    """The number, or the word for none."""
    return NOT_STATED if number is None else number
