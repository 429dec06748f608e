"""Design: what is sought in a body, and the law that makes stiffness of density."""

from dataclasses import dataclass

import numpy as np

from mpmtop.arrays import Array, number
from mpmtop.errors import InvalidScene
from mpmtop.region import Region, check_region, finite_pair

STEEPEST = 1e4  # beta: nine densities in ten thousand are then between 0.1 and 0.9 if the filtered ones are uniform
WITHIN = 0.4
"""Of the half-width of a projection's step: 0.8 left steps that took the volume back and forth by 0.4 % (MMA, beta 16),
1.6 and more lost the design."""
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


@dataclass(frozen=True)
class Projection:
    """Smoothed step of the filtered densities r, towards 0 below the threshold eta and 1 above it, the steeper the
    larger beta:

        rho = (tanh(beta eta) + tanh(beta (r - eta))) / (tanh(beta eta) + tanh(beta (1 - eta)))

    `preserve_volume` takes for eta, in place of `threshold`, that at which rho has the volume of r, whatever the
    design. All variables then move it, those that are solid or void most, and rules take steps of `largest_move` at
    most. Sharpen it in stages (`continuation`) of a design each, from beta 1 on.
    Sources: Wang, Lazarov and Sigmund (2011), Struct. Multidisc. Optim. 43:767; Xu, Cai and Cheng (2010), ibid. 41:495.
    """

    beta: float
    threshold: float = 0.5
    preserve_volume: bool = False

    def __post_init__(self) -> None:
        if not 0 < number(self.beta) <= STEEPEST:
            raise InvalidScene(f"beta {self.beta!r} of a projection: give a positive number of at most {STEEPEST:g}")
        if not 0 <= number(self.threshold) <= 1:
            raise InvalidScene(f"threshold {self.threshold!r} of a projection: give a number from 0 to 1")
        if not isinstance(self.preserve_volume, bool):
            raise InvalidScene(f"preserve_volume {self.preserve_volume!r}: say True or False")
        if self.preserve_volume and self.threshold != 0.5:
            raise InvalidScene("preserve_volume finds the threshold itself: leave `threshold` out")

    @property
    def largest_move(self) -> float:
        """How far a rule may move a variable, of its range. If all move alike so does the threshold of a kept volume,
        and derivatives hold while it goes no further than `WITHIN` the step, whose half-width is 1 / beta."""
        return min(1.0, WITHIN / self.beta) if self.preserve_volume else 1.0


@dataclass(frozen=True)
class Mirror:
    """The line through `point` across `normal`, of any length: a design that is its own image in it."""

    point: tuple[float, float]
    normal: tuple[float, float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", finite_pair("point of a mirror", self.point))
        object.__setattr__(self, "normal", finite_pair("normal of a mirror", self.normal))
        if not np.any(self.normal):
            raise InvalidScene("normal (0, 0) of a mirror: give one that is not zero")

    def image(self, x: Array) -> Array:
        """Where positions x (n, 2) are seen."""
        unit = np.divide(self.normal, np.hypot(*self.normal))
        return x - 2 * np.outer((x - self.point) @ unit, unit)


@dataclass(frozen=True)
class Design:
    """Densities rho of the domain, at most `volume_fraction` of it solid (Eq. 8).

    They are those of the design after a density filter of radius `filter_radius` [length]; rho_min <= design <= 1. The
    stiffness law is Eq. (10), E = E0 (contrast + rho^penal (1 - contrast)) with contrast = E_min / E0.

    Passive parts of the domain are no design: `passive_solid` has density 1 throughout and `passive_void` density 0.
    What is solid counts as volume; the fraction is of all of the domain that is not passive void.

    A `projection` makes the densities from the filtered ones. The design is its own image in every mirror of its
    `symmetry`: points that are images of one another have one variable.
    """

    volume_fraction: float
    filter_radius: float
    penal: float = 3.0
    contrast: float = 1e-9
    rho_min: float = 1e-3
    passive_solid: Region | None = None
    passive_void: Region | None = None
    projection: Projection | None = None
    symmetry: tuple[Mirror, ...] = ()

    def __post_init__(self) -> None:
        for name, region in (("passive_solid", self.passive_solid), ("passive_void", self.passive_void)):
            if region is not None:
                check_region(name, region)
        if not 0 < number(self.volume_fraction) <= 1:
            raise InvalidScene(f"volume fraction {self.volume_fraction}: give a number above 0 and at most 1")
        if not 0 < number(self.filter_radius) < np.inf:
            raise InvalidScene(
                f"filter radius {self.filter_radius}: give a positive length "
                "(one below the point spacing filters nothing)"
            )
        if not 0 <= number(self.rho_min) < 1:
            raise InvalidScene(f"rho_min {self.rho_min}: give a number from 0 to below 1")
        if self.rho_min > self.volume_fraction:
            raise InvalidScene(
                f"rho_min {self.rho_min} exceeds the volume fraction {self.volume_fraction}: no design is feasible"
            )
        if not 0 <= number(self.contrast) < 1:
            raise InvalidScene(f"modulus contrast {self.contrast}: give a number from 0 to below 1")
        if not 1 <= number(self.penal) < np.inf:
            raise InvalidScene(f"penalty {self.penal}: give a finite number of at least 1")
        if self.projection is not None and not isinstance(self.projection, Projection):
            raise InvalidScene(f"projection {self.projection!r}: give Projection(beta)")
        if not isinstance(self.symmetry, tuple) or not all(isinstance(mirror, Mirror) for mirror in self.symmetry):
            raise InvalidScene("symmetry of a design: give a tuple of Mirror(point, normal), with a comma after one")
