"""Density-based optimisation on a finite element model: design, SIMP, objective and gradient."""

import hashlib
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, get_args

import numpy as np
import scipy.sparse as sp
from skfem import MeshQuad

from mpmtop.arrays import Array, Mask
from mpmtop.body import Material
from mpmtop.criteria import Compliance, PNormStress, finite_gradient
from mpmtop.design import Design, physical_densities
from mpmtop.errors import InvalidScene, LoadOutsideBody
from mpmtop.loads import carriers
from mpmtop.scene import Scene, check_together
from reference_fem import at_elements as at_elements
from reference_fem.design import DesignSpace, design_space
from reference_fem.elasticity import (
    FemModel,
    State,
    adjoint,
    discretise,
    inverse_stiffness,
    load_gradient,
    moduli_gradient,
)
from reference_fem.mesh import GEOMETRY_TOLERANCE, shortest_side
from reference_fem.objectives import STRESS_POSITIONS, Objective, StressPosition, objective
from reference_fem.outline import even_lines

Filtered = Literal["density", "sensitivity"]
SENSITIVITY_FLOOR = 1e-3  # density by which the averaged sensitivity is divided, at least: of the published codes
VOLUME_ROUNDING = 1e-12  # of the volume: sums of areas


@dataclass(frozen=True, eq=False)
class Evaluation:
    """One analysed design: objective, constraints g (1,) <= 0, densities rho (e,) and the state."""

    objective: float
    constraints: Array
    rho: Array
    state: State

    @property
    def u(self) -> Array:
        """Displacements (N,)."""
        return self.state.u


@dataclass(frozen=True, eq=False)
class DesignProblem:
    """Minimise `objective` over the `design` (a,) at a volume of at most `volume_fraction` of the body.

    rho = H design + fixed, E = E(rho) by SIMP, K(E) u = f, g = sum(area rho) / (volume_fraction sum(area)) - 1 <= 0.
    A stress objective takes stresses at the element centres or the Gauss points.

    Elements in passive regions have density 1 or 0 and leave the design: a variables for e elements. Solid
    ones count in the first sum, void ones in neither. The filter takes passive elements as absent, or averages them
    with the others (`filter_passive`). Raises InvalidScene, EmptyDomain or LoadOutsideBody where passive regions
    leave no feasible design, none at all, or a load without material.

    The "sensitivity" filter (Sigmund 1997) takes the design for the densities, rho = design, and averages the
    derivative instead: df0_j = sum_i H_ji x_i dJ/drho_i / max(1e-3, x_j), the derivative of no function.
    """

    model: FemModel
    design: Design
    objective: Compliance | PNormStress = field(default_factory=Compliance)
    stress_at: StressPosition = "centre"
    filter_passive: bool = False
    filtered: Filtered = "density"

    def __post_init__(self) -> None:
        check_together(self.model.body, self.design, self.objective)
        if self.filtered not in get_args(Filtered):
            raise InvalidScene(f"filtered {self.filtered!r}: say one of {', '.join(get_args(Filtered))}")
        if self.filtered == "sensitivity" and self.filter_passive:
            raise InvalidScene("filter_passive averages densities, the sensitivity filter does not: drop one of them")
        if self.stress_at not in STRESS_POSITIONS:
            raise InvalidScene(f"stress at {self.stress_at!r}: say one of {', '.join(STRESS_POSITIONS)}")
        least = self.volume(self.H @ self.lower + self.space.fixed)
        if least > 1 + VOLUME_ROUNDING:
            fraction = self.design.volume_fraction
            raise InvalidScene(
                f"passive solid, with rho_min elsewhere, is {least * fraction:.4f} of the volume and volume_fraction "
                f"{fraction}: raise it, or shrink passive_solid"
            )
        _check_loads(self.model, self.space.void)

    @cached_property
    def space(self) -> DesignSpace:
        """Which elements are design variables, and the filter."""
        return design_space(self.design, self.model.centres, self.model.area, self.filter_passive)

    @property
    def H(self) -> sp.csr_matrix:
        """Density filter (e, a), with empty rows for passive elements."""
        return self.space.H

    @property
    def positions(self) -> Array:
        """Centres of the elements that are design variables, (a, 2)."""
        return self.model.centres[self.space.active]

    @property
    def filter_radius(self) -> float:
        """Radius of the filter [length]."""
        return self.design.filter_radius

    @cached_property
    def functional(self) -> Objective:
        """Value and derivatives of the objective."""
        return objective(self.objective, self.model, self.stress_at)

    @property
    def x0(self) -> Array:
        """Uniform design (a,) that meets the volume constraint: the volume fraction if nothing is passive."""
        a = len(self.space.active)
        if a == len(self.model.area):
            return np.full(a, self.design.volume_fraction)
        area = self.model.area
        uniform = (self._volume_bound - area @ self.space.fixed) / (area @ (self.H @ np.ones(a)))
        return np.full(a, np.clip(uniform, self.design.rho_min, 1))

    @property
    def lower(self) -> Array:
        """rho_min everywhere (a,)."""
        return np.full(len(self.space.active), self.design.rho_min)

    @property
    def upper(self) -> Array:
        """One everywhere (a,)."""
        return np.ones(len(self.space.active))

    @cached_property
    def _volume_bound(self) -> float:
        return self.design.volume_fraction * self.model.area[~self.space.void].sum()

    def volume(self, rho: Array) -> float:
        """Volume of densities rho (e,) by the largest one allowed."""
        return float(self.model.area @ rho / self._volume_bound)

    @property
    def volume_gradient(self) -> Array:
        """Derivative (1, a) of that volume by the design."""
        return (self.H.T @ self.model.area / self._volume_bound)[None]

    @property
    def fingerprint(self) -> str:
        """Hash of all numbers that an iterate depends on: a checkpoint fits a problem of the same ones only.

        None of them is a sum that a BLAS may order as it likes: they are the same on every machine.
        """
        model, space, material, design = self.model, self.space, self.model.body.material, self.design
        numbers = (
            *(material.young, material.poisson, design.penal, design.contrast),
            *(design.volume_fraction, design.rho_min),
        )
        said = (
            repr(self.objective),
            material.plane,
            model.basis.Nbfun,
            self.stress_at,
            self.filtered,
            *map(float, numbers),
        )
        digest = hashlib.sha256(repr(said).encode())
        corners = model.basis.mesh.p[:, model.basis.mesh.t]
        sparse = (self.H, *(() if model.weight is None else (model.weight,)))
        weights = (part for matrix in sparse for part in (matrix.data, matrix.indices, matrix.indptr))
        for array in (corners, np.sort(model.free), model.f_ext, space.solid, space.void, space.fixed, *weights):
            digest.update(array.tobytes())
        return digest.hexdigest()

    def evaluate(self, x: Array) -> Evaluation:
        """Objective and constraint of the design x (a,): one factorisation, one solve, no derivative."""
        if self.filtered == "density":
            return self.analyse(self.H @ x + self.space.fixed)
        rho = self.space.solid.astype(float)
        rho[self.space.active] = x
        return self.analyse(rho)

    def analyse(self, rho: Array) -> Evaluation:
        """Objective and constraint of physical densities rho (e,) in [0, 1], of any origin, passive ones included."""
        rho = physical_densities(rho, len(self.model.area), "element")
        moduli = simp(rho, self.model.body.material, self.design)[0]
        inverse = inverse_stiffness(self.model, moduli)
        u = inverse(self.model.force(rho))
        constraints = np.array([self.volume(rho) - 1])
        return Evaluation(self.functional.value(rho, u), constraints, rho, State(moduli, u, inverse))

    def gradient(self, evaluation: Evaluation) -> tuple[Array, Array]:
        """Derivatives by the design: df0 = H^T dJ/drho (a,) and dg (1, a); no further factorisation.

        Raises InvalidScene where a p-norm of q p < 1 has none: a design of zeros over the reach of the filter.
        """
        d_rho = self.density_gradient(evaluation)
        if self.filtered == "density":
            return finite_gradient(self.H.T @ d_rho, self.objective), self.volume_gradient
        active = self.space.active
        x = evaluation.rho[active]
        by_density = finite_gradient(d_rho[active], self.objective)
        averaged = self.H[active] @ (x * by_density) / np.maximum(SENSITIVITY_FLOOR, x)
        return averaged, self.model.area[active][None] / self._volume_bound

    def density_gradient(self, evaluation: Evaluation) -> Array:
        """dJ/drho (e,) by the physical densities: explicit part - dE/drho lambda_e . k_e u_e; one solve for stress.

        From above at a density of zero, where a p-norm's may be infinite.
        """
        rho, state = evaluation.rho, evaluation.state
        by = self.functional.derivative(rho, state.u)
        found = adjoint(state, by)
        by_rho = simp(rho, self.model.body.material, self.design)[1] * moduli_gradient(self.model, state, found)
        by_load = load_gradient(self.model, state, by, found)
        by_rho = by_rho if by_load is None else by_rho + by_load
        return by_rho if by.rho is None else by.rho + by_rho


def _check_loads(model: FemModel, void: Mask) -> None:
    """Raise LoadOutsideBody if an element of passive void (e,) would carry a part of a load."""
    mesh, domain = model.basis.mesh, model.body.domain
    tol = GEOMETRY_TOLERANCE * shortest_side(mesh)
    for load in model.body.loads:
        if np.any(void[carriers(load, model.centres, model.area, tol, domain, even_lines(mesh))]):
            raise LoadOutsideBody(f"passive void would carry a part of {load}: move it, or lower its `points`")


def design_problem(
    scene: Scene,
    size: float | tuple[float, float] | None = None,
    order: int = 1,
    stress_at: StressPosition = "centre",
    *,
    mesh: MeshQuad | None = None,
    filter_passive: bool = False,
    filtered: Filtered = "density",
) -> DesignProblem:
    """The scene's problem on elements of side `size`, or on a `mesh`, with one density for each element.

    They are bilinear (order 1) or biquadratic (2). A stress objective takes stresses at the element centres, one for
    each density as for each material point, or at the Gauss points, averaged in the p-norm; every element counts once,
    whatever its size. Raises as `discretise` and `DesignProblem`.
    """
    if scene.cases or scene.constraints or not isinstance(scene.objective, Compliance | PNormStress):
        raise InvalidScene("finite elements know one load case, compliance or p-norm, and the volume constraint")
    if scene.design.projection is not None or scene.design.symmetry:
        raise InvalidScene("finite elements know neither projection nor symmetry")
    model = discretise(scene.body, size, order, mesh=mesh)
    return DesignProblem(model, scene.design, scene.objective, stress_at, filter_passive, filtered)


def simp(rho: Array, material: Material, design: Design) -> tuple[Array, Array]:
    """Modified SIMP, Eq. (10): E = E0 (contrast + rho^penal (1 - contrast)) and dE/drho, both (e,), for rho (e,)."""
    solid = material.young * (1 - design.contrast)
    young = material.young * design.contrast + solid * rho**design.penal
    return young, solid * design.penal * rho ** (design.penal - 1)
