"""Passive regions on finite elements: no variables, densities that stay, and a void that is as good as absent."""

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.criteria import Compliance, PNormStress
from mpmtop.errors import EmptyDomain, InvalidScene, LoadOutsideBody
from mpmtop.filter import DesignSpace, passive_filter
from mpmtop.loads import PointLoad, PositionLoad, RegionLoad
from mpmtop.optimizers import GCMMA, optimize
from mpmtop.points import MaterialPoints
from mpmtop.region import Circle, Difference, Rectangle, Region
from mpmtop.scene import Scene
from reference_fem.hole import around_hole
from reference_fem.simp import DesignProblem, design_problem
from tests.scenes import cantilever
from validation.bodies.scenes import changed
from validation.measures.derivatives import taylor_orders
from validation.oracles.woodbury import State, exact_derivatives, finite_elements

BODY = Rectangle((0, 0), (8, 4))
HOLE = Circle((4, 2), 1.1)
PLATE = Rectangle((6, 3), (8, 4))
EVERY = pytest.mark.parametrize("objective", [Compliance(), PNormStress(p=8.0, q=0.5)], ids=["compliance", "p-norm"])
FILTERS = pytest.mark.parametrize("filter_passive", [False, True], ids=["active only", "over passive"])


def problem(
    solid: Region | None = PLATE, void: Region | None = HOLE, filter_passive: bool = False, **changes: object
) -> DesignProblem:
    """The 8 x 4 cantilever of 128 elements; by default 16 void ones in the hole and 8 solid ones above the load."""
    scene = cantilever(passive_solid=solid, passive_void=void, **changes)  # type: ignore[arg-type]
    return design_problem(scene, 0.5, filter_passive=filter_passive)


def design(p: DesignProblem, seed: int = 0) -> Array:
    return np.random.default_rng(seed).uniform(0.2, 0.8, len(p.x0))


@FILTERS
def test_passive_elements_are_fixed_and_no_variables(filter_passive: bool) -> None:
    p = problem(filter_passive=filter_passive)
    solid, void = PLATE.contains(p.model.centres), HOLE.contains(p.model.centres)
    assert (solid.sum(), void.sum()) == (8, 16)
    active = ~(solid | void)
    at = p.evaluate(design(p))
    assert np.all(at.rho[solid] == 1) and np.all(at.rho[void] == 0)
    assert np.all((at.rho[active] > 0) & (at.rho[active] < 1))
    gradient = p.gradient(at)
    assert p.x0.shape == p.lower.shape == p.upper.shape == gradient[0].shape == gradient[1][0].shape == (104,)
    assert np.array_equal(p.space.active, np.flatnonzero(active))


@FILTERS
def test_filter_is_that_of_the_material_points(filter_passive: bool) -> None:
    """The filter of the other solver, which is code of its own, on the same centres: areas unequal, as on a mesh."""
    scene = cantilever(
        domain=Difference(BODY, Circle((2, 2), 1)), passive_solid=PLATE, passive_void=Circle((5, 2), 0.7)
    )
    p = design_problem(scene, mesh=around_hole((0, 0), (8, 4), (2, 2), 1.0, 0.5), filter_passive=filter_passive)
    model, space = p.model, DesignSpace(p.space.solid, p.space.void)
    points = MaterialPoints(model.centres, model.area, np.ones_like(model.centres))
    other = passive_filter(points, scene.design.filter_radius, space, over_passive=filter_passive)
    assert (
        np.ptp(model.area) > 0.1 and 0 < len(space.active) < len(model.area) and space.solid.any() and space.void.any()
    )
    # sums of tens of weights, in another order
    np.testing.assert_allclose(p.H.toarray(), other.matrix.toarray(), rtol=0, atol=1e-15)
    assert other.offset is not None
    np.testing.assert_allclose(p.space.fixed, other.offset, rtol=0, atol=1e-15)


@EVERY
@FILTERS
def test_gradient_is_that_of_a_complex_step(objective: Compliance | PNormStress, filter_passive: bool) -> None:
    """By every density, those at 0 and 1 included, and by every variable; the constraint is affine."""
    p = problem(filter_passive=filter_passive, objective=objective)
    x = design(p)
    at = p.evaluate(x)
    exact = exact_derivatives(State.at(finite_elements(p), at.rho))
    # rounding times the condition number of a body with a hole of contrast 1e-9, whose strains are large
    np.testing.assert_allclose(p.density_gradient(at), exact, rtol=0, atol=1e-9 * np.abs(exact).max())
    df0, dg = p.gradient(at)
    for k in (0, 40, 103):  # the map from design to densities, column by column
        unit = np.where(np.arange(104) == k, 0.25, 0)
        moved = p.evaluate(x + unit)
        by_x = exact @ (moved.rho - at.rho) / 0.25
        assert df0[k] == pytest.approx(by_x, rel=0, abs=1e-8 * np.abs(df0).max())  # the same, over a step of 0.25
        assert moved.constraints - at.constraints == pytest.approx(0.25 * dg[:, k], abs=1e-14)


@EVERY
@FILTERS
def test_gradient_has_a_second_order_remainder(objective: Compliance | PNormStress, filter_passive: bool) -> None:
    """Taylor test, this solver alone."""
    p = problem(filter_passive=filter_passive, objective=objective)
    x, d = design(p), design(p, seed=1) - 0.5
    slope = p.gradient(p.evaluate(x))[0] @ d
    order = taylor_orders(lambda x: p.evaluate(x).objective, x, d, slope, (4e-3, 2e-3))
    assert order == pytest.approx(2, abs=0.05)  # the third-order term: p times t


@EVERY
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("contrast", [1e-6, 1e-12])
def test_void_is_absence_to_the_contrast(objective: Compliance | PNormStress, contrast: float, order: int) -> None:
    """Objective, gradient, volume and displacements of a passive void, and of a domain without it."""
    hole = Circle((3.3, 1.7), 1.45)
    scene = cantilever(passive_void=hole, contrast=contrast, objective=objective)
    void = design_problem(scene, 0.5, order)
    absent = design_problem(changed(scene, domain=Difference(BODY, hole), passive_void=None), 0.5, order)
    assert np.array_equal(void.model.centres[void.space.active], absent.model.centres)
    assert void.x0 == pytest.approx(absent.x0, rel=1e-14)
    x = design(void)
    a, b = void.evaluate(x), absent.evaluate(x)
    np.testing.assert_allclose(a.rho[void.space.active], b.rho, rtol=1e-14)  # the order of a sum
    # the void's part of the stiffness, at most contrast / 0.2^3 of its neighbours', times its part of the energy; and
    # rounding, 1e-16 times the condition number: 1e5, or 1e12 at a contrast of 1e-12, of which little is excited
    tol = 125 * contrast + 1e-10
    assert a.objective == pytest.approx(b.objective, rel=tol)
    assert a.constraints == pytest.approx(b.constraints, abs=1e-14)
    (df0, dg), (expected, expected_dg) = void.gradient(a), absent.gradient(b)
    np.testing.assert_allclose(df0, expected, rtol=0, atol=4 * tol * np.abs(expected).max())
    np.testing.assert_allclose(dg, expected_dg, rtol=1e-13)
    dof = {place: k for k, place in enumerate(places(void))}
    u = a.u[[dof[place] for place in places(absent)]]
    np.testing.assert_allclose(u, b.u, rtol=0, atol=tol * np.abs(b.u).max())


def places(p: DesignProblem) -> list[tuple[float, ...]]:
    """Position and component of every dof."""
    component = np.isin(np.arange(p.model.basis.N), p.model.basis.split_indices()[1])
    return [tuple(row) for row in np.column_stack([p.model.basis.doflocs.T, component])]


@FILTERS
def test_volume(filter_passive: bool) -> None:
    """Solid counts, void does not, in the sum as in the bound; the uniform start meets the constraint."""
    p = problem(filter_passive=filter_passive)
    start = p.evaluate(p.x0)
    assert start.constraints[0] == pytest.approx(0, abs=1e-14)
    assert np.ptp(p.x0) == 0
    assert 0.25 * start.rho.sum() == pytest.approx(0.4 * 0.25 * 112, rel=1e-14)
    if not filter_passive:
        assert p.x0[0] == pytest.approx((0.4 * 112 - 8) / 104, rel=1e-14)
    assert p.analyse(np.full(128, 0.5)).constraints[0] == pytest.approx(0.5 * 128 / (0.4 * 112) - 1, rel=1e-14)


def test_start_on_unequal_elements() -> None:
    """Areas count, not elements."""
    scene = cantilever(domain=Difference(BODY, Circle((2, 2), 1)), passive_solid=PLATE)
    p = design_problem(scene, mesh=around_hole((0, 0), (8, 4), (2, 2), 1.0, 0.5))
    area = p.model.area
    assert area[p.space.solid].sum() == pytest.approx(2, rel=1e-14)
    assert p.x0[0] == pytest.approx((0.4 * area.sum() - 2) / (area.sum() - 2), rel=1e-13)
    assert p.evaluate(p.x0).constraints[0] == pytest.approx(0, abs=1e-14)


@FILTERS
@EVERY
def test_optimisation_never_changes_what_is_passive(objective: Compliance | PNormStress, filter_passive: bool) -> None:
    p = problem(filter_passive=filter_passive, objective=objective)
    objectives = []
    for iterate in optimize(p, GCMMA(), max_iterations=10, stop=lambda history: False):
        rho = iterate.evaluation.rho
        assert np.all(rho[p.space.solid] == 1) and np.all(rho[p.space.void] == 0)
        objectives.append(iterate.objective)
    assert iterate.x.shape == (104,) and iterate.constraints[0] < 1e-3
    assert objectives[-1] < 0.8 * objectives[0]


def test_fingerprint_includes_what_is_passive() -> None:
    edge = (PointLoad((8, 1), (0, -1), 1),)
    every = [
        problem(),
        problem(filter_passive=True),
        problem(None, filter_passive=True),
        problem(None),
        problem(void=None),
        problem(None, None),
        problem(void=Circle((3, 2), 1.1)),
        problem(HOLE, PLATE, loads=edge),
        problem(PLATE, HOLE, loads=edge),
    ]
    assert len({p.fingerprint for p in every}) == len(every)
    assert problem().fingerprint == problem().fingerprint


LOAD = (PointLoad((4, 2), (0, -1), 1),)


@pytest.mark.parametrize(
    ("changes", "error", "advice"),
    [
        ({"passive_solid": BODY}, EmptyDomain, "something to design"),
        ({"passive_solid": HOLE, "passive_void": Difference(BODY, HOLE), "loads": LOAD}, EmptyDomain, "to design"),
        ({"passive_solid": Rectangle((0, 0), (3.3, 4)), "passive_void": HOLE}, InvalidScene, "out of the other"),
        ({"passive_solid": Rectangle((0, 0), (3.5, 4))}, InvalidScene, "raise it, or shrink"),
        ({"passive_solid": Rectangle((0, 0), (3, 4)), "rho_min": 0.1}, InvalidScene, "raise it, or shrink"),
        ({"passive_void": Rectangle((7.6, 0), (8, 1.9))}, LoadOutsideBody, "lower its `points`"),
        ({"passive_void": HOLE, "loads": (RegionLoad(BODY, (0, -1)),)}, LoadOutsideBody, "would carry a part"),
    ],
)
def test_problems_refuse(changes: dict, error: type[Exception], advice: str) -> None:
    with pytest.raises(error, match=advice):
        design_problem(cantilever(**changes), 0.5)


def test_densities_of_a_design_are_not_those_of_elements() -> None:
    p = problem()
    with pytest.raises(ValueError, match="for 128 elements"):
        p.analyse(p.x0)


def test_feasible_to_the_last_element() -> None:
    """Solid at the bound itself leaves the least density; a load on the void's edge is on material."""
    p = problem(Rectangle((0, 0), (3, 4)), None, volume_fraction=0.375, rho_min=0.0)
    assert p.x0 == pytest.approx(0, abs=1e-15)
    edge: Scene = cantilever(passive_void=HOLE, loads=(PositionLoad((4, 3.1), (0, -1)),))
    assert np.isfinite(design_problem(edge, 0.5).evaluate(np.full(112, 0.5)).objective)
