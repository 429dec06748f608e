"""Tractions, pressure, body force, weight: points at Gauss positions and Q1 elements to ten digits, and gradients."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial import KDTree

from mpmtop.body import Body, Material
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.design import Design
from mpmtop.equilibrium import equilibrium
from mpmtop.loads import BodyForce, Load, Pressure, Traction, Weight
from mpmtop.model import discretise
from mpmtop.points import to_gauss_points
from mpmtop.region import Circle, Difference, Polygon, Rectangle, Region
from mpmtop.scene import Scene
from reference_fem import elasticity
from reference_fem.hole import around_hole
from reference_fem.reanalyse import build_judge
from reference_fem.simp import DesignProblem, simp
from tests.scenes import LEFT_CLAMP

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

BOX = Rectangle((0, 0), (12, 8))
HOLE = Circle((6.3, 4.1), 2.2)
WEDGE = Polygon(((0, 0), (12, 3.3), (12, 8), (0, 8)))


@pytest.mark.parametrize(
    ("domain", "load"),
    [
        (BOX, Traction(Rectangle((12, 1.3), (12, 5.7)), (1.0, -0.5))),
        (Difference(BOX, HOLE), Pressure(HOLE, 2.0)),
        (WEDGE, Pressure(Rectangle((2, 0), (12, 3.4)), 2.0)),
        (BOX, BodyForce(lambda x: np.stack([x[:, 1] ** 2, -x[:, 0]], axis=1), Rectangle((3, 0), (12, 8)))),
        (Difference(BOX, HOLE), Weight((0.1, -0.3))),
    ],
    ids=["part of an edge", "hole on stairs", "oblique edge", "body force", "weight"],
)
@pytest.mark.parametrize("h", [1.0, (1.0, 0.5)])
def test_points_at_gauss_positions_are_elements(domain: Region, load: Load, h: float | tuple[float, float]) -> None:
    """Forces and displacements, of a domain cut into the cells whose centres it holds."""
    body = Body(domain, (LEFT_CLAMP,), (load,), Material(2.0, 0.3))
    fem = elasticity.discretise(body, h)
    every = to_gauss_points(discretise(Body(BOX, (LEFT_CLAMP,)), h).points)
    cell = np.repeat(fem.centres, 4, axis=0)
    kept = KDTree(fem.centres).query(every.x, p=np.inf)[0] < 0.5 * np.max(h)
    kept &= np.all(
        np.abs(every.x - fem.centres[KDTree(fem.centres / h).query(every.x / np.array(h))[1]]) < np.divide(h, 2), 1
    )
    points = type(every)(every.x[kept], every.volume[kept], every.half_length[kept])
    assert len(points.x) == len(cell)
    model = discretise(body, h, points=points)
    ones = np.ones(len(points.x))
    state = equilibrium(model, 2 * ones, f_ext=model.force(ones))

    dof = fem.basis.nodal_dofs[:, KDTree(fem.basis.mesh.p.T).query(model.grid.node_positions(model.transfer.nodes))[1]]
    force = fem.force(np.ones(len(fem.area)))
    scale = np.abs(force).max()
    np.testing.assert_allclose(model.force(ones), force[dof.T.ravel()], rtol=0, atol=1e-10 * scale)
    u = elasticity.inverse_stiffness(fem, np.full(len(fem.area), 2.0))(force)
    np.testing.assert_allclose(state.u, u[dof.T.ravel()], rtol=0, atol=1e-10 * np.abs(u).max())


@pytest.mark.parametrize("criterion", [Compliance(), PNormStress(6, measure="von_mises_in_plane")], ids=["C", "stress"])
def test_the_gradient_of_weight_by_elements(criterion: Compliance | PNormStress) -> None:
    """Against complex steps through dense algebra."""
    body = Body(
        Rectangle((0, 0), (6, 3)), (LEFT_CLAMP,), (Weight((0.1, -0.5)), Traction(Rectangle((6, 0), (6, 3)), (0, -1)))
    )
    model = elasticity.discretise(body, 1.0)
    design = Design(0.5, 1.0, contrast=1e-3)
    problem = DesignProblem(model, design, criterion)
    T = elasticity.strain_operator(model)

    def objective(rho: Any) -> Any:
        young = design.contrast + rho**design.penal * (1 - design.contrast)
        K = np.zeros((len(model.free),) * 2, complex)
        column = np.repeat(np.arange(len(model.free)), np.diff(model.stiffness.indptr))
        K[model.stiffness.indices, column] = model.stiffness.weights @ young
        f, u = model.f_ext + model.weight @ rho, np.zeros(model.basis.N, complex)
        u[model.free] = np.linalg.solve(K, f[model.free])
        if isinstance(criterion, Compliance):
            return f @ u
        eps = (T @ u).reshape(-1, 3)
        nu = 0.3
        D = np.array([[1 - nu, nu, 0], [nu, 1 - nu, 0], [0, 0, 0.5 - nu]]) / ((1 + nu) * (1 - 2 * nu))
        xx, yy, xy = (eps @ D).T
        vm = np.sqrt(xx**2 - xx * yy + yy**2 + 3 * xy**2)
        return np.sum((rho**criterion.q * vm) ** criterion.p) ** (1 / criterion.p)

    rho = np.random.default_rng(0).uniform(0.2, 1, len(model.area))
    assert simp(rho, body.material, design)[0].shape == rho.shape
    at = problem.analyse(rho)
    assert at.objective == pytest.approx(objective(rho).real, rel=1e-9)
    gradient = problem.density_gradient(at)
    for e in (0, 7, len(rho) - 1):
        stepped = objective(rho + 1e-30j * (np.arange(len(rho)) == e)).imag / 1e-30
        assert gradient[e] == pytest.approx(stepped, rel=1e-8)


def test_a_mesh_that_fits_the_hole() -> None:
    """Chords for the circle: positions on it are outside of elements; forces and their virial are the circle's."""
    body = Body(Difference(BOX, Circle((6, 4), 2.0)), (LEFT_CLAMP,), (Pressure(Circle((6, 4), 2.0), 3.0),))
    model = elasticity.discretise(body, mesh=around_hole((0, 0), (12, 8), (6, 4), 2.0, 1.0), order=2)
    components = model.basis.split_indices()
    f = np.stack([model.f_ext[dofs] for dofs in components])
    x = model.basis.doflocs[:, components[0]] - [[6], [4]]
    np.testing.assert_allclose(f.sum(axis=1), 0, atol=1e-11)
    assert np.sum(x * f) == pytest.approx(3.0 * 2 * np.pi * 4, rel=1e-9)


def test_the_judge_takes_them() -> None:
    """On one element for each point it is the model of these elements, weight included."""
    body = Body(BOX, (LEFT_CLAMP,), (Traction(Rectangle((12, 0), (12, 8)), (0, -1)), Weight((0, -0.2))))
    points = discretise(body, 1.0, 1).points
    scene = Scene("wall", body, Design(0.5, 1.5))
    rho = np.random.default_rng(1).uniform(0.2, 1, len(points.x))
    judged = build_judge(scene, points.x, points.half_length, split=1, order=1)(rho)
    ours = DesignProblem(elasticity.discretise(body, 1.0), scene.design).analyse(rho).objective
    assert judged.compliance == pytest.approx(ours, rel=1e-10)
