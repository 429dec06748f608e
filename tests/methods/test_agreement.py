"""Where the two solvers must agree to the last digits: points at Gauss positions are Q1 finite elements."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from mpmtop.body import Material
from mpmtop.equilibrium import equilibrium
from mpmtop.loads import PointLoad, PositionLoad, RegionLoad
from mpmtop.model import discretise
from mpmtop.objectives import compliance
from mpmtop.points import to_gauss_points
from mpmtop.shape_functions import gimp, tent
from reference_fem import elasticity
from tests.scenes import cantilever
from validation.bodies.scenes import changed

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # bodies are moved and cut on purpose


@pytest.mark.parametrize("plane", ["strain", "stress"])
@pytest.mark.parametrize("h", [1.0, (0.5, 0.25)])
def test_gauss_point_mpm_is_q1(plane: str, h: float | tuple[float, float]) -> None:
    """The same stiffness to 1e-14 of its largest entry, hence the same displacement at every node.

    That to 1e-12 at h = 1; on the finer, flatter cells the condition number is ten times as large.
    """
    load = PositionLoad((8.0, 2.0), (0.3, -1.0))
    scene = cantilever(load=load, material=Material(2.0, 0.3, plane))  # type: ignore[arg-type]
    points = to_gauss_points(discretise(scene.body, h).points)
    model = discretise(scene.body, h, points=points)
    state = equilibrium(model, np.full(len(points.x), 2.0))

    fem = elasticity.discretise(scene.body, h)
    u = elasticity.solve(fem, np.full(len(fem.area), 2.0))
    _, node = KDTree(fem.basis.mesh.p.T).query(model.grid.node_positions()[model.transfer.nodes])
    dof = fem.basis.nodal_dofs[:, node].T.ravel()  # of the finite element model, in our order
    theirs = u[dof]
    tol = 1e-12 if h == 1.0 else 1e-11
    np.testing.assert_allclose(state.u, theirs, rtol=0, atol=tol * np.abs(theirs).max())
    assert compliance(model, state) == pytest.approx(fem.f_ext @ u, rel=tol)

    K = fem.stiffness(np.ones(len(fem.area))).toarray()
    unknown = np.argsort(fem.free)[np.searchsorted(np.sort(fem.free), dof[model.stiffness.dof])]  # theirs of ours
    lower = K[unknown[model.stiffness.row], unknown[model.stiffness.col]]
    entries = model.stiffness.data(np.ones(len(points.x)))
    np.testing.assert_allclose(entries, lower, rtol=0, atol=1e-14 * np.abs(K).max())
    assert np.sum(lower**2) > 0.5 * np.sum(K**2)  # no entry of theirs is missing from our pattern


def test_kratos() -> None:
    """Kratos' MPM application 10.4.4 with its own 2 x 2 Gauss points: compliance 3.40685100860e-05.

    Its loads stay at the 40 uniform points of largest x, here given as so many loads at positions.
    """
    y = 0.25 + 0.5 * np.arange(40)
    scene = cantilever(40, 20, material=Material(1e6, 0.3))
    loads = tuple(PositionLoad((39.75, float(b)), (0.0, -1 / 40)) for b in y)
    scene = changed(scene, loads=loads)
    points = to_gauss_points(discretise(scene.body, 1.0).points)
    model = discretise(scene.body, 1.0, points=points)
    value = compliance(model, equilibrium(model, np.full(3200, 1e6)))
    assert value == pytest.approx(3.40685100860e-05, rel=1e-11)  # the digits given


def test_load_at_a_position_equals_load_by_points() -> None:
    """Through the shape functions at the carriers' positions the load is the same, whichever way it is said."""
    shared = PointLoad((8.0, 2.0), (0.0, -1.0))
    points = discretise(cantilever().body, 1.0).points
    x, force = shared.act(points.x, points.volume, 1e-9).places(points.x)
    placed = tuple(PositionLoad(tuple(a), tuple(f)) for a, f in zip(x.tolist(), force.tolist(), strict=True))
    one, other = (discretise(cantilever(loads=loads).body, 1.0).f_ext for loads in ((shared,), placed))
    np.testing.assert_allclose(one, other, atol=1e-15)
    assert one.reshape(-1, 2).sum(axis=0) == pytest.approx([0, -1], abs=1e-15)


def test_gimp_and_standard_are_one_without_crossing_and_differ_with_it() -> None:
    load = RegionLoad(cantilever().body.domain, (0.0, -1.0))
    models = [discretise(cantilever(load=load).body, 1.0, shape_function=f) for f in (tent, gimp)]
    u = [equilibrium(model, np.ones(128)).u for model in models]
    np.testing.assert_array_equal(u[0], u[1])
    points = models[0].points.moved((0.3, 0.0))
    moved = [discretise(cantilever(load=load).body, 1.0, points=points, shape_function=f) for f in (tent, gimp)]
    C = [compliance(model, equilibrium(model, np.ones(128))) for model in moved]
    assert abs(C[0] / C[1] - 1) > 1e-3
