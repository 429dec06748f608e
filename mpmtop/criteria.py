"""Criteria: by what a design is judged."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from mpmtop.arrays import Array
from mpmtop.errors import InvalidScene

StressMeasure = Literal["von_mises", "von_mises_in_plane"]
"""Von Mises stress with sigma_zz or without it; by the same names in `fields.SCALARS` and in exported files."""


@dataclass(frozen=True)
class Compliance:
    """J1 = f_ext . u (Eq. 8)."""


@dataclass(frozen=True)
class PNormStress:
    """J2 = (sum_p (rho_p^q vm_p)^p)^(1/p) over all material points (Eq. 9).

    vm is the von Mises stress of solid material, with modulus E0, under the strain at the point; the relaxation rho^q,
    0 < q < penal, takes it away from voids. In plane strain sigma_zz = nu (sigma_xx + sigma_yy) counts in it; the
    measure "von_mises_in_plane" leaves it out, as codes made for plane stress do:
    vm^2 = sigma_xx^2 - sigma_xx sigma_yy + sigma_yy^2 + 3 sigma_xy^2. In plane stress the two are one.
    """

    p: float = 12.0
    q: float = 0.5
    measure: StressMeasure = "von_mises"

    def __post_init__(self) -> None:
        if not 1 <= self.p < np.inf:
            raise InvalidScene(f"p-norm exponent {self.p}: give a finite number of at least 1")
        if not 0 <= self.q < np.inf:
            raise InvalidScene(f"stress relaxation q {self.q}: give a finite number of at least 0")
        if self.measure not in get_args(StressMeasure):
            raise InvalidScene(f"stress measure {self.measure!r}: give one of {', '.join(get_args(StressMeasure))}")


def finite_gradient(gradient: Array, objective: Compliance | PNormStress) -> Array:
    """dJ/ddesign (a,) as it is; InvalidScene where an entry is infinite, at densities of zero."""
    if isinstance(objective, PNormStress) and np.any(gradient == np.inf):
        raise InvalidScene(
            f"the p-norm has an infinite derivative at a density of 0 with q p < 1 (q = {objective.q}, p = "
            f"{objective.p}): give a positive rho_min, or a q of at least 1 / p"
        )
    return gradient
