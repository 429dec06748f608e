"""Scene: what is analysed and optimised, free of any discretisation.

Both solvers read the same `Scene`; how it is cut into grid cells, material points or finite elements is theirs.
Lengths, forces and moduli are in any consistent units, so compliance comes in force^2 / modulus (per unit thickness).
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from mpmtop.region import Array as Array
from mpmtop.region import Difference as Difference
from mpmtop.region import Index as Index
from mpmtop.region import InvalidScene as InvalidScene
from mpmtop.region import Mask as Mask
from mpmtop.region import Rectangle as Rectangle
from mpmtop.region import Region as Region
from mpmtop.region import finite_pair


class EmptyDomain(InvalidScene):
    """The domain holds no area, or no material point."""


class LoadOutsideBody(InvalidScene):
    """A load acts where there is no material."""


class UnsupportedBody(ValueError):
    """The supports leave the body, or a part of it, free to move: the stiffness is singular."""


class PointOutsideGrid(ValueError):
    """A material point, or its domain, leaves the background grid."""


class NotConverged(RuntimeError):
    """An iteration ended before it met its tolerance."""


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
        if not 0 < self.young < np.inf:
            raise InvalidScene(f"Young's modulus {self.young}: give a positive, finite number")
        if not -1 < self.poisson < 0.5:
            raise InvalidScene(f"Poisson's ratio {self.poisson}: give a number above -1 and below 0.5")
        if self.plane not in ("strain", "stress"):
            raise InvalidScene(f"plane {self.plane!r}: say 'strain' or 'stress'")


@dataclass(frozen=True)
class Support:
    """Every node in `region` is held in the components marked in `fixed` (x, y).

    Limit: a support holds nodes, not points. A body whose points have left the cells at its clamp by more than half a
    cell hangs on what is left there, and is far too compliant; once nothing is left, that is an error.
    """

    region: Region
    fixed: tuple[bool, bool] = (True, True)

    def __post_init__(self) -> None:
        if np.shape(self.fixed) != (2,):
            raise InvalidScene(f"support fixed in {self.fixed}: say which of the two components, (x, y), are held")


@dataclass(frozen=True)
class PointLoad:
    """Force (2,) at `position`, shared equally by the `points` material points nearest to it.

    With `points` = 0 no point carries it: it acts at the position itself, through bilinear functions of the grid or
    the mesh's own.
    """

    position: tuple[float, float]
    force: tuple[float, float]
    points: int = 6

    def __post_init__(self) -> None:
        finite_pair("position of a load", self.position)
        finite_pair("force", self.force)
        if self.points < 0:
            raise InvalidScene(f"point load shared by {self.points} points: give 0 or more")

    def shares(self, x: Array, tol: float) -> tuple[Index, Array]:
        """Indices (n,) of the points at x (p, 2) that carry the load, and the share of each (n,), of sum one.

        Points at one distance, to `tol`, are alike: if there are more of them than shares left, all of them divide
        what is left. The resultant is then as near to the position as can be, and a mirrored scene has a mirrored load.
        """
        if self.points > len(x):
            raise LoadOutsideBody(
                f"point load at {self.position} asks for {self.points} points and the body has {len(x)}: lower `points`"
            )
        distance = np.rint(np.hypot(*(x - self.position).T) / tol)
        last = np.partition(distance, self.points - 1)[self.points - 1]
        nearer, shell = np.flatnonzero(distance < last), np.flatnonzero(distance == last)
        left = (self.points - len(nearer)) / len(shell)
        return np.append(nearer, shell), np.repeat([1.0, left], [len(nearer), len(shell)]) / self.points

    def act(self, x: Array, tol: float) -> tuple[Array, Array]:
        """Positions (n, 2) and forces (n, 2) of the load on a body with points (or elements) at x (p, 2)."""
        if self.points == 0:
            return np.array([self.position], float), np.array([self.force], float)
        carriers, share = self.shares(x, tol)
        return x[carriers], np.outer(share, self.force)


@dataclass(frozen=True)
class RegionLoad:
    """Force (2,) shared equally by all material points in `region`."""

    region: Region
    force: tuple[float, float]

    def __post_init__(self) -> None:
        finite_pair("force", self.force)

    def shares(self, x: Array, tol: float) -> tuple[Index, Array]:
        """Indices (n,) of the points at x (p, 2) in the region, and the share of each (n,), of sum one."""
        inside = np.flatnonzero(self.region.contains(x, tol))
        if len(inside) == 0:
            raise LoadOutsideBody("the region of a load holds no material point: enlarge it or move it onto the body")
        return inside, np.full(len(inside), 1 / len(inside))

    def act(self, x: Array, tol: float) -> tuple[Array, Array]:
        """Positions (n, 2) and forces (n, 2) of the load on a body with points (or elements) at x (p, 2)."""
        carriers, share = self.shares(x, tol)
        return x[carriers], np.outer(share, self.force)


@dataclass(frozen=True)
class Compliance:
    """J1 = f_ext . u (Eq. 8)."""


@dataclass(frozen=True)
class PNormStress:
    """J2 = (sum_p (rho_p^q vm_p)^p)^(1/p) over all material points (Eq. 9).

    vm is the von Mises stress of solid material, with modulus E0, under the strain at the point; the relaxation rho^q,
    0 < q < penal, takes it away from voids.
    """

    p: float = 12.0
    q: float = 0.5

    def __post_init__(self) -> None:
        if not 1 <= self.p < np.inf:
            raise InvalidScene(f"p-norm exponent {self.p}: give a finite number of at least 1")
        if not 0 <= self.q < np.inf:
            raise InvalidScene(f"stress relaxation q {self.q}: give a finite number of at least 0")


@dataclass(frozen=True)
class Scene:
    """Minimise `objective` over the densities rho of the domain, at most `volume_fraction` of it solid (Eq. 8).

    The stiffness law is Eq. (10), E = E0 (contrast + rho^penal (1 - contrast)) with contrast = E_min / E0; densities
    are those of the design after a density filter of radius `filter_radius` [length]; rho_min <= design <= 1.

    Passive parts of the domain are no design: `passive_solid` has density 1 throughout and `passive_void` density 0.
    What is solid counts as volume; the fraction is of all of the domain that is not passive void.
    """

    name: str
    domain: Region
    supports: tuple[Support, ...]
    loads: tuple[PointLoad | RegionLoad, ...]
    filter_radius: float
    material: Material = field(default_factory=Material)
    volume_fraction: float = 0.4
    penal: float = 3.0
    contrast: float = 1e-9
    rho_min: float = 1e-3
    objective: Compliance | PNormStress = field(default_factory=Compliance)
    passive_solid: Region | None = None
    passive_void: Region | None = None

    def __post_init__(self) -> None:
        lower, upper = self.domain.bounds
        if not (np.all(np.isfinite([lower, upper])) and np.all(upper > lower)):
            raise EmptyDomain(f"domain of {self.name!r} spans {lower} to {upper}: give it a finite, positive area")
        for name, parts in (("supports", self.supports), ("loads", self.loads)):
            if not isinstance(parts, tuple):
                raise InvalidScene(f"{name} of {self.name!r}: give a tuple, with a comma after a single one")
        if not isinstance(self.objective, Compliance | PNormStress):
            raise InvalidScene(f"objective {self.objective!r}: give Compliance() or PNormStress(p, q)")
        if isinstance(self.objective, PNormStress) and self.objective.q >= self.penal:
            raise InvalidScene(f"stress relaxation q {self.objective.q}: give one below the penalty {self.penal}")
        if not self.supports:
            raise UnsupportedBody(f"{self.name!r} has no support: add one")
        if not self.loads:
            raise InvalidScene(f"{self.name!r} has no load: add one")
        for name, region in (("passive_solid", self.passive_solid), ("passive_void", self.passive_void)):
            if region is not None and not hasattr(region, "contains"):
                raise InvalidScene(f"{name} {region!r}: give a region, or None")
        self._check_point_loads()
        self._check_numbers()

    def _check_point_loads(self) -> None:
        lower, upper = self.domain.bounds
        tol = 1e-9 * float(np.max(upper - lower))
        for load in self.loads:
            if not isinstance(load, PointLoad):
                continue
            position = np.array([load.position])
            if not self.domain.contains(position, tol)[0]:
                raise LoadOutsideBody(f"load at {load.position} is outside the domain: move it into {lower} to {upper}")
            if self.passive_void is not None and self.passive_void.contains(position, -tol)[0]:
                raise LoadOutsideBody(f"load at {load.position} is in the passive void: move it onto material")

    def _check_numbers(self) -> None:
        if not 0 < self.volume_fraction <= 1:
            raise InvalidScene(f"volume fraction {self.volume_fraction}: give a number above 0 and at most 1")
        if not 0 < self.filter_radius < np.inf:
            raise InvalidScene(
                f"filter radius {self.filter_radius}: give a positive length "
                "(one below the point spacing filters nothing)"
            )
        if not 0 <= self.rho_min < 1:
            raise InvalidScene(f"rho_min {self.rho_min}: give a number from 0 to below 1")
        if self.rho_min > self.volume_fraction:
            raise InvalidScene(
                f"rho_min {self.rho_min} exceeds the volume fraction {self.volume_fraction}: no design is feasible"
            )
        if not 0 <= self.contrast < 1:
            raise InvalidScene(f"modulus contrast {self.contrast}: give a number from 0 to below 1")
        if not 1 <= self.penal < np.inf:
            raise InvalidScene(f"penalty {self.penal}: give a finite number of at least 1")


DENSITY_ROUNDING = 1e-9  # what a filter's sums may leave outside 0 to 1; no density of a design is that small


def physical_densities(rho: Array, count: int, of: str) -> Array:
    """Densities rho (count,) of each `of`, a point or an element, without their rounding: in [0, 1], read-only.

    A power of -1e-12 is NaN, and a gradient is taken from them later. Raises ValueError for another shape, NaN or
    densities outside 0 to 1 by more than rounding.
    """
    if np.shape(rho) != (count,):
        raise ValueError(f"densities of shape {np.shape(rho)} for {count} {of}s: give one for each {of}")
    if not np.all((rho >= -DENSITY_ROUNDING) & (rho <= 1 + DENSITY_ROUNDING)):  # NaN is neither
        raise ValueError("densities outside 0 to 1: give physical densities")
    rho = np.clip(rho, 0.0, 1.0)
    rho.flags.writeable = False
    return rho
