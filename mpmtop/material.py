"""Material: elastic tangent, von Mises stress and the SIMP law. Voigt order xx, yy, xy; engineering shear strain."""

import numpy as np

from mpmtop.arrays import Array
from mpmtop.body import Material


def tangent(material: Material) -> Array:
    """Elastic tangent D (3, 3) at unit Young's modulus: stress = E D strain; plane strain is Eq. (5)."""
    nu = material.poisson
    if material.plane == "strain":
        return np.array([[1 - nu, nu, 0], [nu, 1 - nu, 0], [0, 0, 0.5 - nu]]) / ((1 + nu) * (1 - 2 * nu))
    return np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]]) / (1 - nu**2)


def von_mises(stress: Array, material: Material) -> Array:
    """Von Mises stress (p,) of plane stresses (p, 3); in plane strain sigma_zz = nu (sigma_xx + sigma_yy) counts."""
    xx, yy, xy = stress.T
    zz = material.poisson * (xx + yy) if material.plane == "strain" else np.zeros_like(xx)
    return np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * xy**2)


def von_mises_form(material: Material) -> Array:
    """Q (3, 3) with vm^2 = sigma . Q sigma for plane stresses, sigma_zz included: dvm/dsigma = Q sigma / vm."""
    nu = material.poisson if material.plane == "strain" else 0.0
    a, b = 1 - nu + nu**2, -(1 + 2 * nu - 2 * nu**2) / 2
    return np.array([[a, b, 0], [b, a, 0], [0, 0, 3.0]])


def simp(rho: Array, penal: float, contrast: float) -> tuple[Array, Array]:
    """SIMP, Eq. (10): E/E0 and its derivative, both (p,), for densities rho (p,) in [0, 1]; contrast is E_min / E0."""
    return contrast + rho**penal * (1 - contrast), penal * rho ** (penal - 1) * (1 - contrast)
