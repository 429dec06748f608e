"""The objective along a line of designs, what its jumps are, and what an adjoint loses that leaves crossing out."""

from typing import NamedTuple
from unittest.mock import patch

import numpy as np

from mpmtop.arrays import Array
from mpmtop.body import Body, Support
from mpmtop.grid import Grid
from mpmtop.large_deformation import adjoint
from mpmtop.large_deformation.kinematics import Weights
from mpmtop.large_deformation.model import Model, discretise
from mpmtop.large_deformation.objectives import EndCompliance, EndStress, PathObjective, gradient
from mpmtop.large_deformation.steps import Trajectory, trajectory
from mpmtop.loads import RegionLoad
from mpmtop.region import Rectangle
from validation.bodies.large import INF, METHODS

SAMPLES, PART = 60, slice(20, 40)
"""Places along the line; and those that a run without the benchmark takes: where the tent's largest jump is."""
STEPS = 4


def short(load: float = 0.06) -> Body:
    """20 x 10, held at x <= 0, loaded within two units of its tip's middle: a deflection of 15 % of the length."""
    tip = Rectangle((18.0, 3.0), (20.0, 7.0))
    clamp = Support(Rectangle((-INF, -INF), (0.0, INF)))
    return Body(Rectangle((0, 0), (20, 10)), (clamp,), (RegionLoad(tip, (0.0, -load)),))


def short_model(method: str, steps: int = STEPS) -> Model:
    """It on cells of side 2 with 2 x 2 points each: 200 points."""
    box = Grid((-8.0, -20.0), (2.0, 2.0), (20, 23))
    return discretise(short(), steps=steps, grid=box, **METHODS[method])


def moduli(model: Model) -> tuple[Array, Array]:
    """Point moduli (p,) between 0.3 and 1, and a direction (p,) along which they change by up to a fifth."""
    X, Y = model.points.x.T
    smooth = 0.65 + 0.35 * np.sin(0.9 * X + 0.4 * Y) * np.cos(0.7 * Y)
    return smooth, 0.2 * np.cos(0.5 * X) * smooth


class Line(NamedTuple):
    """J (n,) and dJ/dt (n,) at t (n,), and positions (n, p, 2) at the end."""

    t: Array
    J: Array
    slope: Array
    x: Array

    @property
    def jumps(self) -> Array:
        """(n - 1,): what J changes by beyond the integral of its exact derivative, by the mean of |J|.

        The derivative is integrated by cubics through four neighbours: smooth J leave their fifth derivative's part.
        """
        return (np.diff(self.J) - _integrals(self.t, self.slope)) / np.mean(np.abs(self.J))


def _integrals(t: Array, f: Array) -> Array:
    """Integrals (n - 1,) of f (n,) at equidistant t between neighbours, by the cubic through the nearest four."""
    h = t[1] - t[0]
    inner = h / 24 * (-f[:-3] + 13 * f[1:-2] + 13 * f[2:-1] - f[3:])
    first = h / 24 * (9 * f[0] + 19 * f[1] - 5 * f[2] + f[3])
    last = h / 24 * (f[-4] - 5 * f[-3] + 19 * f[-2] + 9 * f[-1])
    return np.concatenate([[first], inner, [last]])


def line(method: str, part: slice) -> Line:
    """The end compliance at a part of the places along the line."""
    model = short_model(method)
    E, direction = moduli(model)
    t = np.linspace(0, 1, SAMPLES)[part]
    J, slope, x = [], [], []
    for s in t:
        path = trajectory(model, E + s * direction)
        J.append(EndCompliance().value(model, path, E))
        slope.append(gradient(EndCompliance(), model, path, E)[1] @ direction)
        x.append(path.states[-1].x)
    return Line(t, np.array(J), np.array(slope), np.array(x))


def _frozen(weights: Weights, N_bar: Array, grad_N_bar: Array) -> tuple[Array, Array]:
    """In the place of `kinematics.pull_back`: weights that depend on nothing."""
    none = np.zeros((len(N_bar), 2))
    return none, none


def lazy_loss(method: str) -> dict[str, float]:
    """|lazy - exact| / |exact| of dJ/dE (p,) by objective; the lazy adjoint takes the weights of each step as given."""
    model = short_model(method, steps=8)
    E = moduli(model)[0]
    path = trajectory(model, E)
    return {name: _loss(objective, model, path) for name, objective in OBJECTIVES.items()}


OBJECTIVES: dict[str, PathObjective] = {"end compliance": EndCompliance(), "p-norm of stress": EndStress(8.0, 0.0)}


def _loss(objective: PathObjective, model: Model, path: Trajectory) -> float:
    exact = gradient(objective, model, path, path.moduli)[1]
    with patch.object(adjoint, "pull_back", _frozen):
        lazy = gradient(objective, model, path, path.moduli)[1]
    return float(np.linalg.norm(lazy - exact) / np.linalg.norm(exact))
