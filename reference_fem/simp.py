"""Density-based compliance minimisation on a finite element model: filter, SIMP, objective and gradient."""

import hashlib
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from mpmtop.scene import Array, Scene
from reference_fem.elasticity import FemModel, discretise, solve, unit_energy


@dataclass(frozen=True, eq=False)
class Evaluation:
    """One analysed design: densities rho (e,), displacements u (N,), objective f.u, constraints g (1,) <= 0."""

    rho: Array
    u: Array
    objective: float
    constraints: Array


@dataclass(frozen=True, eq=False)
class ComplianceProblem:
    """Minimise the compliance f.u over the design (e,) at a volume of at most `volume_fraction` of the body.

    rho = H design, E = E(rho) by SIMP, K(E) u = f, g = sum(area rho) / (volume_fraction sum(area)) - 1 <= 0.
    """

    scene: Scene
    model: FemModel
    H: sp.csr_matrix

    @property
    def x0(self) -> Array:
        """Uniform design (e,) at the volume fraction."""
        return np.full(len(self.model.area), self.scene.volume_fraction)

    @property
    def lower(self) -> Array:
        """rho_min everywhere (e,)."""
        return np.full(len(self.model.area), self.scene.rho_min)

    @property
    def upper(self) -> Array:
        """One everywhere (e,)."""
        return np.ones(len(self.model.area))

    @property
    def fingerprint(self) -> str:
        """Hash of all that decides the numbers: the scene, the element type and every element's position and area."""
        basis = self.model.basis
        digest = hashlib.sha256(repr((self.scene, basis.Nbfun)).encode())
        digest.update(basis.mesh.p[:, basis.mesh.t].tobytes())
        return digest.hexdigest()

    def evaluate(self, x: Array) -> Evaluation:
        """Objective and constraint of the design x (e,): one factorisation, one solve, no derivative."""
        return self.analyse(self.H @ x)

    def analyse(self, rho: Array) -> Evaluation:
        """Objective and constraint of physical densities rho (e,), of whatever origin."""
        u = solve(self.model, simp(rho, self.scene)[0])
        volume = self.model.area @ rho / (self.scene.volume_fraction * self.model.area.sum())
        return Evaluation(rho, u, float(self.model.f_ext @ u), np.array([volume - 1]))

    def gradient(self, evaluation: Evaluation) -> tuple[Array, Array]:
        """Derivatives by the design: df0 (e,) = -H^T (dE/drho u_e.k_e u_e) and dg (1, e); no further solve."""
        d_young = simp(evaluation.rho, self.scene)[1]
        df0 = self.H.T @ (-d_young * unit_energy(self.model, evaluation.u))
        dg = self.H.T @ self.model.area / (self.scene.volume_fraction * self.model.area.sum())
        return df0, dg[None]


def compliance_problem(scene: Scene, size: float | tuple[float, float], order: int = 1) -> ComplianceProblem:
    """The scene's problem on elements of side `size`, bilinear (order 1) or biquadratic (2), one density for each."""
    model = discretise(scene, size, order)
    return ComplianceProblem(scene, model, density_filter(model.centres, model.area, scene.filter_radius))


def density_filter(x: Array, volume: Array, radius: float) -> sp.csr_matrix:
    """Filter H (p, p), H_ij ~ volume_j max(0, radius - |x_i - x_j|) with rows of sum one, for points x (p, 2).

    A radius below the spacing gives the identity. Its adjoint is the transpose. Source: Bruns and Tortorelli, Comput.
    Methods Appl. Mech. Engng 190 (2001) 3443.
    """
    tree = cKDTree(x)
    pairs = tree.sparse_distance_matrix(tree, radius, output_type="coo_matrix")
    cone = sp.csr_matrix(((radius - pairs.data) * volume[pairs.col], (pairs.row, pairs.col)), shape=pairs.shape)
    return sp.diags(1 / cone.sum(axis=1).A1) @ cone


def simp(rho: Array, scene: Scene) -> tuple[Array, Array]:
    """Modified SIMP, Eq. (10): E = E0 (contrast + rho^penal (1 - contrast)) and dE/drho, both (e,), for rho (e,)."""
    solid = scene.material.young * (1 - scene.contrast)
    young = scene.material.young * scene.contrast + solid * rho**scene.penal
    return young, solid * scene.penal * rho ** (scene.penal - 1)
