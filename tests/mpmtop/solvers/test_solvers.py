"""All solvers through one table: the same systems, the same answers, the same refusals."""

import pickle
import sys
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
import scipy.sparse as sp
from joblib import Parallel, delayed

from mpmtop.arrays import Array
from mpmtop.body import Support
from mpmtop.equilibrium import equilibrium
from mpmtop.errors import UnsupportedBody
from mpmtop.model import Model, discretise
from mpmtop.region import Circle, Difference, Rectangle
from mpmtop.shape_functions import bspline2, bspline3, gimp
from mpmtop.solvers import (
    BandedCholesky,
    Lattice,
    MultigridCG,
    Pattern,
    SingularMatrix,
    Solver,
    SparseCholesky,
    SuperLU,
    choose_solver,
)
from mpmtop.solvers.dissection import dissect
from mpmtop.solvers.sparse_cholesky import Factored
from tests.mpmtop.solvers.table import ALL, EXACT
from tests.scenes import cantilever

NOTCHED = Difference(Rectangle((0, 0), (40, 20)), Rectangle((16, 8), (40, 20)))
HOLED = Difference(Rectangle((0, 0), (40, 20)), Circle((21.3, 9.2), 6.3))
BODIES: dict[str, tuple[dict, dict]] = {
    "tent": ({}, {}),
    "L": ({"domain": NOTCHED, "loads": cantilever(40, 6).body.loads}, {}),
    "hole": ({"domain": HOLED}, {}),
    "gimp across cells": ({}, {"shape_function": gimp, "shift": 0.3}),
    "ghost": ({"domain": HOLED}, {"shift": 0.3, "ghost": 0.01}),
    "quadratic": ({}, {"shape_function": bspline2}),
    "cubic": ({}, {"shape_function": bspline3, "shift": 0.1}),
    "flat cells": ({}, {"h": (1.0, 0.25)}),
}


def model_of(name: str, solver: Callable[[Pattern], Solver]) -> Model:
    changes, how = BODIES[name]
    how = {"h": 1.0, "shift": 0.0} | how
    scene, h, shift = cantilever(40, 20, **changes), how.pop("h"), how.pop("shift")
    points = discretise(scene.body, h).points.moved((0.0, shift))
    return discretise(scene.body, h, points=points, solver=solver, **how)


def matrix(pattern: Pattern, data: Array) -> sp.csr_array:
    lower = sp.csr_array((data, (pattern.row, pattern.col)), shape=(pattern.m,) * 2)
    return sp.csr_array(lower + sp.tril(lower, -1).T)


def system(name: str, contrast: float) -> tuple[Pattern, Array, Array]:
    """Pattern, entries and load of a body whose points are solid or void at random."""
    model = model_of(name, SuperLU)
    assert isinstance(model.solver, SuperLU)
    moduli = np.where(np.random.default_rng(2).random(len(model.points.x)) < 0.5, contrast, 1.0)
    return model.solver.pattern, model.stiffness.data(moduli), model.f_ext[model.stiffness.dof]


def backward_error(K: sp.csr_array, x: Array, b: Array) -> float:
    """|b - K x| over |K| |x| + |b|, largest entry: what a backward stable solve leaves at the level of rounding."""
    return float(np.max(np.abs(b - K @ x)) / (np.max(abs(K) @ np.abs(x)) + np.max(np.abs(b))))


@EXACT
@pytest.mark.parametrize("contrast", [1.0, 1e-6, 1e-9])
@pytest.mark.parametrize("name", BODIES)
def test_solution_is_exact_to_rounding(solver: Callable[[Pattern], Solver], name: str, contrast: float) -> None:
    pattern, data, b = system(name, contrast)
    x = solver(pattern).factor(data)(b)
    assert backward_error(matrix(pattern, data), x, b) < 1e-13  # eps times the terms of a row, some hundred at most


@ALL
def test_many_right_sides_and_two_factorisations(solver: Callable[[Pattern], Solver]) -> None:
    """A second factorisation leaves the first one's answers alone, a solve its right side, and columns are as alone."""
    pattern, data, b = system("L", 1e-3)
    bound = solver(pattern)
    first = bound.factor(data)
    before, right = first(b), b.copy()
    second = bound.factor(2 * data)
    np.testing.assert_array_equal(first(b), before)
    np.testing.assert_array_equal(b, right)
    np.testing.assert_allclose(2 * second(b), before, rtol=0, atol=1e-8 * np.abs(before).max())
    many = np.random.default_rng(3).normal(size=(pattern.m, 3))
    alone = np.stack([first(column) for column in many.T], axis=1)
    # rounding times the condition number, 1e7, or the tolerance of the iteration
    np.testing.assert_allclose(first(many), alone, rtol=0, atol=1e-8 * np.abs(alone).max())
    assert not np.any(first(np.zeros(pattern.m)))


@EXACT
@pytest.mark.parametrize("m", [1, 2, 3, 7, 60, 400])
@pytest.mark.parametrize("density", [0.0, 0.02, 0.5])
def test_any_positive_definite_matrix(solver: Callable[[Pattern], Solver], m: int, density: float) -> None:
    """Of one unknown or more, diagonal, in pieces or nearly full, on no lattice."""
    below = sp.tril(sp.random_array((m, m), density=density, rng=np.random.default_rng(m)), -1)
    K = sp.coo_array(below + sp.diags_array(1.0 + (below + below.T).sum(axis=1)))
    row, col = (index.astype(np.intp) for index in K.coords)
    pattern = Pattern(m, row, col)
    b = np.random.default_rng(1).normal(size=m)
    x = solver(pattern).factor(K.data)(b)
    assert backward_error(matrix(pattern, K.data), x, b) < 1e-14


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_positions_at_random(dimension: int) -> None:
    """Unknowns anywhere in space, coupled with those near: sparse Cholesky dissects by what it is given."""
    x = np.random.default_rng(0).random((500, dimension))
    near = np.argwhere(np.linalg.norm(x[:, None] - x, axis=2) < 0.2 / (4 - dimension))
    row, col = near[near[:, 0] > near[:, 1]].T
    diagonal = np.arange(500)
    row, col = np.append(row, diagonal), np.append(col, diagonal)
    data = np.append(-np.ones(len(row) - 500), np.bincount(np.append(row, col), minlength=500) + 1.0)
    pattern = Pattern(500, row, col)
    b = np.sin(diagonal)
    u = SparseCholesky(pattern, x).factor(data)(b)
    np.testing.assert_allclose(u, SuperLU(pattern).factor(data)(b), rtol=0, atol=1e-14)


def test_pieces_that_are_not_connected() -> None:
    """Two bodies and a lone unknown in one system."""
    pattern, data, b = system("hole", 1e-3)
    assert pattern.lattice is not None
    m, lattice = pattern.m, pattern.lattice
    node = np.concatenate([lattice.node, lattice.node + np.array([60, 3]), [[200, 200]]])
    component = np.concatenate([lattice.component, lattice.component, [0]])
    row, col = (np.concatenate([k, k + m, [2 * m]]) for k in (pattern.row, pattern.col))
    both = Pattern(2 * m + 1, row, col, Lattice(lattice.h, node, component))
    x = SparseCholesky(both).factor(np.concatenate([data, 3 * data, [4.0]]))(np.concatenate([b, b, [1.0]]))
    alone = SuperLU(pattern).factor(data)(b)
    np.testing.assert_allclose(x, np.concatenate([alone, alone / 3, [0.25]]), rtol=0, atol=1e-9 * np.abs(alone).max())


@ALL
def test_mechanisms_are_named(solver: Callable[[Pattern], Solver]) -> None:
    pin, roller = Support(Rectangle((0, 0), (0, 0))), Support(Rectangle((0, 0), (40, 0)), (False, True))
    for support in (pin, roller):
        model = discretise(cantilever(40, 20, supports=(support,)).body, 1.0, solver=solver)
        with pytest.raises(UnsupportedBody, match="support"):
            equilibrium(model, np.ones(3200))
    model = discretise(cantilever(40, 20).body, 1.0, solver=solver)
    with pytest.raises(UnsupportedBody, match="node at"):
        equilibrium(model, np.where(np.abs(model.points.x[:, 0] - 20) < 2, 0.0, 1.0))


@ALL
def test_no_stiffness_at_an_unknown(solver: Callable[[Pattern], Solver]) -> None:
    pattern, data, _ = system("tent", 1.0)
    loose = 77
    data[(pattern.row == loose) | (pattern.col == loose)] = 0
    with pytest.raises(SingularMatrix) as error:
        solver(pattern).factor(data)
    assert error.value.unknown == loose


@EXACT
def test_not_positive_definite(solver: Callable[[Pattern], Solver]) -> None:
    """A pivot below zero, or one of rounding alone."""
    one = np.array([0, 1, 1]), np.array([0, 0, 1])
    for data in ([1.0, 1.0, 1.0], [1.0, 1.0, 1.0 + 1e-16]):
        with pytest.raises(SingularMatrix):
            solver(Pattern(2, *one)).factor(np.array(data))


@pytest.mark.parametrize("degree", [1, 2])
def test_dissection_separates(degree: int) -> None:
    """What a front eliminates is coupled with its boundary only, which its parents eliminate; leaves are small. One
    line of nodes separates, between biquadratic elements, too."""
    x = np.stack(np.divmod(np.arange(31 * 17), 17), axis=1).astype(float)
    lower, upper = np.ceil(x / degree) - 1, np.floor(x / degree)  # the elements that a node belongs to, along each axis
    meet = np.all(np.maximum(lower[:, None], lower) <= np.minimum(upper[:, None], upper), axis=2)
    one, other = np.nonzero(np.tril(meet, -1))
    order, first, boundary, start, parent, level = dissect(x, one, other, 10)
    np.testing.assert_array_equal(np.sort(order), np.arange(527))
    rank = np.argsort(order)
    front = np.repeat(np.arange(len(parent)), np.diff(first))
    a, b = np.sort([rank[one], rank[other]], axis=0)
    apart = front[a] != front[b]
    ties = np.unique(front[a[apart]] * 527 + b[apart])
    assert np.all(np.isin(ties, np.repeat(np.arange(len(parent)), np.diff(start)) * 527 + boundary))
    inner = np.diff(start) > 0
    np.testing.assert_array_equal(parent[inner], front[boundary[start[:-1][inner]]])
    assert np.all(parent > np.arange(len(parent)))  # children first
    assert np.all(level[parent[inner]] < level[inner])
    assert np.max(np.diff(first)) <= 17  # the first cut, across the short side
    assert np.max(np.diff(start)) <= 40  # around a quarter of the lattice


def test_choice_by_size() -> None:
    row = col = np.arange(3)
    lattice = Lattice((1.0, 1.0), np.zeros((3, 2), int), np.zeros(3, int))
    chosen = [type(choose_solver(Pattern(m, row, col, lattice))) for m in (24_999, 25_000, 99_999, 100_000)]
    assert chosen == [BandedCholesky, SparseCholesky, SparseCholesky, MultigridCG]
    assert isinstance(choose_solver(Pattern(100_000, row, col)), SparseCholesky)  # on no lattice
    assert isinstance(discretise(cantilever().body, 1.0, solver=SuperLU).solver, SuperLU)


def test_a_solver_keeps_its_latest_factorisation_and_makes_the_others_anew() -> None:
    """Asked in turn, two factorisations of one solver answer as each alone, to the last bit."""
    (pattern, soft, b), (_, stiff, _) = system("tent", 1e-9), system("tent", 1e-2)
    alone = [SparseCholesky(pattern).factor(data)(b) for data in (soft, stiff)]
    solver = SparseCholesky(pattern)
    first, second = solver.factor(soft), solver.factor(stiff)
    assert isinstance(first, Factored) and isinstance(second, Factored)
    assert first.kept is None and second.kept is not None
    values = second.kept
    for _ in range(2):
        np.testing.assert_array_equal(first(b), alone[0])
        assert first.kept is values and second.kept is None
        np.testing.assert_array_equal(second(b), alone[1])
    copy = pickle.loads(pickle.dumps(solver))
    np.testing.assert_array_equal(copy.factor(soft)(b), alone[0])


def test_threads_may_share_a_solver(request: pytest.FixtureRequest) -> None:
    """Each has the answers of its own design, though they take the values from each other."""
    request.addfinalizer(partial(sys.setswitchinterval, sys.getswitchinterval()))
    sys.setswitchinterval(1e-5)  # without the lock some fail then
    (pattern, soft, b), (_, stiff, _) = system("tent", 1e-9), system("tent", 1e-2)
    solver = SparseCholesky(pattern)
    factored = [solver.factor(data) for data in (soft, stiff)]
    alone = [solve(b) for solve in factored]
    found = Parallel(n_jobs=4, prefer="threads")(delayed(factored[k % 2])(b) for k in range(40))
    for k, x in enumerate(found):
        np.testing.assert_array_equal(x, alone[k % 2])
