"""Total Lagrangian hyperelasticity by finite elements: load steps of a body, and the gradient of its compliances.

    R(u) = int S(F) : F^T grad v dV - t f . v = 0,    F = 1 + grad u,

with the second Piola-Kirchhoff stress S and its moduli from principal stretches, on the mesh, supports and dead loads
of a `FemModel`. Nothing depends on the path: a step only starts Newton's method, and each level has its own adjoint.
Plane strain.
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
from mpmtop.errors import InvalidScene, NotConverged
from reference_fem.elasticity import FemModel

TOLERANCE = 1e-11
"""Of |R| against applied forces and reactions: Newton is quadratic, the next step would be at rounding."""
ROUNDING = 1e-15
"""Part of the largest stiffness times the largest displacement, and of E times the sizes of elements, left in R."""
MAX_NEWTON = 25
"""Newton steps for one part of the load; 4 to 9 are usual."""
MAX_HALVINGS = 5
"""Of a load step, before it counts as failed."""


class PrincipalLaw(Protocol):
    """A law by x_a = the squares of the principal stretches in the plane, (..., 2), at unit modulus."""

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
    def _pattern(self) -> tuple[Index, Index, Index]:
        """Where the entries (e d d,) of element matrices go, and indices and indptr of the tangent."""
        e, d = self._dofs.shape
        row, column = (
            np.broadcast_to(dofs, (e, d, d)).ravel() for dofs in (self._dofs[:, :, None], self._dofs[:, None])
        )
        N = self.basis.N
        keys, entry = np.unique(column.astype(np.intp) * N + row, return_inverse=True)
        return entry, (keys % N).astype(np.int32), np.searchsorted(keys, N * np.arange(N + 1)).astype(np.int32)

    def _grad(self, u: Array) -> Array:
        """grad u (e, q, 2, 2)."""
        return (self._gradients @ u[self._dofs][:, None, :, None]).reshape(*self._shape, 2, 2)

    def deformation(self, u: Array) -> Array:
        """F (e, q, 2, 2) of displacements u (N,)."""
        return self._grad(u) + np.eye(2)

    def residual(self, moduli: Array, u: Array) -> Array:
        """Internal forces (N,) of displacements u (N,) with element moduli (e,)."""
        F = self.deformation(u)
        P = (F @ _second_stress(self.law, F)[0]).reshape(*self._shape, 1, 4)
        by_element = np.sum((P * (moduli[:, None] * self.basis.dx)[..., None, None]) @ self._gradients, axis=(1, 2))
        return np.asarray(np.bincount(self._dofs.ravel(), by_element.ravel(), self.basis.N), float)

    def by_moduli(self, u: Array, v: Array) -> Array:
        """v . d(internal forces)/dE (e,)."""
        F = self.deformation(u)
        work = np.sum(F @ _second_stress(self.law, F)[0] * self._grad(v), axis=(-2, -1))
        return np.sum(work * self.basis.dx, axis=1)

    def tangent(self, moduli: Array, u: Array) -> sp.csc_matrix:
        """K (N, N)."""
        F = self.deformation(u)
        S, D = _second_stress(self.law, F)
        I = np.eye(2)  # noqa: E741
        M = (F[..., :, None, :, None] * I[None, :, None, :]).reshape(*self._shape, 4, 4)
        # material and geometric part of dP/dF
        A = M @ D @ M.swapaxes(-2, -1) + (I[:, None, :, None] * S[..., None, :, None, :]).reshape(*self._shape, 4, 4)
        A *= (moduli[:, None] * self.basis.dx)[..., None, None]
        e, d = self._dofs.shape
        G = self._gradients
        local = G.reshape(e, -1, d).swapaxes(1, 2) @ (A @ G).reshape(e, -1, d)
        entry, indices, indptr = self._pattern
        data = np.bincount(entry, local.ravel(), len(indices))
        return sp.csc_matrix((data, indices, indptr), shape=(self.basis.N, self.basis.N))


def large_model(fem: FemModel, law: PrincipalLaw) -> LargeModel:
    """`fem` in large deformation. InvalidScene in plane stress, or where the law has another Poisson's ratio."""
    if fem.body.material.plane != "strain":
        raise InvalidScene("large deformation in plane stress: the laws are those of plane strain, set plane='strain'")
    if getattr(law, "poisson", fem.body.material.poisson) != fem.body.material.poisson:
        raise InvalidScene(f"{law} for a material of Poisson's ratio {fem.body.material.poisson}: give both the same")
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


def load_steps(model: LargeModel, moduli: Array, levels: Array, *, tol: float = TOLERANCE) -> Iterator[Array]:
    """Displacements u (N,) at each of the load `levels`, of 1 for the whole load, with element moduli (e,).

    Newton's method from the level before; where it fails, the load is halved on the way. Raises NotConverged.
    """
    u, before = np.zeros(model.basis.N), 0.0
    for step, level in enumerate(levels, start=1):
        reached, part = before, level - before
        while reached != level:
            target = level if abs(level - reached) <= abs(part) * (1 + 1e-9) else reached + part
            found = _newton(model, moduli, u, target, tol)
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


def _newton(model: LargeModel, moduli: Array, u: Array, level: float, tol: float) -> Array | None:
    """u at the level; None where the residual does not fall or an element inverts."""
    free, u = model.fem.free, u.copy()
    held = np.ones(len(u), bool)
    held[free] = False
    for _ in range(MAX_NEWTON):
        if np.any(np.linalg.det(model.deformation(u)) <= 0):
            return None
        internal = model.residual(moduli, u)
        R = level * model.fem.f_ext - internal
        size = np.linalg.norm(R[free])
        applied = np.linalg.norm(np.where(held, internal, level * model.fem.f_ext))
        K = model.tangent(moduli, u)[free][:, free]
        least = ROUNDING * (np.abs(K).max() * (np.abs(u).max() + np.abs(model.basis.mesh.p).max()))
        if size <= max(tol * applied, least):
            return u
        du = splu(sp.csc_matrix(K), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve(R[free])
        if not np.all(np.isfinite(du)):
            return None
        u[free] += du
    return None


def compliance_gradient(model: LargeModel, moduli: Array, path: list[Array], weights: Array) -> tuple[float, Array]:
    """J = sum_n w_n f . u_n over the levels n of a path, and dJ/dE (e,): one adjoint for each level of weight."""
    f, free = model.fem.f_ext, model.fem.free
    J = float(sum(w * (f @ u) for w, u in zip(weights, path, strict=True)))
    gradient = np.zeros(len(moduli))
    for w, u in zip(weights, path, strict=True):
        if w != 0:
            adjoint = np.zeros_like(u)
            adjoint[free] = splu(sp.csc_matrix(model.tangent(moduli, u)[free][:, free])).solve(w * f[free])
            gradient -= model.by_moduli(u, adjoint)
    return J, gradient


def with_load(model: LargeModel, f_ext: Array) -> LargeModel:
    """The same model under dead nodal forces f_ext (N,)."""
    return replace(model, fem=replace(model.fem, f_ext=f_ext))
