"""Load steps forward: the trajectory of a body under growing load."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mpmtop.arrays import Array
from mpmtop.errors import LoadOutsideBody, NotConverged, PointOutsideGrid, UnsupportedBody
from mpmtop.large_deformation.model import Model
from mpmtop.large_deformation.newton import TOLERANCE, Increment, increment
from mpmtop.large_deformation.step import State, moved, start

CARRIES = 1e-6
"""Part of the stiffest point's modulus below which points carry no load: they would leave the body with it."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States at levels 0, t_1, ..., 1 (steps + 1), and the increments between them (steps).

    `moduli` (p,) are those of the points. What one may want to know of the run: `newton_steps`, `parts`, `clipped`.
    """

    moduli: Array
    states: tuple[State, ...]
    increments: tuple[Increment, ...]

    @property
    def newton_steps(self) -> tuple[int, ...]:
        """Newton steps of each load step, those of the parts that its load was cut into added up."""
        return tuple(len(i.residuals) - i.parts for i in self.increments)

    @property
    def parts(self) -> tuple[int, ...]:
        """Parts that the load of each step had to be cut into; 1 where Newton's method needed none."""
        return tuple(i.parts for i in self.increments)

    @property
    def clipped(self) -> tuple[int, ...]:
        """Points whose domains were clipped, as they had become wider than a cell, after each step."""
        return tuple(int(np.count_nonzero(s.clipped.any(axis=1))) for s in self.states[1:])

    def displacement(self, step: int = -1) -> Array:
        """Displacements (p, 2) of the points at the end of a step, from 1 on; by default of the last one.

        Differences of positions: of a small one, far from the origin, only what exceeds 1e-16 of these is left.
        """
        return self.states[step].x - self.states[0].x


def load_steps(
    model: Model, moduli: Array, *, tol: float = TOLERANCE, polish: int = 0
) -> Iterator[tuple[State, Increment]]:
    """The load steps one by one: the state at the end of each and the increment to it. See `trajectory`."""
    moduli = _checked(model, moduli)
    _check_carriers(model, moduli)
    state = start(model, moduli.dtype.type)
    for n, level in enumerate(model.levels):
        before = model.levels[n - 1] if n > 0 else 0.0
        try:
            found, ops = increment(model, state, moduli, (before, level), tol=tol, polish=polish)
        except (NotConverged, UnsupportedBody, PointOutsideGrid) as error:
            raise type(error)(f"load step {n + 1} of {model.steps}: {error}") from error
        state = moved(model, state, ops.at_points(found.u), found.F)
        yield state, found


def trajectory(model: Model, moduli: Array, *, tol: float = TOLERANCE, polish: int = 0) -> Trajectory:
    """All load steps with the points' Young's moduli (p,).

    `tol` is the residual's part of the forces, reactions included; `polish` Newton steps more after it is met.
    Raises NotConverged, UnsupportedBody and PointOutsideGrid with step and place, and LoadOutsideBody where void
    carries the load.
    """
    moduli = _checked(model, moduli)
    states, increments = zip(*load_steps(model, moduli, tol=tol, polish=polish), strict=True)
    return Trajectory(moduli, (start(model, moduli.dtype.type), *states), increments)


def _checked(model: Model, moduli: Array) -> Array:
    """Moduli (p,) that are numbers of full precision: the state takes their type."""
    moduli = np.asarray(moduli)
    if moduli.shape != (len(model.points.x),):
        raise ValueError(f"moduli of shape {moduli.shape} for {len(model.points.x)} points: give one for each")
    moduli = moduli.astype(complex if np.iscomplexobj(moduli) else float)
    if not np.all(np.isfinite(moduli)) or np.min(moduli.real) < 0 or not np.any(moduli):
        raise ValueError("point moduli must be finite, not negative and not all zero: check the densities")
    return moduli


def _check_carriers(model: Model, moduli: Array) -> None:
    carriers = np.flatnonzero(np.any(model.force != 0, axis=1))
    if len(carriers) == 0:
        raise LoadOutsideBody("load on nothing: the body has no loads, give it some, or `cases` to the problem")
    void = carriers[np.real(moduli[carriers]) < CARRIES * np.max(np.real(moduli))]
    if len(void) > 0:
        x, y = model.points.x[void[0]]
        raise LoadOutsideBody(
            f"load on void: {len(void)} of the {len(carriers)} points that carry it are softer than {CARRIES:g} of the "
            f"stiffest, one at ({x:.4g}, {y:.4g}); make the design solid there (`passive_solid`)"
        )
