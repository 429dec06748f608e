"""Body: what is analysed, free of any discretisation.

Both solvers read the same `Body`; how it is cut into grid cells, material points or finite elements is theirs.
Lengths, forces and moduli are in any consistent units, so compliance comes in force^2 / modulus (per unit thickness).
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from mpmtop.errors import EmptyDomain, InvalidScene, LoadOutsideBody, UnsupportedBody
from mpmtop.loads import Load, positions
from mpmtop.region import Region, check_region


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
    """Every node in `region` is held in the components marked in `fixed` (x, y), true or false, or 1 or 0.

    Limit: a support holds nodes, not points. A body whose points have left the cells at its clamp by more than half a
    cell hangs on what is left there, and is far too compliant; once nothing is left, that is an error.
    """

    region: Region
    fixed: tuple[bool, bool] = (True, True)

    def __post_init__(self) -> None:
        check_region("the region of a support", self.region)
        flags = list(self.fixed) if np.shape(self.fixed) == (2,) else []
        if len(flags) != 2 or any(isinstance(flag, str) or flag not in (0, 1) for flag in flags):
            raise InvalidScene(
                f"support fixed in {self.fixed!r}: say which of the two components, (x, y), are held, as (True, False)"
            )
        if not any(flags):
            raise InvalidScene("a support fixed in (False, False) holds nothing: hold a component, or leave it out")
        object.__setattr__(self, "fixed", (bool(flags[0]), bool(flags[1])))


@dataclass(frozen=True)
class Body:
    """Material in a domain, held by supports and pulled by loads.

    Loads may be left out where an analysis is given its nodal forces.
    """

    domain: Region
    supports: tuple[Support, ...]
    loads: tuple[Load, ...] = ()
    material: Material = field(default_factory=Material)

    def __post_init__(self) -> None:
        check_region("the domain", self.domain)
        lower, upper = self.domain.bounds
        if not (np.all(np.isfinite([lower, upper])) and np.all(upper > lower)):
            raise EmptyDomain(f"the domain spans {lower} to {upper}: give it a finite, positive area")
        if not isinstance(self.material, Material):
            raise InvalidScene(f"material {self.material!r}: give one Material for all of the body")
        for name, parts in (("supports", self.supports), ("loads", self.loads)):
            if not isinstance(parts, tuple):
                raise InvalidScene(f"{name} of a body: give a tuple, with a comma after a single one")
        if not self.supports:
            raise UnsupportedBody("the body has no support: add one")
        for support in self.supports:
            if not isinstance(support, Support):
                raise InvalidScene(f"support {support!r}: give Support(region, fixed)")
        for load in self.loads:
            if not hasattr(load, "act"):
                raise InvalidScene(f"load {load!r}: give a `PointLoad`, `RegionLoad` or `PositionLoad`")
        named = positions(self.loads)
        outside = named[~self.domain.contains(named, 1e-9 * float(np.max(upper - lower)))]
        if len(outside):
            raise LoadOutsideBody(
                f"load at {tuple(outside[0].tolist())} is outside the domain: move it into {lower} to {upper}"
            )
