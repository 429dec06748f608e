"""Density-based optimisation on finite elements in large deformation: load levels, objectives of them, their gradient.

Moduli by SIMP; the fraction g of an element that is nonlinear, see `large_deformation`, is a smooth step of rho^penal:

    g = (tanh(b r0) + tanh(b (rho^penal - r0))) / (tanh(b r0) + tanh(b (1 - r0))),    b = 500, r0 = 0.01.

Source: Wang, Lazarov, Sigmund and Jensen (2014), Comput. Methods Appl. Mech. Engrg 276:453.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from mpmtop.arrays import Array
from mpmtop.design import physical_densities
from mpmtop.errors import InvalidScene
from reference_fem.at_large_elements import LargeState
from reference_fem.large_deformation import LargeModel, load_steps, von_mises
from reference_fem.objectives import p_norm
from reference_fem.simp import DesignProblem, simp

STEP, STEEPNESS = 0.01, 500.0
"""r0 and b: an element is linear below a hundredth of the stiffness, and nonlinear from a fiftieth on."""


def nonlinear_fraction(rho: Array, penal: float) -> tuple[Array, Array]:
    """g and dg/drho, (e,) each, of densities rho (e,)."""
    whole = np.tanh(STEEPNESS * STEP) + np.tanh(STEEPNESS * (1 - STEP))
    at = np.tanh(STEEPNESS * (rho**penal - STEP))
    slope = STEEPNESS * (1 - at**2) * penal * rho ** (penal - 1)
    return (np.tanh(STEEPNESS * STEP) + at) / whole, slope / whole


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Objective and constraints g <= 0 (1,) of one design; densities, moduli and nonlinear fractions (e,), and
    displacements u (N,) at every level, of which `level` is the last."""

    objective: float
    constraints: Array
    rho: Array
    moduli: Array
    nonlinear: Array
    u: Sequence[Array]
    level: float

    @property
    def state(self) -> LargeState:
        """What `mpmtop.plot` and `mpmtop.export` show: the last level."""
        return LargeState(self.u[-1], self.moduli, self.nonlinear, self.level)


class Slopes(NamedTuple):
    """dJ by the displacements (N,) at each level, None where by none, and by rho and g (e,) at fixed displacements."""

    u: Sequence[Array | None]
    rho: Array
    nonlinear: Array


class PathObjective(Protocol):
    """An objective of the displacements u (N,) at the load levels."""

    def value(self, model: LargeModel, rho: Array, nonlinear: Array, u: Sequence[Array]) -> float:
        """J."""
        ...

    def slopes(self, model: LargeModel, at: Evaluation) -> Slopes:
        """Derivatives of J."""
        ...


@dataclass(frozen=True)
class WeightedCompliance:
    """sum_n w_n f . u_n: (0, ..., 0, 1) is the end compliance, 1 / (t_n levels) the mean of the secant compliances."""

    weights: tuple[float, ...]

    def value(self, model: LargeModel, rho: Array, nonlinear: Array, u: Sequence[Array]) -> float:
        """See `PathObjective`."""
        return float(sum(w * (model.fem.f_ext @ u_n) for w, u_n in zip(self.weights, u, strict=True)))

    def slopes(self, model: LargeModel, at: Evaluation) -> Slopes:
        """See `PathObjective`."""
        none = np.zeros(len(at.rho))
        return Slopes([w * model.fem.f_ext if w != 0 else None for w in self.weights], none, none)


@dataclass(frozen=True)
class EndStress:
    """(sum_e mean_q (rho_e^q s_eq)^exponent)^(1 / exponent) at the last level, over the Gauss points of each element.

    s is the von Mises measure of the Kirchhoff stress of solid material under F = 1 + g grad u.
    """

    exponent: float = 12.0
    q: float = 0.5

    def value(self, model: LargeModel, rho: Array, nonlinear: Array, u: Sequence[Array]) -> float:
        """See `PathObjective`."""
        vm = self._solid(model, nonlinear, u[-1])[0]
        return p_norm(rho[:, None] ** self.q * vm, self.exponent, 1 / vm.shape[1])

    def slopes(self, model: LargeModel, at: Evaluation) -> Slopes:
        """See `PathObjective`; by rho it tends to zero with it for q exponent > 1."""
        vm, by_F = self._solid(model, at.nonlinear, at.u[-1])
        relaxed = at.rho[:, None] ** self.q
        s = relaxed * vm
        J = p_norm(s, self.exponent, 1 / vm.shape[1])
        by_s = (s / J) ** (self.exponent - 1) / vm.shape[1] if J > 0 else np.zeros_like(s)
        by_rho = np.divide(self.q * np.sum(by_s * s, axis=1), at.rho, out=np.zeros(len(at.rho)), where=at.rho > 0)
        by_F = (by_s * relaxed)[..., None, None] * by_F
        # the sum over elements is none over their areas
        by_u = model.to_dofs(at.nonlinear[:, None, None, None] * by_F / model.basis.dx[..., None, None])
        by_g = np.sum(by_F * model.grad(at.u[-1]), axis=(1, 2, 3))
        return Slopes([None] * (len(at.u) - 1) + [by_u], by_rho, by_g)

    def _solid(self, model: LargeModel, nonlinear: Array, u: Array) -> tuple[Array, Array]:
        """s (e, q) and its derivative by F (e, q, 2, 2)."""
        young = model.fem.body.material.young
        vm, by_F = von_mises(model.law, nonlinear[:, None, None, None] * model.grad(u) + np.eye(2))
        return young * vm, young * by_F


@dataclass(frozen=True, eq=False)
class LargeDesignProblem:
    """Minimise `objective` over the design of a `linear` problem, whose variables, filter and volume it shares.

    `model` is the linear problem's body in large deformation, loaded to each of the `levels` of the whole load.
    """

    linear: DesignProblem
    model: LargeModel
    levels: tuple[float, ...]
    objective: PathObjective

    def __post_init__(self) -> None:
        if self.model.fem is not self.linear.model:
            raise InvalidScene("the large deformation model has other elements: make it of the linear problem's")
        if self.linear.filtered != "density":
            raise InvalidScene("the sensitivity filter in large deformation: use filtered='density'")
        design = self.linear.design
        if design.projection is not None or design.symmetry or self.linear.constraints or self.linear.cases:
            raise InvalidScene(
                "elements in large deformation have no projection, symmetry, constraints or load cases: drop them"
            )

    @property
    def x0(self) -> Array:
        """The linear problem's start (a,)."""
        return self.linear.x0

    @property
    def lower(self) -> Array:
        """rho_min everywhere (a,)."""
        return self.linear.lower

    @property
    def upper(self) -> Array:
        """One everywhere (a,)."""
        return self.linear.upper

    @property
    def positions(self) -> Array:
        """Centres of the elements that are design variables, (a, 2)."""
        return self.linear.positions

    @property
    def filter_radius(self) -> float:
        """Radius of the filter [length]."""
        return self.linear.filter_radius

    @property
    def fingerprint(self) -> str:
        """The linear problem's, and what is added here."""
        return f"{self.linear.fingerprint} {self.model.law} {self.levels} {self.objective}"

    def evaluate(self, x: Array) -> Evaluation:
        """Objective and constraint of the design x (a,): one path."""
        return self.analyse(self.linear.H @ x + self.linear.space.fixed)

    def analyse(self, rho: Array) -> Evaluation:
        """Objective and constraint of physical densities rho (e,) in [0, 1]. Raises NotConverged."""
        rho = physical_densities(rho, len(self.model.fem.area), "element")
        moduli = simp(rho, self.model.fem.body.material, self.linear.design)[0]
        g = nonlinear_fraction(rho, self.linear.design.penal)[0]
        u = tuple(load_steps(self.model, moduli, np.array(self.levels), nonlinear=g))
        J = self.objective.value(self.model, rho, g, u)
        return Evaluation(J, np.array([self.linear.volume(rho) - 1]), rho, moduli, g, u, self.levels[-1])

    def gradient(self, evaluation: Evaluation) -> tuple[Array, Array]:
        """dJ/dx (a,) and dg/dx (1, a): one adjoint for each level that J depends on."""
        return self.linear.H.T @ self.density_gradient(evaluation), self.linear.volume_gradient()

    def density_gradient(self, at: Evaluation) -> Array:
        """dJ/drho (e,) by the physical densities."""
        slopes = self.objective.slopes(self.model, at)
        by_moduli, by_g = np.zeros(len(at.rho)), slopes.nonlinear.copy()
        for u, by_u in zip(at.u, slopes.u, strict=True):
            if by_u is not None:
                T, D, T_g = self.model.respond(u, at.nonlinear)
                adjoint = self.model.solve(at.moduli, D, by_u)
                by_moduli -= self.model.work(T, adjoint)
                by_g -= at.moduli * self.model.work(T_g, adjoint)
        design = self.linear.design
        d_moduli = simp(at.rho, self.model.fem.body.material, design)[1]
        return slopes.rho + d_moduli * by_moduli + nonlinear_fraction(at.rho, design.penal)[1] * by_g
