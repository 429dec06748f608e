"""Objectives of load steps: a value of the trajectory, and its derivatives by the states and, at fixed states, by the
densities rho (p,). What follows from these is the adjoint's."""

from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np

from mpmtop.arrays import Array
from mpmtop.criteria import Worst
from mpmtop.errors import InvalidScene
from mpmtop.large_deformation.adjoint import Seed, moduli_gradient
from mpmtop.large_deformation.law import von_mises
from mpmtop.large_deformation.model import Model
from mpmtop.large_deformation.steps import Trajectory
from mpmtop.region import Region


class PathObjective(Protocol):
    """An objective of a trajectory."""

    def value(self, model: Model, path: Trajectory, rho: Array) -> float:
        """J."""
        ...

    def seed(self, model: Model, path: Trajectory, rho: Array, step: int) -> Seed:
        """dJ by the state at the end of a step, from 1 on."""
        ...

    def explicit(self, model: Model, path: Trajectory, rho: Array) -> Array:
        """dJ/drho (p,) at fixed states."""
        ...


def check_objective(value: object) -> None:
    """InvalidScene unless it is an objective of a trajectory; criteria of small strain are none."""
    if isinstance(value, Worst):
        raise InvalidScene("the worst of several load cases is of small strain: in large deformation give them weights")
    if isinstance(value, type) or not all(hasattr(value, name) for name in ("value", "seed", "explicit")):
        raise InvalidScene(
            f"objective {value!r} in large deformation: give EndCompliance(), PathCompliance(), EndStress(exponent, "
            "q), EndDisplacement(region, direction), or an object of your own with `value`, `seed` and `explicit`"
        )


def gradient(objective: PathObjective, model: Model, path: Trajectory, rho: Array) -> tuple[Array, Array]:
    """dJ/drho at fixed states and dJ/dE, (p,) each."""
    by_moduli = moduli_gradient(model, path, partial(objective.seed, model, path, rho))
    return objective.explicit(model, path, rho), by_moduli


@dataclass(frozen=True)
class EndCompliance:
    """sum_p f_p . (x_p - X_p) at full load. It sees nothing of the way there: a design may hang the load on a rope."""

    def value(self, model: Model, path: Trajectory, rho: Array) -> float:
        """J."""
        return _real(np.sum(model.force * path.displacement()))

    def seed(self, model: Model, path: Trajectory, rho: Array, step: int) -> Seed:
        """See `PathObjective`."""
        return Seed(x=model.force) if step == model.steps else Seed()

    def explicit(self, model: Model, path: Trajectory, rho: Array) -> Array:
        """See `PathObjective`."""
        return np.zeros_like(rho)


@dataclass(frozen=True)
class PathCompliance:
    """Mean over the load levels t_n of the secant compliances sum_p f_p . (x_p - X_p) / t_n: stiff all the way."""

    def value(self, model: Model, path: Trajectory, rho: Array) -> float:
        """J."""
        work = [np.sum(model.force * path.displacement(n)) / t for n, t in enumerate(model.levels, start=1)]
        return _real(np.sum(work) / model.steps)

    def seed(self, model: Model, path: Trajectory, rho: Array, step: int) -> Seed:
        """See `PathObjective`."""
        return Seed(x=model.force / (model.levels[step - 1] * model.steps))

    def explicit(self, model: Model, path: Trajectory, rho: Array) -> Array:
        """See `PathObjective`."""
        return np.zeros_like(rho)


@dataclass(frozen=True)
class EndDisplacement:
    """Mean displacement along `direction`, of any length, of the points that start in `region`, at full load."""

    region: Region
    direction: tuple[float, float]

    def __post_init__(self) -> None:
        if np.shape(self.direction) != (2,) or not np.all(np.isfinite(self.direction)) or not np.any(self.direction):
            raise InvalidScene(f"direction {self.direction} of a displacement: give two finite numbers, not both zero")

    def value(self, model: Model, path: Trajectory, rho: Array) -> float:
        """J."""
        return _real(np.sum(self._weight(model) * path.displacement()))

    def seed(self, model: Model, path: Trajectory, rho: Array, step: int) -> Seed:
        """See `PathObjective`."""
        return Seed(x=self._weight(model)) if step == model.steps else Seed()

    def explicit(self, model: Model, path: Trajectory, rho: Array) -> Array:
        """See `PathObjective`."""
        return np.zeros_like(rho)

    def _weight(self, model: Model) -> Array:
        inside = self.region.contains(model.points.x, 1e-9 * min(model.grid.h))
        if not np.any(inside):
            raise InvalidScene("the region of a displacement holds no material point: move it onto the body")
        return np.outer(inside / np.count_nonzero(inside), np.array(self.direction) / np.hypot(*self.direction))


@dataclass(frozen=True)
class EndStress:
    """(sum_p (rho_p^q s_p)^exponent)^(1 / exponent) at full load, over all points.

    s_p is the von Mises measure of the Kirchhoff stress of solid material, with modulus E0, under the point's F; the
    relaxation rho^q takes it away from voids. The form of Eq. (9) of the paper for small strain.
    """

    exponent: float = 12.0
    q: float = 0.5

    def __post_init__(self) -> None:
        if not 1 <= self.exponent < np.inf:
            raise InvalidScene(f"p-norm exponent {self.exponent}: give a finite number of at least 1")
        if not 0 <= self.q < np.inf:
            raise InvalidScene(f"stress relaxation q {self.q}: give a finite number of at least 0")

    def value(self, model: Model, path: Trajectory, rho: Array) -> float:
        """J."""
        return _real(self._norm(rho**self.q * self._solid(model, path)[0]))

    def seed(self, model: Model, path: Trajectory, rho: Array, step: int) -> Seed:
        """See `PathObjective`."""
        if step < model.steps:
            return Seed()
        vm, by_F = self._solid(model, path)
        return Seed(F=(self._share(rho**self.q * vm) * rho**self.q)[:, None, None] * by_F)

    def explicit(self, model: Model, path: Trajectory, rho: Array) -> Array:
        """See `PathObjective`; it tends to zero with rho for q exponent > 1."""
        s = rho**self.q * self._solid(model, path)[0]
        return np.divide(self._share(s) * self.q * s, rho, out=np.zeros_like(s), where=rho != 0)

    def _solid(self, model: Model, path: Trajectory) -> tuple[Array, Array]:
        """s (p,) and its derivative by F (p, 2, 2)."""
        vm, by_F = von_mises(model.law, path.states[-1].F)
        return model.young * vm, model.young * by_F

    def _norm(self, s: Array) -> float:
        largest = np.max(s.real)
        return largest * np.sum((s / largest) ** self.exponent) ** (1 / self.exponent) if largest > 0 else 0.0

    def _share(self, s: Array) -> Array:
        """dJ/ds (p,)."""
        J = self._norm(s)
        return (s / J) ** (self.exponent - 1) if J != 0 else np.zeros_like(s)


def _real(J: Any) -> float:
    """J as a plain number; complex where a derivative is checked by a complex step."""
    return J if np.iscomplexobj(J) else float(J)
