"""Material: elastic tangent, von Mises stress and the SIMP law. Voigt order xx, yy, xy; engineering shear strain."""

import numpy as np

from mpmtop.arrays import Array
from mpmtop.body import Material
from mpmtop.criteria import StressMeasure


def tangent(material: Material) -> Array:
    """Elastic tangent D (3, 3) at unit Young's modulus: stress = E D strain; plane strain is Eq. (5)."""
    nu = material.poisson
    if material.plane == "strain":
        return np.array([[1 - nu, nu, 0], [nu, 1 - nu, 0], [0, 0, 0.5 - nu]]) / ((1 + nu) * (1 - 2 * nu))
    return np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]]) / (1 - nu**2)


def von_mises(stress: Array, material: Material, measure: StressMeasure = "von_mises") -> Array:
    """Von Mises stress (p,) of plane stresses (p, 3); in plane strain sigma_zz = nu (sigma_xx + sigma_yy) counts,
    unless the measure is in the plane."""
    xx, yy, xy = stress.T
    zz = _poisson_out_of_plane(material, measure) * (xx + yy)
    return np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * xy**2)


def von_mises_form(material: Material, measure: StressMeasure = "von_mises") -> Array:
    """Q (3, 3) with vm^2 = sigma . Q sigma for plane stresses, as `von_mises` measures: dvm/dsigma = Q sigma / vm."""
    nu = _poisson_out_of_plane(material, measure)
    a, b = 1 - nu + nu**2, -(1 + 2 * nu - 2 * nu**2) / 2
    return np.array([[a, b, 0], [b, a, 0], [0, 0, 3.0]])


def _poisson_out_of_plane(material: Material, measure: StressMeasure) -> float:
    """The ratio of sigma_zz, as it counts, to sigma_xx + sigma_yy."""
    return material.poisson if material.plane == "strain" and measure == "von_mises" else 0.0


def simp(rho: Array, penal: float, contrast: float) -> tuple[Array, Array]:
    """SIMP, Eq. (10): E/E0 and its derivative, both (p,), for densities rho (p,) in [0, 1]; contrast is E_min / E0."""
    return contrast + rho**penal * (1 - contrast), penal * rho ** (penal - 1) * (1 - contrast)
