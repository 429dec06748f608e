"""Total Lagrangian hyperelasticity by finite elements: load steps of a body, and the gradient of its compliances.

    R(u) = int S(F) : F^T grad v dV - t f . v = 0,    F = 1 + grad u,

with the second Piola-Kirchhoff stress S and its moduli from principal stretches, on the mesh, supports and dead loads
of a `FemModel`. Nothing depends on the path: a step only starts Newton's method, and each level has its own adjoint.
Plane strain.

Void of a design would invert long before the body does. With the fraction g of an element that is nonlinear, its energy
is W(1 + g grad u) - W_lin(g grad u) + W_lin(grad u): that of the law for g = 1 and linear elasticity, which cannot
invert, for g = 0. Source: Wang, Lazarov, Sigmund and Jensen (2014), Comput. Methods Appl. Mech. Engrg 276:453.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu
from skfem import CellBasis
from skfem.helpers import grad

from mpmtop.arrays import Array, Index
from mpmtop.body import check_load_steps
from mpmtop.errors import InvalidScene, NotConverged, UnsupportedBody
from reference_fem.elasticity import FemModel
from reference_fem.mesh import GEOMETRY_TOLERANCE, shortest_side
from reference_fem.stiffness import numbering

TOLERANCE = 1e-11
"""Of |R| against applied forces and reactions: Newton is quadratic, the next step would be at rounding."""
ROUNDING = 1e-15
"""Part of the largest stiffness times the largest displacement and the body's extent, wherever it lies, left in R."""
MAX_NEWTON = 15
"""Newton steps for one part of the load; 4 to 9 are usual, 13 the most that have led anywhere."""
MAX_HALVINGS = 5
"""Of a load step, before it counts as failed."""


class PrincipalLaw(Protocol):
    """A law by x_a = the squares of the principal stretches in the plane, (..., 2), at unit modulus."""

    @property
    def poisson(self) -> float:
        """Poisson's ratio at small strain."""
        ...

    def stress(self, x: Array) -> Array:
        """Principal values S_a (..., 2) of the second Piola-Kirchhoff stress."""
        ...

    def moduli(self, x: Array) -> tuple[Array, Array]:
        """2 dS_a/dx_b (..., 2, 2), and (S_2 - S_1) / (x_2 - x_1) (...,), which has a limit where they coincide."""
        ...


@dataclass(frozen=True)
class LogarithmicLaw:
    """tau_a = lambda (e_1 + e_2) + 2 mu e_a with e_a = ln(x_a) / 2, and S_a = tau_a / x_a."""

    poisson: float

    @cached_property
    def _lame(self) -> tuple[float, float]:
        return self.poisson / ((1 + self.poisson) * (1 - 2 * self.poisson)), 0.5 / (1 + self.poisson)

    def stress(self, x: Array) -> Array:
        """See `PrincipalLaw`."""
        lam, mu = self._lame
        log = np.log(x)
        return (lam / 2 * log.sum(axis=-1, keepdims=True) + mu * log) / x

    def moduli(self, x: Array) -> tuple[Array, Array]:
        """See `PrincipalLaw`."""
        lam, mu = self._lame
        S = self.stress(x)
        outer = x[..., :, None] * x[..., None, :]
        direct = (lam + 2 * mu * np.eye(2)) / outer - 2 * np.eye(2) * (S / x)[..., None]
        x1, d = x[..., 0], x[..., 1] - x[..., 0]
        same = d == 0
        slope = np.where(same, 1 / x1, np.log1p(d / x1) / np.where(same, 1, d))  # of the logarithm between the two
        half_trace = lam / 2 * np.log(x).sum(axis=-1)
        return direct, -(half_trace + mu * (np.log(x1) - x1 * slope)) / x.prod(axis=-1)


@dataclass(frozen=True)
class NeoHookeanLaw:
    """tau_a = mu (x_a - 1) + lambda ln J, J^2 = x_1 x_2, and S_a = tau_a / x_a."""

    poisson: float

    @cached_property
    def _lame(self) -> tuple[float, float]:
        return self.poisson / ((1 + self.poisson) * (1 - 2 * self.poisson)), 0.5 / (1 + self.poisson)

    def _pressure(self, x: Array) -> Array:
        lam, mu = self._lame
        return lam / 2 * np.log(x).sum(axis=-1) - mu

    def stress(self, x: Array) -> Array:
        """See `PrincipalLaw`."""
        return self._lame[1] + self._pressure(x)[..., None] / x

    def moduli(self, x: Array) -> tuple[Array, Array]:
        """See `PrincipalLaw`."""
        lam, _ = self._lame
        pressure = self._pressure(x)
        direct = lam / (x[..., :, None] * x[..., None, :]) - 2 * np.eye(2) * (pressure[..., None] / x**2)[..., None]
        return direct, -pressure / x.prod(axis=-1)


@dataclass(frozen=True, eq=False)
class LargeModel:
    """A finite element model with a law in large deformation, fully integrated: 2 x 2 Gauss points for the bilinear
    element, 3 x 3 for the biquadratic one. Tensors at these points are (e, q, 4), the entries xx, xy, yx, yy."""

    fem: FemModel
    law: PrincipalLaw
    basis: CellBasis

    @cached_property
    def _dofs(self) -> Index:
        """Degrees of freedom (e, d) of the elements."""
        return np.asarray(self.basis.element_dofs.T)

    @cached_property
    def _gradients(self) -> Array:
        """Gradients (e, q, 4, d) of the functions at the Gauss points."""
        functions = [np.asarray(grad(function[0])) for function in self.basis.basis]  # (2, 2, e, q) each
        return np.ascontiguousarray(
            np.moveaxis(np.stack(functions), (3, 4), (0, 1)).reshape(*self._shape, -1, 4).swapaxes(2, 3)
        )

    @property
    def _shape(self) -> tuple[int, int]:
        """Elements and Gauss points of each."""
        return self.basis.dx.shape

    @cached_property
    def _places(self) -> tuple[Index, Index]:
        """Which entries (k,) of the element matrices (e d d,) are of free degrees of freedom, and where they go among
        those of the tangent, whose pattern is the linear stiffness's."""
        n, number = len(self.fem.free), numbering(self.basis.N, self.fem.free)[self._dofs]
        row, column = np.broadcast_arrays(number[:, :, None], number[:, None])
        free = np.flatnonzero((row >= 0) & (column >= 0))
        linear = self.fem.stiffness
        keys = np.repeat(np.arange(n), np.diff(linear.indptr)) * n + linear.indices
        return free, np.searchsorted(keys, column.ravel()[free] * n + row.ravel()[free])

    def grad(self, u: Array) -> Array:
        """grad u (e, q, 2, 2)."""
        return (self._gradients @ u[self._dofs][:, None, :, None]).reshape(*self._shape, 2, 2)

    def to_dofs(self, T: Array) -> Array:
        """int T : grad v dV (N,) of T (e, q, 2, 2)."""
        weighted = T.reshape(*self._shape, 1, 4) * self.basis.dx[..., None, None]
        by_element = np.sum(weighted @ self._gradients, axis=(1, 2))
        return np.asarray(np.bincount(self._dofs.ravel(), by_element.ravel(), self.basis.N), float)

    @cached_property
    def _linear(self) -> Array:
        """C (4, 4) of linear elasticity at unit modulus, by grad u."""
        nu = self.fem.body.material.poisson
        mu, swap = 0.5 / (1 + nu), np.eye(4)[[0, 2, 1, 3]]
        trace = np.array([1.0, 0.0, 0.0, 1.0])
        return 2 * mu * nu / (1 - 2 * nu) * np.outer(trace, trace) + mu * (np.eye(4) + swap)

    def respond(self, u: Array, nonlinear: Array | None = None) -> tuple[Array, Array, Array]:
        """At unit modulus the stress T (e, q, 2, 2) that displacements u (N,) cause, dT/dgrad u (e, q, 4, 4) and dT/dg
        (e, q, 2, 2); `nonlinear` are the fractions g (e,), one unless given."""
        g = np.ones(self._shape[0]) if nonlinear is None else nonlinear
        g = g[:, None, None, None]
        H = self.grad(u)
        F = g * H + np.eye(2)
        S, D = _second_stress(self.law, F)
        I = np.eye(2)  # noqa: E741
        M = (F[..., :, None, :, None] * I[None, :, None, :]).reshape(*self._shape, 4, 4)
        # material and geometric part of dP/dF
        A = M @ D @ M.swapaxes(-2, -1) + (I[:, None, :, None] * S[..., None, :, None, :]).reshape(*self._shape, 4, 4)
        P = F @ S
        linear = (H.reshape(*self._shape, 4) @ self._linear).reshape(H.shape)
        by_g = P + g * (A @ H.reshape(*self._shape, 4, 1)).reshape(H.shape) - 2 * g * linear
        return g * P + (1 - g**2) * linear, g**2 * A + (1 - g**2) * self._linear, by_g

    def residual(self, moduli: Array, u: Array, nonlinear: Array | None = None) -> Array:
        """Internal forces (N,) of displacements u (N,) with element moduli (e,)."""
        return self.to_dofs(moduli[:, None, None, None] * self.respond(u, nonlinear)[0])

    def tangent(self, moduli: Array, D: Array) -> sp.csc_matrix:
        """K (n, n) on the free degrees of freedom of the moduli (e,) and D = dT/dgrad u (e, q, 4, 4)."""
        D = D * (moduli[:, None] * self.basis.dx)[..., None, None]
        e, d = self._dofs.shape
        G = self._gradients
        local = G.reshape(e, -1, d).swapaxes(1, 2) @ (D @ G).reshape(e, -1, d)
        (free, entry), linear = self._places, self.fem.stiffness
        data = np.bincount(entry, local.ravel()[free], len(linear.indices))
        return sp.csc_matrix((data, linear.indices, linear.indptr), shape=(len(self.fem.free),) * 2)

    def work(self, T: Array, v: Array) -> Array:
        """int T : grad v dV of each element (e,)."""
        return np.sum(np.sum(T * self.grad(v), axis=(-2, -1)) * self.basis.dx, axis=1)

    def solve(self, moduli: Array, D: Array, f: Array) -> Array:
        """K^-1 f (N,), zero where held. Past a limit point K is not positive definite and takes pivots."""
        free, K = self.fem.free, self.tangent(moduli, D)
        try:
            factor = self.fem.factorise(K)
        except UnsupportedBody:
            factor = splu(K, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve
        v = np.zeros(self.basis.N)
        v[free] = factor(f[free])
        return v


def large_model(fem: FemModel, law: PrincipalLaw) -> LargeModel:
    """`fem` in large deformation. InvalidScene in plane stress, where the law has another Poisson's ratio, and for
    supports and loads that load steps do not have, see `check_load_steps`."""
    if fem.body.material.plane != "strain":
        raise InvalidScene("large deformation in plane stress: the laws are those of plane strain, set plane='strain'")
    if law.poisson != fem.body.material.poisson:
        raise InvalidScene(f"{law} for a material of Poisson's ratio {fem.body.material.poisson}: give both the same")
    check_load_steps(fem.body, fem.centres, fem.area, GEOMETRY_TOLERANCE * shortest_side(fem.basis.mesh))
    biquadratic = fem.basis.Nbfun == 18
    return LargeModel(fem, law, CellBasis(fem.basis.mesh, fem.basis.elem, intorder=5 if biquadratic else 3))


def _second_stress(law: PrincipalLaw, F: Array) -> tuple[Array, Array]:
    """S (..., 2, 2) and its moduli 2 dS/dC (..., 4, 4), by the eigenvectors n_a of C = F^T F."""
    x, n = np.linalg.eigh(F.swapaxes(-2, -1) @ F)
    S = (n * law.stress(x)[..., None, :]) @ n.swapaxes(-2, -1)
    direct, shear = law.moduli(x)
    first, second = n[..., 0], n[..., 1]

    def dyad(a: Array, b: Array) -> Array:
        return (a[..., :, None] * b[..., None, :]).reshape(*a.shape[:-1], 4)

    N = np.stack([dyad(first, first), dyad(second, second)], axis=-2)
    mixed = dyad(first, second) + dyad(second, first)
    D = N.swapaxes(-2, -1) @ direct @ N
    return S, D + shear[..., None, None] * mixed[..., :, None] * mixed[..., None, :]


def load_steps(
    model: LargeModel, moduli: Array, levels: Array, *, nonlinear: Array | None = None, tol: float = TOLERANCE
) -> Iterator[Array]:
    """Displacements u (N,) at each of the load `levels`, of 1 for the whole load, with element moduli (e,) and
    `nonlinear` fractions (e,), one unless given.

    Newton's method from the level before; where it fails, the load is halved on the way. Raises NotConverged.
    """
    u, before = np.zeros(model.basis.N), 0.0
    for step, level in enumerate(levels, start=1):
        reached, part = before, level - before
        while reached != level:
            target = level if abs(level - reached) <= abs(part) * (1 + 1e-9) else reached + part
            found = _newton(model, moduli, nonlinear, u, target, tol)
            if found is not None:
                u, reached = found, target
            elif abs(part) <= abs(level - before) / 2**MAX_HALVINGS:
                raise NotConverged(
                    f"load level {step} of {len(levels)}: Newton's method fails from {reached:.4g} on; take more "
                    "levels, a smaller load or a stiffer design"
                )
            else:
                part /= 2
        before = level
        yield u


def _newton(
    model: LargeModel, moduli: Array, nonlinear: Array | None, u: Array, level: float, tol: float
) -> Array | None:
    """u at the level; None where the residual does not fall or an element inverts."""
    held = np.ones(len(u), bool)
    held[model.fem.free] = False
    external = level * model.fem.f_ext
    share = np.ones(len(moduli)) if nonlinear is None else nonlinear
    extent = float(np.ptp(model.basis.mesh.p, axis=1).max())
    for k in range(MAX_NEWTON):
        if np.any(np.linalg.det(share[:, None, None, None] * model.grad(u) + np.eye(2)) <= 0):
            return None
        T, D, _ = model.respond(u, nonlinear)
        internal = model.to_dofs(moduli[:, None, None, None] * T)
        R = np.where(held, 0, external - internal)
        applied = np.linalg.norm(np.where(held, internal, external))
        stiffest = float(np.max(np.abs(D) * (moduli[:, None] * model.basis.dx)[..., None, None]))
        stiffest *= float(np.max(np.abs(model._gradients))) ** 2
        least = ROUNDING * (stiffest * (np.abs(u).max() + extent))
        if k > 0 and np.linalg.norm(R) <= max(tol * applied, least):  # a small load is none
            return u
        du = model.solve(moduli, D, R)
        if not np.all(np.isfinite(du)):
            return None
        u = u + du
    return None


def von_mises(law: PrincipalLaw, F: Array) -> tuple[Array, Array]:
    """Von Mises measure (...) of the Kirchhoff stress at unit modulus, tau_zz = lambda ln J included, and its
    derivative by F (..., 2, 2); zero where there is no stress.

    By tau_a = x_a S_a, and dvm/dC = sum_a dvm/dx_a n_a x n_a.
    """
    x, n = np.linalg.eigh(F.swapaxes(-2, -1) @ F)
    half = law.poisson / ((1 + law.poisson) * (1 - 2 * law.poisson)) / 2
    S, (direct, _) = law.stress(x), law.moduli(x)
    tau = np.concatenate([x * S, half * np.log(x).sum(axis=-1, keepdims=True)], axis=-1)
    by_x = np.concatenate([(x[..., None] * direct + 2 * np.eye(2) * S[..., None]) / 2, half / x[..., None, :]], axis=-2)
    vm = np.sqrt(np.sum((tau - np.roll(tau, 1, axis=-1)) ** 2, axis=-1) / 2)
    by_tau = np.divide(
        3 * tau - tau.sum(axis=-1, keepdims=True), 2 * vm[..., None], out=np.zeros_like(tau), where=vm[..., None] > 0
    )
    by_C = (n * (by_tau[..., None, :] @ by_x)) @ n.swapaxes(-2, -1)
    return vm, 2 * F @ by_C


def with_load(model: LargeModel, f_ext: Array) -> LargeModel:
    """The same model under dead nodal forces f_ext (N,)."""
    return replace(model, fem=replace(model.fem, f_ext=f_ext))
