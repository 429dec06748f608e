"""Displaced supports, springs, held edges: points at Gauss positions and Q1 elements to ten digits, and gradients."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial import KDTree

from mpmtop.body import Bed, Body, EdgeSupport, Material, Spring, Support
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.design import Design
from mpmtop.equilibrium import equilibrium
from mpmtop.errors import InvalidScene, NotConverged, UnsupportedBody
from mpmtop.loads import PositionLoad, Traction
from mpmtop.model import discretise
from mpmtop.objectives import compliance
from mpmtop.points import to_gauss_points
from mpmtop.region import Polygon, Rectangle
from reference_fem import elasticity
from reference_fem.at_elements import fields_at_elements
from reference_fem.elasticity import State, displacements, inverse_stiffness, resistance
from reference_fem.simp import DesignProblem
from tests.scenes import LEFT_CLAMP

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

BOX = Rectangle((0, 0), (6, 3))
PULL = Traction(Rectangle((6, 0), (6, 3)), (0.3, -0.1))
GRIP = Support(Rectangle((-1, 2.9), (0.1, 3.1)), (True, False), (0.2, 0.0))
SUPPORTS = {
    "displaced": (LEFT_CLAMP, Support(Rectangle((6, 3), (6, 3)), (True, True), (0.1, -0.2))),
    "springs": (LEFT_CLAMP, Spring((6, 3), 0.4, (1, 2)), Spring((5.3, 1.2), 2.0, (0, 1))),
    "edges": (EdgeSupport(Rectangle((0, 0), (0, 3))), EdgeSupport(Rectangle((2, 0), (4.5, 0)), (1, 3))),
    "bed": (
        Bed(Rectangle((0, 0), (6, 0)), 0.3),
        Bed(Rectangle((0, 0), (0, 3)), 2.0, "normal"),
        Spring((6, 3), 0.4, (1, 2)),
    ),
    "all": (EdgeSupport(Rectangle((0, 0), (6, 0)), "normal"), Spring((6, 3), 0.4, (1, 2)), GRIP),
}
CHOSEN = pytest.mark.parametrize("supports", list(SUPPORTS.values()), ids=list(SUPPORTS))


@CHOSEN
def test_points_at_gauss_positions_are_elements(supports: tuple[Any, ...]) -> None:
    """Displacements, compliance and reactions."""
    body = Body(BOX, supports, (PULL,), Material(2.0, 0.3))
    points = to_gauss_points(discretise(body, 1.0).points)
    model = discretise(body, 1.0, points=points)
    state = equilibrium(model, np.full(len(points.x), 2.0))
    fem = elasticity.discretise(body, 1.0)
    young = np.full(len(fem.area), 2.0)
    u = elasticity.solve(fem, young)
    dof = fem.basis.nodal_dofs[:, KDTree(fem.basis.mesh.p.T).query(model.grid.node_positions(model.transfer.nodes))[1]]
    np.testing.assert_allclose(state.u, u[dof.T.ravel()], rtol=0, atol=1e-10 * np.abs(u).max())
    # of a body at E0, density one
    judged = DesignProblem(fem, Design(1.0, 1.0, contrast=0.0)).analyse(np.ones(len(young))).objective
    assert compliance(model, state) == pytest.approx(judged, rel=1e-10)
    reaction = fields_at_elements(fem, State(young, u, inverse_stiffness(fem, young)), np.ones(len(young))).reaction
    np.testing.assert_allclose(reaction.sum(axis=0), [-0.9, 0.3], rtol=1e-9)


@CHOSEN
@pytest.mark.parametrize("criterion", [Compliance(), PNormStress(6, measure="von_mises_in_plane")], ids=["C", "stress"])
def test_gradients_by_elements(supports: tuple[Any, ...], criterion: Compliance | PNormStress) -> None:
    """Against complex steps through dense algebra."""
    model = elasticity.discretise(Body(BOX, supports, (PULL,)), 1.0)
    design, N = Design(0.5, 1.0, contrast=1e-3), model.basis.N
    problem = DesignProblem(model, design, criterion)
    T = elasticity.strain_operator(model)

    def objective(rho: Any) -> Any:
        young = design.contrast + rho**design.penal * (1 - design.contrast)
        K = np.stack([_complex_resistance(model, young, unit) for unit in np.eye(N)], axis=1)
        g = np.zeros(N) if model.prescribed is None else model.prescribed
        u, f = g.astype(complex), model.f_ext
        u[model.free] = np.linalg.solve(K[np.ix_(model.free, model.free)], (f - K @ g)[model.free])
        if isinstance(criterion, Compliance):
            return 2 * f @ u - u @ K @ u
        nu = 0.3
        D = np.array([[1 - nu, nu, 0], [nu, 1 - nu, 0], [0, 0, 0.5 - nu]]) / ((1 + nu) * (1 - 2 * nu))
        xx, yy, xy = ((T @ u).reshape(-1, 3) @ D).T
        vm = np.sqrt(xx**2 - xx * yy + yy**2 + 3 * xy**2)
        return np.sum((rho**criterion.q * vm) ** criterion.p) ** (1 / criterion.p)

    rho = np.random.default_rng(0).uniform(0.2, 1, len(model.area))
    at = problem.analyse(rho)
    assert at.objective == pytest.approx(objective(rho).real, rel=1e-9)
    gradient = problem.density_gradient(at)
    for e in (0, 7, len(rho) - 1):
        stepped = objective(rho + 1e-30j * (np.arange(len(rho)) == e)).imag / 1e-30
        assert gradient[e] == pytest.approx(stepped, rel=1e-8, abs=1e-9 * np.abs(gradient).max())


def _complex_resistance(model: elasticity.FemModel, young: Any, u: Any) -> Any:
    """K u for complex moduli: real and imaginary part apart, as K is linear in them and springs are real."""
    if not np.iscomplexobj(young):
        return resistance(model, young, u)
    springs = resistance(model, np.zeros(len(young)), u)
    return resistance(model, young.real, u) + 1e-30j * (resistance(model, 1e30 * young.imag, u) - springs)


def test_an_oblique_edge_by_elements() -> None:
    """A wedge on stairs, held along its lower edge: as points at Gauss positions hold it."""
    wedge = Polygon(((0, 0), (6, 1.7), (6, 4), (0, 4)))
    edge = EdgeSupport(Rectangle((0, 0), (6, 1.7)))
    body = Body(wedge, (edge,), (Traction(Rectangle((1, 4), (6, 4)), (0.5, -1.0)),))
    fem = elasticity.discretise(body, 1.0)
    every = to_gauss_points(discretise(Body(Rectangle((0, 0), (6, 4)), (LEFT_CLAMP,)), 1.0).points)
    kept = KDTree(fem.centres).query(every.x, p=np.inf)[0] < 0.5
    points = type(every)(every.x[kept], every.volume[kept], every.half_length[kept])
    model = discretise(body, 1.0, points=points)
    state = equilibrium(model, np.ones(len(points.x)))
    young = np.ones(len(fem.area))
    u = displacements(fem, young, inverse_stiffness(fem, young), fem.f_ext)
    dof = fem.basis.nodal_dofs[:, KDTree(fem.basis.mesh.p.T).query(model.grid.node_positions(model.transfer.nodes))[1]]
    np.testing.assert_allclose(state.u, u[dof.T.ravel()], rtol=0, atol=1e-10 * np.abs(u).max())


def test_what_elements_cannot_hold_is_named() -> None:
    load = PositionLoad((6, 2), (0.0, -1.0))
    with pytest.raises(UnsupportedBody, match="no boundary of the domain"):
        elasticity.discretise(Body(BOX, (LEFT_CLAMP, EdgeSupport(Rectangle((2, 1), (3, 2)))), (load,)), 1.0)
    twice = Support(LEFT_CLAMP.region, (True, True), (0.1, 0.0)), LEFT_CLAMP
    with pytest.raises(InvalidScene, match=r"displace the node at .* differently"):
        elasticity.discretise(Body(BOX, twice, (load,)), 1.0)
    loose = elasticity.discretise(Body(BOX, (Spring((0, 0), 1.0, (1, 0)),), (load,)), 1.0)
    with pytest.raises((UnsupportedBody, NotConverged), match="hold the part"):  # a pivot is zero to rounding
        elasticity.solve(loose, np.ones(len(loose.area)))
