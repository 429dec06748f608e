"""Total Lagrangian finite elements: against points at Gauss points, the elastica, and difference quotients."""

from dataclasses import replace

import numpy as np
import pytest

from mpmtop.body import Body, Material, Spring, Support
from mpmtop.errors import InvalidScene, NotConverged
from mpmtop.grid import Grid
from mpmtop.large_deformation.law import Hencky, Law, NeoHookean
from mpmtop.large_deformation.model import discretise as discretise_points
from mpmtop.large_deformation.objectives import EndCompliance, PathCompliance, gradient
from mpmtop.large_deformation.steps import trajectory
from mpmtop.loads import PositionLoad, RegionLoad, Weight
from mpmtop.points import seed, to_gauss_points
from mpmtop.region import Rectangle
from mpmtop.shape_functions import tent
from reference_fem.boundary import nodal_forces
from reference_fem.elasticity import discretise
from reference_fem.large_deformation import (
    LargeModel,
    LogarithmicLaw,
    NeoHookeanLaw,
    PrincipalLaw,
    large_model,
    load_steps,
    with_load,
)
from reference_fem.large_design import WeightedCompliance
from tests.mpmtop.large_deformation.cases import cantilever
from validation.bodies.large import elastica
from validation.measures.derivatives import central_difference

LAWS = pytest.mark.parametrize(
    ("law", "principal"), [(Hencky(0.3), LogarithmicLaw(0.3)), (NeoHookean(0.3), NeoHookeanLaw(0.3))]
)


def loaded(principal: PrincipalLaw, x: np.ndarray, force: np.ndarray) -> LargeModel:
    """Elements of 2 x 2 on the cantilever, under forces (k, 2) at positions x (k, 2)."""
    model = large_model(discretise(cantilever(), 2.0), principal)
    return with_load(model, nodal_forces(model.fem.basis, x, force))


def compliance(
    model: LargeModel, moduli: np.ndarray, u: list[np.ndarray], weights: tuple[float, ...]
) -> tuple[float, np.ndarray]:
    """sum_n w_n f . u_n and its derivative by the moduli (e,), one adjoint for each level."""
    objective = WeightedCompliance(weights)
    by_moduli = np.zeros(len(moduli))
    for u_n, w in zip(u, weights, strict=True):
        T, D, _ = model.respond(u_n)
        by_moduli -= model.work(T, model.solve(moduli, D, w * model.fem.f_ext))
    return objective.value(model, moduli, moduli, u), by_moduli


@LAWS
def test_points_at_gauss_points_are_the_bilinear_element(law: Law, principal: PrincipalLaw) -> None:
    """Six steps to a deflection of a third of the length: displacements at the nodes, and gradients of end and path."""
    scene = cantilever(0.15)
    points = to_gauss_points(seed(scene.domain, (1.0, 1.0)))
    how = {"steps": 6, "frame": "total", "alpha": 0.0, "law": law, "grid": Grid((0, 0), (2, 2), (10, 5))}
    body = discretise_points(scene, shape_function=tent, points=points, **how)  # type: ignore[arg-type]
    rng = np.random.default_rng(0)
    moduli = rng.uniform(0.3, 1, 50)  # of the elements
    element = np.ravel_multi_index((points.x // 2).astype(int).T, (10, 5))
    path = trajectory(body, moduli[element], tol=1e-13)

    carriers = np.any(body.force != 0, axis=1)
    model = loaded(principal, points.x[carriers], body.force[carriers])
    order = np.ravel_multi_index((model.fem.centres // 2).astype(int).T, (10, 5))
    levels = np.arange(1, 7) / 6
    found = list(load_steps(model, moduli[order], levels, tol=1e-13))
    node = np.rint(model.basis.mesh.p.T / 2).astype(int)
    total = np.zeros((66, 2))
    for step, u in zip(path.increments, found, strict=True):
        total += step.u
        expected = total[np.ravel_multi_index(node.T, (11, 6))]
        np.testing.assert_allclose(u[model.basis.nodal_dofs].T, expected, atol=1e-12 * 20)
    assert found[-1].min() < -0.3 * 20
    for objective, weights in ((EndCompliance(), [0.0] * 5 + [1.0]), (PathCompliance(), 1 / (6 * levels))):
        J, by_element = compliance(model, moduli[order], found, tuple(weights))
        assert objective.value(body, path, moduli) == pytest.approx(J, rel=1e-12)
        by_point = np.bincount(element, gradient(objective, body, path, np.ones(200))[1])
        np.testing.assert_allclose(by_element, by_point[order], atol=1e-11 * np.abs(by_point).max())


@LAWS
@pytest.mark.parametrize("order", [1, 2])
def test_tangent_and_gradient_are_derivatives(law: Law, principal: PrincipalLaw, order: int) -> None:
    model = large_model(discretise(cantilever(0.1), 2.0, order), principal)
    rng = np.random.default_rng(1)
    moduli, u, free = rng.uniform(0.5, 1, 50), 0.1 * rng.standard_normal(model.basis.N), model.fem.free
    du = np.zeros(model.basis.N)
    du[free] = 0.1 * rng.standard_normal(len(free))
    quotient = central_difference(lambda u: model.residual(moduli, u), u, du, 1e-6)[free]
    K = model.tangent(moduli, model.respond(u)[1])
    np.testing.assert_allclose(K @ du[free], quotient, atol=1e-8)  # h^2, and rounding / h
    weights, levels, dE = (0.4, 1.0), np.array([0.5, 1.0]), rng.standard_normal(50)

    def J(E: np.ndarray) -> float:
        return compliance(model, E, list(load_steps(model, E, levels)), weights)[0]

    exact = compliance(model, moduli, list(load_steps(model, moduli, levels)), weights)[1]
    assert exact @ dE == pytest.approx(central_difference(J, moduli, dE, 1e-4), rel=1e-5)


def test_biquadratic_elements_follow_the_elastica() -> None:
    """L / d = 100, plane strain with nu = 0: P L^2 / EI = 1, 2, 5, 10. Shear and the stretch of the length are left."""
    L, d = 100.0, 1.0
    whole = 10 * (d**3 / 12) / L**2
    scene = Body(
        Rectangle((0, 0), (L, d)),
        (Support(Rectangle((0, 0), (0, d))),),
        (PositionLoad((L, d / 2), (0.0, -whole)),),
        Material(1.0, 0.0),
    )
    model = large_model(discretise(scene, (2.0, 1.0), 2), LogarithmicLaw(0.0))
    tip = np.flatnonzero(np.all(np.isclose(model.basis.doflocs.T, [L, d / 2]), axis=1))
    levels = np.array([0.1, 0.2, 0.5, 1.0])
    for level, u in zip(levels, load_steps(model, np.ones(50), levels), strict=True):
        along, across = elastica(10 * level)
        np.testing.assert_allclose(-u[tip] / L, [along, across], rtol=1e-3)


@pytest.mark.parametrize("order", [1, 2])
def test_place_units_and_size_of_the_load_change_nothing(order: int) -> None:
    """A load of 1e-14 of E bends as one of 1e-6 does, and a body far from the origin as one there."""
    clamp, tip = Rectangle((0.0, 0.0), (0.0, 10.0)), Rectangle((18.0, 3.0), (20.0, 7.0))

    def flexibility(load: float, at: float = 0.0, young: float = 1.0) -> float:
        def there(r: Rectangle) -> Rectangle:
            (x0, y0), (x1, y1) = r.lower, r.upper
            return Rectangle((x0 + at, y0 + at), (x1 + at, y1 + at))

        body = Body(
            there(Rectangle((0.0, 0.0), (20.0, 10.0))),
            (Support(there(clamp)),),
            (RegionLoad(there(tip), (0.0, -load * young)),),
            Material(young, 0.3),
        )
        model = large_model(discretise(body, 2.0, order), LogarithmicLaw(0.3))
        f = model.fem.f_ext
        u = list(load_steps(model, np.full(50, young), np.array([0.5, 1.0])))[-1]
        return float(f @ u / f.sum() / load)

    usual = flexibility(1e-6)
    assert flexibility(1e-14) == pytest.approx(usual, rel=1e-2)  # strains of 1e-13 are rounded by 2e-16 of F
    assert flexibility(1e-9, at=1e6) == pytest.approx(usual, rel=1e-6)
    assert flexibility(0.06, at=-1e6) == pytest.approx(flexibility(0.06), rel=1e-9)  # rounding of positions
    assert flexibility(0.06, young=1e9) == pytest.approx(flexibility(0.06), rel=1e-12)


def test_plane_stress_and_another_poisson_are_refused() -> None:
    fem = discretise(cantilever(), 2.0)
    with pytest.raises(InvalidScene, match="Poisson"):
        large_model(fem, LogarithmicLaw(0.2))
    with pytest.raises(InvalidScene, match="plane stress"):
        large_model(replace(fem, body=replace(fem.body, material=Material(1, 0.3, "stress"))), LogarithmicLaw(0.3))


def test_what_load_steps_do_not_have_is_refused() -> None:
    body = cantilever()
    for change in (
        {"loads": (*body.loads, Weight((0.0, -1.0)))},
        {"supports": (*body.supports, Spring((20.0, 5.0), 1.0, (0.0, 1.0)))},
    ):
        with pytest.raises(InvalidScene, match="small strain"):
            large_model(discretise(replace(body, **change), 2.0), LogarithmicLaw(0.3))


def test_load_without_equilibrium_is_named() -> None:
    """A dead load that pulls with the body's modulus: logarithmic elasticity softens before it bears that."""
    scene = replace(cantilever(), loads=(PositionLoad((20.0, 5.0), (10.0, 0.0)),))
    model = large_model(discretise(scene, 10.0), LogarithmicLaw(0.3))
    with pytest.raises(NotConverged, match=r"load level 1 of 1: Newton's method fails from 0\.[0-9]+ on"):
        list(load_steps(model, np.ones(2), np.array([1.0])))
