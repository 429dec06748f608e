"""Isotropic hyperelastic laws in plane strain, at unit Young's modulus.

In the plane an isotropic energy is a function W(I, J) of I = F : F and J = det F, and the cofactor C = J F^-T is linear
in F. So, with subscripts for derivatives,

    P = dW/dF = 2 W_I F + W_J C,
    A = dP/dF = 2 W_I 1 + W_J dC/dF + 4 W_II F x F + 2 W_IJ (F x C + C x F) + W_JJ C x C,

without eigenvectors: coincident principal stretches are no special case. All functions take complex F as well, which
is how their derivatives are checked.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from mpmtop.arrays import Array
from mpmtop.errors import InvalidScene

SERIES_BELOW = 0.05
"""sinh^2 of half the difference of the logarithmic principal stretches up to which a series replaces the closed form:
the latter's derivative loses 1 / SERIES_BELOW of its digits there."""
TERMS = 13
"""Of the series: 0.05^13 is below the rounding of 1."""


class Energy(NamedTuple):
    """W (p,) and its derivatives by I and J, (p,) each."""

    W: Array
    I: Array  # noqa: E741
    J: Array
    II: Array
    IJ: Array
    JJ: Array


class Law(Protocol):
    """An isotropic law in plane strain at unit modulus."""

    @property
    def poisson(self) -> float:
        """Poisson's ratio at small strain."""
        ...

    def energy(self, F: Array) -> Energy:
        """Stored energy per reference volume of F (p, 2, 2), det F > 0, and its derivatives."""
        ...

    def squared_von_mises(self, F: Array) -> tuple[Array, Array, Array]:
        """Square of the von Mises measure of the Kirchhoff stress, tau_zz included, and its derivatives by I and J."""
        ...


def _checked(poisson: float) -> None:
    if not -1 < poisson < 0.5:
        raise InvalidScene(f"Poisson's ratio {poisson}: give a number above -1 and below 0.5")


def lame(poisson: float) -> tuple[float, float]:
    """Lame's lambda and mu at unit Young's modulus."""
    return poisson / ((1 + poisson) * (1 - 2 * poisson)), 0.5 / (1 + poisson)


def jacobian(F: Array) -> Array:
    """det F (p,) of F (p, 2, 2)."""
    return F[:, 0, 0] * F[:, 1, 1] - F[:, 0, 1] * F[:, 1, 0]


def cofactor(F: Array) -> Array:
    """d det F / dF = J F^-T (p, 2, 2)."""
    C = np.empty_like(F)
    C[:, 0, 0], C[:, 0, 1] = F[:, 1, 1], -F[:, 1, 0]
    C[:, 1, 0], C[:, 1, 1] = -F[:, 0, 1], F[:, 0, 0]
    return C


def _squared_difference(F: Array) -> Array:
    """r^2 (p,): (b_1 - b_2)^2 / 4 of the eigenvalues of b = F F^T, without cancellation where they coincide."""
    half = (F[:, 0, 0] ** 2 + F[:, 0, 1] ** 2 - F[:, 1, 0] ** 2 - F[:, 1, 1] ** 2) / 2
    off = F[:, 0, 0] * F[:, 1, 0] + F[:, 0, 1] * F[:, 1, 1]
    return half**2 + off**2


@dataclass(frozen=True)
class Hencky:
    """Logarithmic elasticity: tau = lambda tr(e) 1 + 2 mu e with e = ln(F F^T) / 2.

    With a half the difference of the logarithmic principal stretches of b, cosh a = q = I / 2J, it is
    W = (lambda + mu) / 2 ln^2 J + mu / 2 a^2.
    """

    poisson: float = 0.3

    def __post_init__(self) -> None:
        _checked(self.poisson)

    def energy(self, F: Array) -> Energy:
        """See `Law`."""
        lam, mu = lame(self.poisson)
        J, log_J, q, a2, by_q, by_qq = _logarithmic(F)
        q_I, q_J = 1 / (2 * J), -q / J
        by_q, by_qq = mu / 2 * by_q, mu / 2 * by_qq
        k = lam + mu
        return Energy(
            (k * log_J**2 + mu * a2) / 2,
            by_q * q_I,
            k * log_J / J + by_q * q_J,
            by_qq * q_I**2,
            by_qq * q_I * q_J - by_q / (2 * J**2),
            k * (1 - log_J) / J**2 + by_qq * q_J**2 + 2 * by_q * q / J**2,
        )

    def squared_von_mises(self, F: Array) -> tuple[Array, Array, Array]:
        """mu^2 (3 a^2 + ln^2 J), by (3/2) (2 mu)^2 |dev e|^2; see `Law`."""
        mu = lame(self.poisson)[1]
        J, log_J, q, a2, by_q, _ = _logarithmic(F)
        return (
            mu**2 * (3 * a2 + log_J**2),
            3 * mu**2 * by_q / (2 * J),
            mu**2 * (2 * log_J - 3 * by_q * q) / J,
        )


def _logarithmic(F: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
    """J, ln J, q, a^2 and its first and second derivative by q, (p,) each.

    By y = sinh^2 a, all are smooth at a = 0: d(a^2)/dq = 2 a / sinh a = g(y), d2(a^2)/dq2 = 2 q g'(y).
    """
    J = jacobian(F)
    y = _squared_difference(F) / J**2
    q = np.sqrt(1 + y)
    n = np.arange(TERMS)
    c = np.cumprod(np.append(1.0, -(2 * n[1:] - 1) / (2 * n[1:]))) / (2 * n + 1)  # asinh(x) / x = sum c_n x^2n
    large = np.flatnonzero(np.abs(y) >= SERIES_BELOW)
    near = y
    if len(large) > 0:
        near = y.copy()
        near[large] = 0
    g, by_y = 2 * _polynomial(c, near), 2 * _polynomial((c * n)[1:], near)
    if len(large) > 0:
        s = y[large]
        root = np.sqrt(s)
        ratio = np.log(root + np.sqrt(1 + s)) / root  # asinh, which numpy's complex one is not exact for
        g[large], by_y[large] = 2 * ratio, (1 / np.sqrt(1 + s) - ratio) / s
    return J, np.log(J), q, y * g**2 / 4, g, 2 * q * by_y


def _polynomial(c: Array, y: Array) -> Array:
    """sum_n c_n y^n."""
    value = np.zeros_like(y)
    for c_n in c[::-1]:
        value = value * y + c_n
    return value


@dataclass(frozen=True)
class NeoHookean:
    """Compressible neo-Hookean: W = mu / 2 (I - 2 - 2 ln J) + lambda / 2 ln^2 J, tau = mu (b - 1) + lambda ln J 1."""

    poisson: float = 0.3

    def __post_init__(self) -> None:
        _checked(self.poisson)

    def energy(self, F: Array) -> Energy:
        """See `Law`."""
        lam, mu = lame(self.poisson)
        J = jacobian(F)
        log_J, zero = np.log(J), np.zeros_like(J)
        W = mu / 2 * (np.sum(F**2, axis=(1, 2)) - 2 - 2 * log_J) + lam / 2 * log_J**2
        return Energy(W, zero + mu / 2, (lam * log_J - mu) / J, zero, zero, (mu + lam - lam * log_J) / J**2)

    def squared_von_mises(self, F: Array) -> tuple[Array, Array, Array]:
        """mu^2 (3 r^2 + (I / 2 - 1)^2) with r^2 = I^2 / 4 - J^2; see `Law`."""
        mu = lame(self.poisson)[1]
        half_I = np.sum(F**2, axis=(1, 2)) / 2
        return (
            mu**2 * (3 * _squared_difference(F) + (half_I - 1) ** 2),
            mu**2 * (4 * half_I - 1),
            -6 * mu**2 * jacobian(F),
        )


def stress(law: Law, F: Array) -> Array:
    """First Piola-Kirchhoff stress P (p, 2, 2) at unit modulus."""
    return first_stress(law.energy(F), F)


def tangent(law: Law, F: Array) -> tuple[Array, Array]:
    """P (p, 2, 2) and A (p, 4, 4) = dP/dF at unit modulus, rows and columns being the entries xx, xy, yx, yy."""
    e = law.energy(F)
    return first_stress(e, F), moduli(e, F)


def first_stress(e: Energy, F: Array) -> Array:
    """P (p, 2, 2) of F and the energy's derivatives there."""
    return 2 * e.I[:, None, None] * F + e.J[:, None, None] * cofactor(F)


def moduli(e: Energy, F: Array) -> Array:
    """A (p, 4, 4) of F and the energy's derivatives there."""
    f, c = F.reshape(-1, 4), cofactor(F).reshape(-1, 4)
    by_I = 4 * e.II[:, None] * f + 2 * e.IJ[:, None] * c
    by_J = 2 * e.IJ[:, None] * f + e.JJ[:, None] * c
    A = by_I[:, :, None] * f[:, None] + by_J[:, :, None] * c[:, None]
    k = np.arange(4)
    A[:, k, k] += 2 * e.I[:, None]
    A[:, k, 3 - k] += e.J[:, None] * np.array([1, -1, -1, 1])
    return A


def kirchhoff(P: Array, F: Array) -> Array:
    """Kirchhoff stress tau = P F^T (p, 2, 2)."""
    return P @ F.swapaxes(1, 2)


def out_of_plane(law: Law, F: Array) -> Array:
    """tau_zz (p,) at unit modulus: lambda ln J for both laws."""
    return lame(law.poisson)[0] * np.log(jacobian(F))


def von_mises(law: Law, F: Array) -> tuple[Array, Array]:
    """Von Mises measure (p,) of the Kirchhoff stress at unit modulus, and its derivative by F (p, 2, 2).

    Without stress it has no derivative; zero, one of its subgradients, is taken.
    """
    squared, by_I, by_J = law.squared_von_mises(F)
    vm = np.sqrt(squared)
    by_F = 2 * by_I[:, None, None] * F + by_J[:, None, None] * cofactor(F)
    some = vm != 0
    by_F[some] /= 2 * vm[some, None, None]
    by_F[~some] = 0
    return vm, by_F
