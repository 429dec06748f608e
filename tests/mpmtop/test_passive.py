"""Passive solid and void: out of the design vector, in the analysis, and a void that is as good as absent."""

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.errors import EmptyDomain, InvalidScene, LoadOutsideBody
from mpmtop.filter import density_filter
from mpmtop.loads import PointLoad, PositionLoad, RegionLoad
from mpmtop.model import discretise
from mpmtop.optimizers import GCMMA, MMA, OptimalityCriteria, UpdateRule, optimize
from mpmtop.planning import plan
from mpmtop.problem import DesignProblem, design_problem
from mpmtop.quadtree import quadtree
from mpmtop.region import Circle, Difference, Rectangle, Region
from mpmtop.scene import Scene
from mpmtop.shape_functions import gimp
from tests.scenes import cantilever
from validation.measures.derivatives import taylor_orders
from validation.oracles.woodbury import State, exact_derivatives, material_points

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # bodies are moved and cut on purpose

BODY = Rectangle((0, 0), (8, 4))
HOLE = Circle((4, 2), 1.1)
PLATE = Rectangle((6, 3), (8, 4))
OBJECTIVES = [Compliance(), PNormStress(p=8.0, q=0.5)]
EVERY = pytest.mark.parametrize("objective", OBJECTIVES, ids=["compliance", "p-norm"])
FILTERS = pytest.mark.parametrize("filter_passive", [False, True], ids=["active only", "over passive"])


def problem(
    *, solid: Region | None = PLATE, void: Region | None = HOLE, filter_passive: bool = False, **changes: object
) -> DesignProblem:
    """The 8 x 4 cantilever of 128 points; by default 16 void ones in the hole and 8 solid ones at the load's corner."""
    scene = cantilever(passive_solid=solid, passive_void=void, **changes)
    return design_problem(scene, 1.0, filter_passive=filter_passive)


def random_design(p: DesignProblem, seed: int = 0) -> Array:
    return np.random.default_rng(seed).uniform(0.2, 0.8, len(p.x0))


@FILTERS
def test_passive_densities_are_fixed_and_no_variables(filter_passive: bool) -> None:
    p = problem(filter_passive=filter_passive)
    x = p.model.points.x
    solid, void = PLATE.contains(x), HOLE.contains(x)
    assert (solid.sum(), void.sum()) == (8, 16)
    active = ~(solid | void)
    rho = p.evaluate(random_design(p)).rho
    assert np.all(rho[solid] == 1) and np.all(rho[void] == 0) and np.all((rho[active] > 0) & (rho[active] < 1))
    gradient = p.gradient(p.evaluate(p.x0))
    assert p.x0.shape == p.lower.shape == p.upper.shape == gradient[0].shape == gradient[1][0].shape == (104,)
    np.testing.assert_array_equal(p.space.active, np.flatnonzero(active))


def test_filter_over_active_points_leaves_the_others_out() -> None:
    """By definition, with the distances of the active points alone."""
    p = problem()
    x = p.model.points.x[p.space.active]
    weight = np.maximum(0, 1.5 - np.linalg.norm(x[:, None] - x, axis=-1))
    design = random_design(p)
    np.testing.assert_allclose(p.filter(design)[p.space.active], weight @ design / weight.sum(axis=1), rtol=1e-14)
    np.testing.assert_allclose(p.filter(np.ones(104))[p.space.active], 1, rtol=1e-14)


def test_filter_over_passive_points_is_filter_then_overwrite() -> None:
    p = problem(filter_passive=True)
    design, space = random_design(p), p.space
    every = space.solid.astype(float)
    every[space.active] = design
    expected = density_filter(p.model.points, 1.5)(every)
    expected[space.solid], expected[space.void] = 1, 0
    np.testing.assert_allclose(p.filter(design), expected, rtol=0, atol=1e-15)
    assert p.filter.adjoint(expected) @ design == pytest.approx(
        expected @ (p.filter(design) - p.filter(np.zeros(104))), rel=1e-13
    )


@EVERY
@FILTERS
@pytest.mark.parametrize("shift", [0.0, 0.3], ids=["", "crossing"])
def test_gradient_has_a_second_order_remainder(
    objective: Compliance | PNormStress, filter_passive: bool, shift: float
) -> None:
    """Taylor test in a random direction of the active variables; the constraint is affine."""
    base = problem(objective=objective, filter_passive=filter_passive)
    points = base.model.points.moved((shift, 0.0))
    model = discretise(base.model.body, 1.0, points=points, shape_function=gimp)
    p = DesignProblem(model, base.design, objective, base.model.points, filter_passive)
    x, d = random_design(p), np.random.default_rng(1).uniform(-0.1, 0.1, 104)
    at = p.evaluate(x)
    dJ, dg = p.gradient(at)
    order = taylor_orders(lambda x: p.evaluate(x).objective, x, d, dJ @ d, (1e-3, 1e-4))
    assert order == pytest.approx(2, abs=0.05)  # the third-order term at t = 1e-4
    np.testing.assert_allclose(p.evaluate(x + d).constraints, at.constraints + dg @ d, rtol=1e-11)


@EVERY
@FILTERS
def test_gradient_is_that_of_a_complex_step(objective: Compliance | PNormStress, filter_passive: bool) -> None:
    """By every density, those at 0 and 1 included, and by every variable."""
    p = problem(objective=objective, filter_passive=filter_passive)
    at = p.evaluate(random_design(p))
    exact = exact_derivatives(State.at(material_points(p), at.rho))
    # rounding times the condition number of a body with a hole of contrast 1e-9, whose strains are large
    np.testing.assert_allclose(p.density_gradient(at), exact, rtol=0, atol=1e-9 * np.abs(exact).max())
    expected = p.filter.matrix.toarray().T @ exact
    np.testing.assert_allclose(p.gradient(at)[0], expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@EVERY
@pytest.mark.parametrize("contrast", [1e-6, 1e-12])
@pytest.mark.parametrize("hole", [HOLE, Circle((3.3, 1.7), 1.45)], ids=["centred", "any"])
def test_void_is_absence_to_the_contrast(objective: Compliance | PNormStress, contrast: float, hole: Circle) -> None:
    """Objective, gradient and volume of a passive void and of a domain without it, and the displacements around it."""
    void = problem(solid=None, void=hole, contrast=contrast, objective=objective)
    absent = design_problem(cantilever(domain=Difference(BODY, hole), contrast=contrast, objective=objective), 1.0)
    x = random_design(void)
    np.testing.assert_array_equal(void.model.points.x[void.space.active], absent.model.points.x)
    a, b = void.evaluate(x), absent.evaluate(x)
    np.testing.assert_allclose(a.rho[void.space.active], b.rho, rtol=1e-14)  # the order of a sum
    # the void's part of the stiffness, at most contrast / 0.2^3 of its neighbours', times its part of the energy
    tol = 125 * contrast
    assert a.objective == pytest.approx(b.objective, rel=tol)
    assert a.constraints == pytest.approx(b.constraints, abs=1e-14)
    (dJ, dg), (expected_dJ, expected_dg) = void.gradient(a), absent.gradient(b)
    np.testing.assert_allclose(dJ, expected_dJ, rtol=0, atol=4 * tol * np.abs(expected_dJ).max())
    np.testing.assert_allclose(dg, expected_dg, rtol=1e-13)
    common = np.isin(void.model.transfer.nodes, absent.model.transfer.nodes)
    u = a.u.reshape(-1, 2)[common].ravel()
    np.testing.assert_allclose(u, b.u, rtol=0, atol=tol * np.abs(b.u).max())


@FILTERS
def test_volume(filter_passive: bool) -> None:
    """Solid counts, void does not, in the sum as in the bound; the start meets the constraint."""
    p = problem(filter_passive=filter_passive)
    start = p.evaluate(p.x0)
    assert start.constraints[0] == pytest.approx(0, abs=1e-14)
    assert np.ptp(p.x0) == 0
    volume = 0.25 * start.rho.sum()
    assert volume == pytest.approx(0.4 * 0.25 * 112, rel=1e-14)
    if not filter_passive:
        assert p.x0[0] == pytest.approx((0.4 * 112 - 8) / 104, rel=1e-14)
    full = p.evaluate(np.ones(104)).constraints[0]
    assert full == pytest.approx(1 / 0.4 - 1 if not filter_passive else full, rel=1e-14)


def test_volume_on_a_quadtree() -> None:
    """Leaves of two sizes: volumes count, not leaves."""
    tree = quadtree(BODY, (0.5, 0.5))
    points = tree.refine(tree.within(Rectangle((3, 1), (8, 4)))).points()
    scene = cantilever(passive_solid=PLATE, passive_void=HOLE)
    p = design_problem(scene, 1.0, points=points)
    solid, void = (points.volume[region.contains(points.x)].sum() for region in (PLATE, HOLE))
    assert solid == 2.0 and 0 < void < 4
    rho = p.evaluate(p.x0).rho
    assert points.volume @ rho == pytest.approx(0.4 * (32 - void), rel=1e-13)
    assert p.x0[0] == pytest.approx((0.4 * (32 - void) - solid) / (32 - void - solid), rel=1e-13)
    x, volume = points.x[p.space.active], points.volume[p.space.active]
    weight = volume * np.maximum(0, 1.5 - np.linalg.norm(x[:, None] - x, axis=-1))
    design = random_design(p)
    np.testing.assert_allclose(p.filter(design)[p.space.active], weight @ design / weight.sum(axis=1), rtol=1e-14)


@FILTERS
@pytest.mark.parametrize(
    ("objective", "rule"),
    [(OBJECTIVES[0], GCMMA()), (OBJECTIVES[0], MMA()), (OBJECTIVES[0], OptimalityCriteria()), (OBJECTIVES[1], GCMMA())],
    ids=str,
)
def test_optimisation_never_changes_what_is_passive(
    objective: Compliance | PNormStress, rule: UpdateRule, filter_passive: bool
) -> None:
    p = problem(objective=objective, filter_passive=filter_passive)
    objectives = []
    for iterate in optimize(p, rule, max_iterations=10, stop=lambda history: False):
        rho = iterate.evaluation.rho
        assert np.all(rho[p.space.solid] == 1) and np.all(rho[p.space.void] == 0)
        assert iterate.x.shape == (104,) and np.all((iterate.x >= p.lower) & (iterate.x <= 1))
        objectives.append(iterate.objective)
    assert len(objectives) == 11
    assert objectives[-1] < 0.8 * objectives[0] and iterate.constraints[0] < 1e-3


def test_positions_on_the_design_grid_decide() -> None:
    """Points that have moved into or out of a region stay what their leaf is."""
    grid = problem().model.points
    scene = cantilever(passive_solid=PLATE, passive_void=HOLE)
    moved = discretise(scene.body, 1.0, points=grid.moved((0.3, 0.0)))
    np.testing.assert_array_equal(DesignProblem(moved, scene.design, design_grid=grid).space.void, problem().space.void)
    assert np.any(DesignProblem(moved, scene.design).space.void != problem().space.void)


def test_fingerprint_includes_what_is_passive() -> None:
    every = [
        problem(),
        problem(filter_passive=True),
        problem(void=None),
        problem(solid=None),
        problem(void=None, solid=None),
        problem(void=Circle((3, 2), 1.1)),
        problem(solid=HOLE, void=PLATE, loads=(PointLoad((8, 1), (0, -1), 1),)),
        problem(solid=PLATE, void=HOLE, loads=(PointLoad((8, 1), (0, -1), 1),)),
    ]
    assert len({p.fingerprint for p in every}) == len(every)
    assert problem().fingerprint == problem(filter_passive=False).fingerprint


def test_plan_counts_the_variables() -> None:
    assert "design variables: 104 of 128 points; 8 are passive solid, 16 passive void" in plan(problem())
    assert "design variables: 128 of 128 points; none is passive" in plan(problem(solid=None, void=None))


def test_any_densities_may_be_analysed() -> None:
    p = problem()
    everywhere = p.analyse(np.full(128, 0.5))
    assert everywhere.constraints[0] == pytest.approx(0.5 * 128 / (0.4 * 112) - 1, rel=1e-14)
    with pytest.raises(ValueError, match="for 128 points"):
        p.analyse(p.x0)


@pytest.mark.parametrize(
    ("changes", "error", "advice"),
    [
        ({"passive_solid": BODY}, EmptyDomain, "nothing to design"),
        (
            {"passive_solid": HOLE, "passive_void": Difference(BODY, HOLE), "loads": ()},
            EmptyDomain,
            "nothing to design",
        ),
        (
            {"passive_solid": Rectangle((0, 0), (3.3, 4)), "passive_void": HOLE},
            InvalidScene,
            "one region out of the other",
        ),
        ({"passive_solid": Rectangle((0, 0), (3.5, 4))}, InvalidScene, "raise it, or shrink"),
        ({"passive_solid": Rectangle((0, 0), (3, 4)), "rho_min": 0.1}, InvalidScene, "raise it, or shrink"),
        ({"passive_void": Rectangle((7.6, 0), (8, 1.9))}, LoadOutsideBody, "lower its `points`"),
        ({"passive_void": HOLE, "loads": (RegionLoad(BODY, (0, -1)),)}, LoadOutsideBody, "would carry a part"),
    ],
)
def test_problems_refuse(changes: dict, error: type[Exception], advice: str) -> None:
    if changes.get("loads") == ():
        changes = changes | {"loads": (PointLoad((4, 2), (0, -1), 1),)}
    scene = cantilever(**changes)
    model = discretise(scene.body, 1.0)
    with pytest.raises(error, match=advice):
        DesignProblem(model, scene.design)


def test_feasible_to_the_last_point() -> None:
    """Solid at the bound itself leaves the least density; a load on the void's edge is on material."""
    p = problem(solid=Rectangle((0, 0), (3, 4)), void=None, volume_fraction=0.375, rho_min=0.0)
    np.testing.assert_allclose(p.x0, 0, atol=1e-15)
    edge: Scene = cantilever(passive_void=HOLE, loads=(PositionLoad((4, 3.1), (0, -1)),))
    assert np.isfinite(design_problem(edge, 1.0).evaluate(np.full(112, 0.5)).objective)
