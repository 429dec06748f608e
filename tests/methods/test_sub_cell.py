"""Elements of the background grid with a density for each part: against scikit-fem, and their derivative."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial import KDTree
from skfem import Basis, BilinearForm, ElementQuad1, ElementVector, MeshQuad, condense, solve
from skfem.helpers import ddot, eye, sym_grad, trace

from mpmtop.arrays import Array
from mpmtop.body import Material
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.loads import PositionLoad
from tests.scenes import cantilever
from validation.bodies.scenes import changed
from validation.measures.derivatives import central_difference
from validation.methods.sub_cell import elements_of_the_grid

WIDTH, HEIGHT = 8, 4


def by_scikit_fem(x: Array, rho: Array) -> float:
    """Compliance under a unit force down at (8, 2): 2 x 2 Gauss points in each quarter of an element."""
    nodes, weights = np.polynomial.legendre.leggauss(2)
    line = np.concatenate([(part + (1 + nodes) / 2) / 2 for part in (0, 1)])
    quadrature = np.stack(np.meshgrid(line, line), axis=0).reshape(2, -1)
    mesh = MeshQuad.init_tensor(np.arange(WIDTH + 1.0), np.arange(HEIGHT + 1.0))
    W = np.outer(*2 * [np.tile(weights / 4, 2)]).ravel()
    basis = Basis(mesh, ElementVector(ElementQuad1()), quadrature=(quadrature, W))
    places = np.moveaxis(np.asarray(basis.global_coordinates()), 0, -1)
    young = (1e-9 + rho**3 * (1 - 1e-9))[KDTree(x).query(places)[1]]

    @BilinearForm
    def stiffness(u: Any, v: Any, w: Any) -> Any:
        eps = sym_grad(u)
        return w.young * ddot((eps + 0.3 / 0.4 * eye(trace(eps), 2)) / 1.3, sym_grad(v))

    f = -basis.probes(np.array([[WIDTH], [HEIGHT / 2]])).toarray()[1]
    K = stiffness.assemble(basis, young=young)
    u = solve(*condense(K, f, D=basis.get_dofs(lambda x: np.isclose(x[0], 0))))
    return float(f @ u)


def test_compliance_is_that_of_scikit_fem() -> None:
    """Of random densities, one for each quarter of an element; the six loaded points become one force."""
    scene = cantilever(WIDTH, HEIGHT, loads=(PositionLoad((WIDTH, HEIGHT / 2), (0.0, -1.0)),))
    analyser = elements_of_the_grid(scene)
    rho = np.random.default_rng(3).uniform(0.1, 1, len(analyser.x))
    assert len(analyser.x) == 4 * WIDTH * HEIGHT
    theirs = by_scikit_fem(analyser.x, rho)
    assert analyser.problem.analyse(rho).objective == pytest.approx(theirs, rel=1e-11)  # condition number 1e4


@pytest.mark.parametrize("objective", [Compliance(), PNormStress()])
def test_gradient(objective: Compliance | PNormStress) -> None:
    """Along a random direction, against central differences; of the volume, too, which is linear."""
    problem = elements_of_the_grid(changed(cantilever(WIDTH, HEIGHT), objective=objective)).problem
    rng = np.random.default_rng(5)
    x, d, t = rng.uniform(0.3, 0.7, len(problem.x0)), rng.uniform(-1, 1, len(problem.x0)), 1e-5
    df0, dg = problem.gradient(problem.evaluate(x))
    # t^2 = 1e-10 times third derivatives
    assert df0 @ d == pytest.approx(central_difference(lambda x: problem.evaluate(x).objective, x, d, t), rel=1e-7)
    assert dg @ d == pytest.approx(central_difference(lambda x: problem.evaluate(x).constraints, x, d, t), rel=1e-9)


def test_p_norm_of_an_even_stress_is_the_papers() -> None:
    """A strip in pure tension, nu = 0: stress 1 in each of 16 parts, whatever number of Gauss points they have."""
    ends = tuple(PositionLoad((4.0, y), (0.5, 0.0)) for y in (0.0, 1.0))
    scene = cantilever(4, 1, loads=ends, material=Material(1.0, 0.0), objective=PNormStress())
    analyser = elements_of_the_grid(scene)
    evaluation = analyser.problem.analyse(np.ones(16))
    np.testing.assert_allclose(analyser.solid_von_mises(evaluation), 1, rtol=1e-12)
    assert evaluation.objective == pytest.approx(16 ** (1 / 12), rel=1e-12)
