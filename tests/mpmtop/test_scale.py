"""What large bodies take instead of small ones' sparse matrices is the same operator, in a fraction of the memory."""

import numpy as np
import pytest
import scipy.sparse as sp

from mpmtop.equilibrium import adjoint, moduli_gradient
from mpmtop.filter import DesignSpace, density_filter, passive_filter
from mpmtop.model import Model, discretise
from mpmtop.objectives import COMPLIANCE
from mpmtop.planning import plan
from mpmtop.points import MaterialPoints, seed
from mpmtop.problem import design_problem
from mpmtop.region import Circle, Difference, Rectangle
from mpmtop.shape_functions import ShapeFunction, bspline2, gimp, tent
from mpmtop.solvers import MultigridCG
from mpmtop.stiffness import CellMap
from tests.scenes import SHAPE_FUNCTIONS, cantilever
from validation.measures.derivatives import adjoint_gap

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # bodies are moved and cut on purpose

HOLED = Difference(Rectangle((0, 0), (12, 8)), Circle((5.3, 3.2), 2.3))


@pytest.fixture
def large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every body counts as large."""
    monkeypatch.setattr("mpmtop.filter.BY_CONVOLUTION", 0)


def model_of(shape_function: ShapeFunction, points: MaterialPoints, ghost: float = 0.0) -> Model:
    return discretise(
        cantilever(12, 8, domain=HOLED).body, 1.0, points=points, shape_function=shape_function, ghost=ghost
    )


def cell_map(model: Model) -> CellMap:
    part = model.stiffness.maps[0]
    assert isinstance(part, CellMap)
    return part


def scattered() -> MaterialPoints:
    """No two points alike: moved at random, with volumes of their own."""
    points, rng = seed(HOLED, (0.5, 0.5)), np.random.default_rng(0)
    p = len(points.x)
    return MaterialPoints(points.x + rng.uniform(-0.2, 0.2, (p, 2)), rng.uniform(0.1, 0.3, p), points.half_length)


@pytest.mark.parametrize("shape_function", SHAPE_FUNCTIONS, ids=lambda f: f.__name__)
@pytest.mark.parametrize("arrangement", ["seeded", "moved", "scattered"])
def test_stiffness_by_cells(shape_function: ShapeFunction, arrangement: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In either form it is B^T E V D B and the ghost penalty's part, whatever the arrangement; the smaller is kept."""
    points = {"seeded": seed(HOLED, (0.5, 0.5)), "scattered": scattered()}
    points["moved"] = points["seeded"].moved((0.3, 0.1))
    at = points[arrangement]
    moduli = np.random.default_rng(1).random(len(at.x))
    for ghost in (0.0, 0.1) if shape_function in (tent, gimp) else (0.0,):
        model = model_of(shape_function, at, ghost)
        with monkeypatch.context() as patch:
            patch.setattr(CellMap, "smaller", lambda cells: cells)
            by_cells = model_of(shape_function, at, ghost).stiffness
        part = by_cells.maps[0]
        assert isinstance(part, CellMap)
        # B-splines differ at the ends
        assert len(part.local) == len(moduli) if arrangement == "scattered" else len(part.local) <= 36
        memory = part.local.nbytes + part.place.nbytes + part.kind.nbytes
        assert isinstance(model.stiffness.maps[0], CellMap) == (memory <= 12 * part.tocsr().nnz)

        K, force = model.stiffness, model.ghost.jump.T
        E_F = np.repeat(model.ghost.modulus @ moduli, 2)
        EVD = sp.kron(sp.diags_array(moduli * at.volume), model.D)
        expected = model.transfer.B.T @ EVD @ model.transfer.B + sp.kron(
            force @ sp.diags_array(E_F) @ force.T, np.eye(2)
        )
        lower = np.tril(expected.toarray()[np.ix_(K.dof, K.dof)])
        atol = 1e-13 * np.abs(lower).max()  # rounding of positions, and sums in another order
        for entries in (K.data(moduli), K.data_map @ moduli, by_cells.data(moduli)):
            at_place = sp.csr_array((entries, (K.row, K.col)), shape=lower.shape)
            np.testing.assert_allclose(at_place.toarray(), lower, rtol=0, atol=atol)


def test_memory_of_the_map_does_not_grow_with_points() -> None:
    """A lattice has four distinct points, however many there are; a point takes a fifth of the sparse map's memory."""
    sizes = []
    for n in (20, 40):
        model = discretise(cantilever(n, n // 2).body, 1.0)
        part = cell_map(model)
        assert len(part.local) == 4
        sizes.append(sum(a.nbytes for a in (part.point, part.start, part.kind, part.local, part.place)))
    assert sizes[1] / sizes[0] == pytest.approx(4, rel=0.05)  # the start of the cells and the four matrices
    assert 5 * sizes[1] < sum(a.nbytes for a in (part.tocsr().data, part.tocsr().indices))


@pytest.mark.parametrize("radius", [0.4, 1.3, 1.5, 30.0])
@pytest.mark.parametrize("spacing", [(0.5, 0.5), (0.25, 1.0)])
def test_filter_by_convolution(radius: float, spacing: tuple[float, float], monkeypatch: pytest.MonkeyPatch) -> None:
    """The pair search's filter, around a hole, from below one spacing to beyond the body; and its adjoint."""
    points = seed(HOLED, spacing)
    W = density_filter(points, radius)
    monkeypatch.setattr("mpmtop.filter.BY_CONVOLUTION", 0)
    by_lattice = density_filter(points, radius)
    assert not isinstance(by_lattice.matrix, type(W.matrix))
    x, y = np.random.default_rng(2).random((2, len(points.x)))
    # values of order one, rounding of a transform
    np.testing.assert_allclose(by_lattice(x), W(x), rtol=0, atol=1e-14)
    np.testing.assert_allclose(by_lattice.adjoint(y), W.adjoint(y), rtol=0, atol=1e-13)
    assert adjoint_gap(by_lattice, by_lattice.adjoint, x, y) < 1e-14


@pytest.mark.parametrize("over_passive", [False, True])
def test_passive_filter_by_convolution(over_passive: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    points = seed(HOLED, (0.5, 0.5))
    x = points.x[:, 0]
    space = DesignSpace(x < 1.5, x > 11)
    W = passive_filter(points, 1.3, space, over_passive=over_passive)
    monkeypatch.setattr("mpmtop.filter.BY_CONVOLUTION", 0)
    by_lattice = passive_filter(points, 1.3, space, over_passive=over_passive)
    rng = np.random.default_rng(3)
    design, gradient = rng.random(len(space.active)), rng.random(len(x))
    np.testing.assert_allclose(by_lattice(design), W(design), rtol=0, atol=1e-14)
    np.testing.assert_allclose(by_lattice.adjoint(gradient), W.adjoint(gradient), rtol=0, atol=1e-13)


@pytest.mark.usefixtures("large")
def test_only_a_lattice_is_convolved() -> None:
    """Points moved singly, of unequal volume, or in one place are searched in pairs: a sparse matrix, as for few."""
    points = seed(HOLED, (0.5, 0.5))
    one = np.zeros_like(points.x)
    one[7, 0] = 0.01
    onto_the_next = np.zeros_like(points.x)
    onto_the_next[0] = points.x[1] - points.x[0]
    for other in (scattered(), points.moved(one), points.moved(onto_the_next)):
        assert density_filter(other, 1.3).matrix.nnz > len(points.x)


@pytest.mark.usefixtures("large")
def test_plan_and_fingerprint() -> None:
    """Large problems are told apart, too: by radius, by the place of their points, by shape function."""
    scene = cantilever(12, 8)
    problems = [
        design_problem(scene, 1.0),
        design_problem(cantilever(12, 8, filter_radius=1.6), 1.0),
    ]
    problems += [design_problem(scene, 1.0, shape_function=bspline2)]
    assert len({problem.fingerprint for problem in problems}) == 3
    assert problems[0].fingerprint == design_problem(scene, 1.0).fingerprint
    text = plan(problems[0])
    assert "by 96 cells and 4 distinct matrices" in text
    assert "filter: a convolution" in text


def test_a_large_body() -> None:
    """A hundred thousand points: every choice by size at once; dC/dlnE sums to -C, and the filter keeps the volume."""
    problem = design_problem(cantilever(320, 160, filter_radius=6.0), 1.0, ppc=(1, 2))
    model = problem.model
    assert isinstance(model.solver, MultigridCG)
    assert isinstance(model.stiffness.maps[0], CellMap)
    at = problem.evaluate(problem.x0)
    assert at.state.solves == 1
    assert at.rho == pytest.approx(0.4, rel=1e-13)
    by_moduli = moduli_gradient(model, at.state, adjoint(model, at.state, COMPLIANCE))
    assert at.state.moduli @ by_moduli == pytest.approx(-at.objective, rel=1e-6)  # the solver's tolerance
