"""The gradient of every method, law and objective against a complex step through all load steps."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.errors import InvalidScene
from mpmtop.large_deformation.law import Hencky, Law, NeoHookean
from mpmtop.large_deformation.model import Model
from mpmtop.large_deformation.objectives import (
    EndCompliance,
    EndDisplacement,
    EndStress,
    PathCompliance,
    PathObjective,
    gradient,
)
from mpmtop.large_deformation.steps import Trajectory, trajectory
from mpmtop.region import Rectangle
from tests.mpmtop.large_deformation.cases import METHODS, model

STEP = 1e-30
LAWS = (Hencky(0.3), NeoHookean(0.3))
OBJECTIVES: tuple[PathObjective, ...] = (
    EndCompliance(),
    PathCompliance(),
    EndDisplacement(Rectangle((15, 0), (20, 10)), (1.0, 2.0)),
    EndStress(8.0, 0.5),
)


def fields() -> tuple[Array, ...]:
    """Moduli, densities, and a direction of either."""
    rng = np.random.default_rng(0)
    return rng.uniform(0.3, 1, 200), rng.uniform(0.3, 1, 200), *rng.standard_normal((2, 200))


@cache
def runs(method: str, law: Law) -> tuple[Model, Trajectory, Trajectory]:
    """The trajectory and that of a complex step. Two more Newton steps bring the imaginary part."""
    E, _, dE, _ = fields()
    cantilever = model(METHODS[method], steps=3, load=0.08, law=law)
    return cantilever, trajectory(cantilever, E), trajectory(cantilever, E + 1j * STEP * dE, polish=2)


@pytest.mark.parametrize("objective", OBJECTIVES, ids=lambda o: type(o).__name__)
@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
@pytest.mark.parametrize("method", METHODS)
def test_gradient_is_exact(method: str, law: Law, objective: PathObjective) -> None:
    cantilever, path, stepped = runs(method, law)
    _, rho, dE, drho = fields()
    by_rho, by_moduli = gradient(objective, cantilever, path, rho)
    expected = objective.value(cantilever, stepped, rho + 1j * STEP * drho).imag / STEP  # type: ignore[attr-defined]
    assert by_rho @ drho + by_moduli @ dE == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
@pytest.mark.parametrize("method", METHODS)
def test_gradient_of_sampled_points_is_exact(method: str, law: Law) -> None:
    """Near the clamp, in the middle and under the load: one by one, to 1e-10 of the largest entry."""
    cantilever, path, _ = runs(method, law)
    E, rho, _, _ = fields()
    found = {o: gradient(o, cantilever, path, rho)[1] for o in OBJECTIVES}
    for point in (3, 96, 195):
        stepped = trajectory(cantilever, E + 1j * STEP * (np.arange(200) == point), polish=2)
        for objective, by_moduli in found.items():
            expected = objective.value(cantilever, stepped, rho).imag / STEP  # type: ignore[attr-defined]
            assert by_moduli[point] == pytest.approx(expected, abs=1e-10 * np.abs(by_moduli).max())


def test_points_cross_cells_and_change_shape_in_these_runs() -> None:
    cantilever, path, _ = runs("GIMP, stretched", LAWS[0])
    first, last = path.states[0], path.states[-1]
    crossed = np.floor(cantilever.grid.cell_coordinates(last.x)) != np.floor(cantilever.grid.cell_coordinates(first.x))
    assert np.mean(crossed.any(axis=1)) > 0.3
    assert np.abs(last.half_length / first.half_length - 1).max() > 0.1


def test_stress_without_stress_has_zero_gradient() -> None:
    cantilever, path, _ = runs("GIMP", LAWS[0])
    unloaded = Trajectory(path.moduli, (path.states[0],) * 4, path.increments)
    objective = EndStress(8.0, 0.5)
    assert objective.value(cantilever, unloaded, np.ones(200)) == 0
    seed = objective.seed(cantilever, unloaded, np.ones(200), 3).F
    assert seed is not None and not np.any(seed)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: EndStress(0.5), "exponent"),
        (lambda: EndStress(8, -1), "relaxation"),
        (lambda: EndDisplacement(Rectangle((0, 0), (1, 1)), (0, 0)), "direction"),
    ],
)
def test_objectives_refuse_by_name(make: Any, match: str) -> None:
    with pytest.raises(InvalidScene, match=match):
        make()


def test_displacement_of_no_point_is_refused() -> None:
    cantilever, path, _ = runs("GIMP", LAWS[0])
    with pytest.raises(InvalidScene, match="no material point"):
        EndDisplacement(Rectangle((50, 0), (60, 10)), (0, 1)).value(cantilever, path, np.ones(200))
