"""Designs that are hard for multigrid: gaps between their members are narrower than what coarse lattices resolve.

`hard_designs.npz` holds densities of iterations 10 and 23 of the cantilever's optimisation with 500,000 points (the
scale study's, compliance), in sixteen steps, two to a byte.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.material import simp
from mpmtop.model import Model, discretise
from mpmtop.solvers import MAX_ITERATIONS, MultigridCG, Solve
from mpmtop.solvers.multigrid import COARSEST
from mpmtop.solvers.multigrid_cg import IteratedSolve
from tests.scenes import cantilever

DESIGNS = Path(__file__).with_name("hard_designs.npz")


def moduli(name: str) -> Array:
    """Of the points (p,), contrast 1e-9."""
    packed = np.load(DESIGNS)[name]
    return simp(np.stack([packed >> 4, packed & 15], axis=-1).ravel() / 15, 3.0, 1e-9)[0]


@pytest.fixture(scope="module")
def model() -> Model:
    return discretise(cantilever(40, 20).body, 0.08)


def solved(solver: MultigridCG, data: Array, b: Array) -> tuple[Array, int, bool]:
    """x, the cycles taken, and whether the direct solver was asked instead."""
    cycles, asked = [], []

    def fallback() -> Solve:
        asked.append(True)
        return np.zeros_like

    solve = solver.factor(data)
    assert isinstance(solve, IteratedSolve)
    counted = replace(solve, cycle=lambda f: cycles.append(1) or solve.cycle(f), factor=fallback)
    return counted(b), len(cycles), bool(asked)


HARD = ("iteration_10", "iteration_23")


@pytest.mark.slow
@pytest.mark.parametrize("name", HARD)
def test_answered_to_the_tolerance(model: Model, name: str) -> None:
    """Without the direct solver (8 and 28 cycles)."""
    solver, b = model.solver, model.f_ext[model.stiffness.dof]
    assert isinstance(solver, MultigridCG)
    data = model.stiffness.data(moduli(name))
    x, _, asked = solved(solver, data, b)
    assert not asked
    off = b.copy()
    np.subtract.at(off, solver.pattern.row, data * x[solver.pattern.col])
    below = solver.pattern.row > solver.pattern.col
    np.subtract.at(off, solver.pattern.col[below], (data * x[solver.pattern.row])[below])
    assert np.linalg.norm(off) <= solver.tolerance * np.linalg.norm(b)


@pytest.mark.slow
@pytest.mark.parametrize("name", HARD)
def test_a_coarsest_lattice_of_a_quarter_resolves_them(model: Model, name: str) -> None:
    """To 1e-5 they take half of the cycles that are allowed, from a lattice of a sixteenth twice as many (14 and 39 for
    7 and 19)."""
    b, data = model.f_ext[model.stiffness.dof], model.stiffness.data(moduli(name))
    quarter, sixteenth = (MultigridCG(model.solver.pattern, 1e-5, coarsest) for coarsest in (COARSEST, 20_000))
    cycles = solved(quarter, data, b)[1]
    assert cycles <= MAX_ITERATIONS / 2
    assert solved(sixteenth, data, b)[1] >= 1.5 * cycles
