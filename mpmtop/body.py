"""Body: what is analysed, free of any discretisation.

Both solvers read the same `Body`; how it is cut into grid cells, material points or finite elements is theirs.
Lengths, forces and moduli are in any consistent units, so compliance comes in force^2 / modulus (per unit thickness).
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from mpmtop.errors import EmptyDomain, InvalidScene, LoadOutsideBody, UnsupportedBody
from mpmtop.loads import Load, positions
from mpmtop.region import Region


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
class Body:
    """Material in a domain, held by supports and pulled by loads.

    Loads may be left out where an analysis is given its nodal forces.
    """

    domain: Region
    supports: tuple[Support, ...]
    loads: tuple[Load, ...] = ()
    material: Material = field(default_factory=Material)

    def __post_init__(self) -> None:
        lower, upper = self.domain.bounds
        if not (np.all(np.isfinite([lower, upper])) and np.all(upper > lower)):
            raise EmptyDomain(f"the domain spans {lower} to {upper}: give it a finite, positive area")
        for name, parts in (("supports", self.supports), ("loads", self.loads)):
            if not isinstance(parts, tuple):
                raise InvalidScene(f"{name} of a body: give a tuple, with a comma after a single one")
        if not self.supports:
            raise UnsupportedBody("the body has no support: add one")
        for load in self.loads:
            if not hasattr(load, "act"):
                raise InvalidScene(f"load {load!r}: give a `PointLoad`, `RegionLoad` or `PositionLoad`")
        named = positions(self.loads)
        outside = named[~self.domain.contains(named, 1e-9 * float(np.max(upper - lower)))]
        if len(outside):
            raise LoadOutsideBody(
                f"load at {tuple(outside[0].tolist())} is outside the domain: move it into {lower} to {upper}"
            )
