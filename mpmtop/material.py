"""Material: elastic tangent, von Mises stress and the SIMP law. Voigt order xx, yy, xy; engineering shear strain."""

import numpy as np

from mpmtop.arrays import Array
from mpmtop.body import Elastic, Material
from mpmtop.criteria import StressMeasure


def tangent(material: Material | Elastic) -> Array:
    """Elastic tangent D (3, 3), or (p, 3, 3) of a Poisson's ratio (p,), at unit Young's modulus: stress = E D strain.

    Plane strain is Eq. (5).
    """
    nu = np.asarray(material.poisson, float)
    if material.plane == "strain":
        scale = (1 + nu) * (1 - 2 * nu)
        return _symmetric((1 - nu) / scale, nu / scale, (0.5 - nu) / scale)
    scale = 1 - nu**2
    return _symmetric(1 / scale, nu / scale, (1 - nu) / 2 / scale)


def _symmetric(same: Array, other: Array, shear: Array) -> Array:
    """[[same, other, 0], [other, same, 0], [0, 0, shear]] of numbers, (3, 3), or of (p,), (p, 3, 3)."""
    none = np.zeros_like(same)
    rows = [[same, other, none], [other, same, none], [none, none, shear]]
    return np.ascontiguousarray(np.moveaxis(np.array(rows), (0, 1), (-2, -1)))


def by_material(rows: Array, matrix: Array) -> Array:
    """row . matrix (p, 3) of rows (p, 3) and one matrix (3, 3) for all, or (p, 3, 3) of each."""
    return rows @ matrix if matrix.ndim == 2 else np.matmul(rows[:, None], matrix)[:, 0]


def von_mises(stress: Array, material: Material | Elastic, measure: StressMeasure = "von_mises") -> Array:
    """Von Mises stress (p,) of plane stresses (p, 3); in plane strain sigma_zz = nu (sigma_xx + sigma_yy) counts,
    unless the measure is in the plane."""
    xx, yy, xy = stress.T
    zz = _poisson_out_of_plane(material, measure) * (xx + yy)
    return np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * xy**2)


def von_mises_form(material: Material | Elastic, measure: StressMeasure = "von_mises") -> Array:
    """Q (3, 3), or (p, 3, 3) of a Poisson's ratio (p,), with vm^2 = sigma . Q sigma for plane stresses, as `von_mises`
    measures: dvm/dsigma = Q sigma / vm."""
    nu = np.asarray(_poisson_out_of_plane(material, measure))
    return _symmetric(1 - nu + nu**2, -(1 + 2 * nu - 2 * nu**2) / 2, np.full_like(nu, 3.0))


def _poisson_out_of_plane(material: Material | Elastic, measure: StressMeasure) -> float | Array:
    """The ratio of sigma_zz, as it counts, to sigma_xx + sigma_yy."""
    return material.poisson if material.plane == "strain" and measure == "von_mises" else 0.0


def simp(rho: Array, penal: float, contrast: float) -> tuple[Array, Array]:
    """SIMP, Eq. (10): E/E0 and its derivative, both (p,), for densities rho (p,) in [0, 1]; contrast is E_min / E0."""
    return contrast + rho**penal * (1 - contrast), simp_slope(rho, penal, contrast)


def simp_slope(rho: Array, penal: float, contrast: float) -> Array:
    """The derivative alone: the other power costs ten times as much."""
    return penal * rho ** (penal - 1) * (1 - contrast)
