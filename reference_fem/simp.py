"""Density-based optimisation on a finite element model: filter, SIMP, objective and gradient."""

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from mpmtop.scene import Array, InvalidScene, Scene
from reference_fem.elasticity import FemModel, discretise, inverse_stiffness, unit_work
from reference_fem.factorise import Solve
from reference_fem.objectives import STRESS_POSITIONS, Objective, StressPosition, objective


@dataclass(frozen=True, eq=False)
class Evaluation:
    """One analysed design: densities rho (e,), displacements u (N,), objective, constraints g (1,) <= 0.

    `inverse` is K^-1 by the factorisation that gave u, ready for an adjoint; it is a hundred times as large as the
    rest, so a history should keep what it needs of an evaluation rather than the evaluation.
    """

    rho: Array
    u: Array
    objective: float
    constraints: Array
    inverse: Solve


@dataclass(frozen=True, eq=False)
class DesignProblem:
    """Minimise the scene's objective over the design (e,) at a volume of at most `volume_fraction` of the body.

    rho = H design, E = E(rho) by SIMP, K(E) u = f, g = sum(area rho) / (volume_fraction sum(area)) - 1 <= 0. A stress
    objective takes stresses at the element centres or the Gauss points.
    """

    scene: Scene
    model: FemModel
    H: sp.csr_matrix
    stress_at: StressPosition = "centre"

    def __post_init__(self) -> None:
        if self.stress_at not in STRESS_POSITIONS:
            raise InvalidScene(f"stress at {self.stress_at!r}: say one of {', '.join(STRESS_POSITIONS)}")

    @cached_property
    def objective(self) -> Objective:
        """The objective of the scene."""
        return objective(self.scene, self.model, self.stress_at)

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
        """Hash of all that decides the numbers: the scene, the element type, where stress is taken, every element."""
        basis = self.model.basis
        digest = hashlib.sha256(repr((self.scene, basis.Nbfun, self.stress_at)).encode())
        digest.update(basis.mesh.p[:, basis.mesh.t].tobytes())
        return digest.hexdigest()

    def evaluate(self, x: Array) -> Evaluation:
        """Objective and constraint of the design x (e,): one factorisation, one solve, no derivative."""
        return self.analyse(self.H @ x)

    def analyse(self, rho: Array) -> Evaluation:
        """Objective and constraint of physical densities rho (e,), of whatever origin."""
        inverse = inverse_stiffness(self.model, simp(rho, self.scene)[0])
        u = inverse(self.model.f_ext)
        volume = self.model.area @ rho / (self.scene.volume_fraction * self.model.area.sum())
        return Evaluation(rho, u, self.objective.value(rho, u), np.array([volume - 1]), inverse)

    def gradient(self, evaluation: Evaluation) -> tuple[Array, Array]:
        """Derivatives by the design: df0 = H^T dJ/drho (e,) and dg (1, e); no further factorisation."""
        dg = self.H.T @ self.model.area / (self.scene.volume_fraction * self.model.area.sum())
        return self.H.T @ self.density_gradient(evaluation), dg[None]

    def density_gradient(self, evaluation: Evaluation) -> Array:
        """dJ/drho (e,) by the physical densities: explicit part - dE/drho lambda_e . k_e u_e; one solve for stress."""
        rho, u = evaluation.rho, evaluation.u
        by_rho, adjoint = self.objective.gradient(rho, u, evaluation.inverse)
        return by_rho - simp(rho, self.scene)[1] * unit_work(self.model, adjoint, u)


def design_problem(
    scene: Scene, size: float | tuple[float, float], order: int = 1, stress_at: StressPosition = "centre"
) -> DesignProblem:
    """The scene's problem on elements of side `size`, bilinear (order 1) or biquadratic (2), one density for each.

    A stress objective takes stresses at the element centres, one for each density as for each material point, or at
    the Gauss points, averaged in the p-norm.
    """
    model = discretise(scene, size, order)
    return DesignProblem(scene, model, density_filter(model.centres, model.area, scene.filter_radius), stress_at)


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
