"""p-norm stress on finite elements: closed forms, identities, differences, extreme exponents; the judge's stress."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from mpmtop.arrays import Array
from mpmtop.body import Body, Material, Support
from mpmtop.criteria import Compliance, PNormStress, StressMeasure
from mpmtop.design import Design
from mpmtop.errors import InvalidScene
from mpmtop.loads import PointLoad, PositionLoad
from mpmtop.region import Difference, Rectangle
from mpmtop.scene import Scene
from reference_fem import elasticity
from reference_fem.adjoint import adjoint
from reference_fem.elasticity import gauss_points, strain_operator, von_mises
from reference_fem.factorise import Factorise, Solve
from reference_fem.objectives import STRESS_POSITIONS, StressPosition, p_norm
from reference_fem.reanalyse import build_judge, judge_stress
from reference_fem.simp import DesignProblem, design_problem
from tests.reference_fem.bodies import Plane, densities, planes
from tests.scenes import cantilever
from validation.measures.derivatives import central_difference, taylor_orders

variants = pytest.mark.parametrize("stress_at", ["centre", "gauss"])
measures = pytest.mark.parametrize("measure", ["von_mises", "von_mises_in_plane"])


def stressed(objective: PNormStress | None = None, force: float = 1.0, material: Material | None = None) -> Scene:
    """The 8 x 4 cantilever with the paper's p = 12, q = 0.5, or another p-norm."""
    load = PointLoad((8.0, 2.0), (0.0, -force))
    return cantilever(load=load, objective=objective or PNormStress(), material=material or Material())


def bar(plane: Plane = "stress", sides: int = 2) -> Scene:
    """8 x 2 bar under uniaxial stress 3: forces at the two Gauss points of each of the element sides at its end."""
    y = ((np.arange(sides)[:, None] + 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3)) * 2 / sides).ravel()
    body = Body(
        Rectangle((0, 0), (8, 2)),
        (Support(Rectangle((0, 0), (0, 2)), (True, False)), Support(Rectangle((0, 0), (0, 0)))),
        tuple(PositionLoad((8.0, float(b)), (3.0 / sides, 0.0)) for b in y),
        Material(5.0, 0.3, plane),
    )
    return Scene("bar", body, Design(0.4, 0.5), PNormStress())


# --- value ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [1, 2])
@planes
@variants
def test_uniform_bar_in_closed_form(stress_at: StressPosition, plane: Plane, order: int) -> None:
    """N^(1/p) rho^q sigma E0/E(rho), on sigma for plane stress; sigma_zz = nu sigma makes it sqrt(1 - nu + nu^2)."""
    problem = design_problem(bar(plane), 1.0, order, stress_at)
    vm = 3.0 * (np.sqrt(1 - 0.3 + 0.09) if plane == "strain" else 1.0)
    for rho in (1.0, 0.5):
        modulus = 1e-9 + rho**3 * (1 - 1e-9)
        expected = 16 ** (1 / 12) * rho**0.5 * vm / modulus
        # rounding 1e-16 times the condition number, 1e4
        assert problem.analyse(np.full(16, rho)).objective == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("order", [1, 2])
@measures
@planes
@variants
def test_value_from_stresses(stress_at: StressPosition, plane: Plane, measure: StressMeasure, order: int) -> None:
    """The operators give what the stresses of `elasticity.stress` give by Eq. (9), sigma_zz among them or not."""
    material = Material(5.0, 0.3, plane)
    problem = design_problem(stressed(PNormStress(measure=measure), material=material), 1.0, order, stress_at)
    rho = densities(32)
    evaluation = problem.analyse(rho)
    reference = STRESS_POSITIONS[stress_at](problem.model)
    vm = von_mises(elasticity.stress(problem.model, evaluation.u, np.full(32, 5.0), reference), measure)
    assert vm.shape == (32, 1 if stress_at == "centre" else (order + 1) ** 2)
    expected = np.sum(np.mean((rho[:, None] ** 0.5 * vm) ** 12, axis=1)) ** (1 / 12)
    assert evaluation.objective == pytest.approx(expected, rel=1e-13)  # sums of tens of numbers


def test_strain_operator_of_a_linear_displacement() -> None:
    """xx, yy and twice xy of the symmetric gradient at every position; nothing from a rotation."""
    model = elasticity.discretise(cantilever().body, (1.0, 0.5), 2)
    a = np.array([[1.0, 4.0], [-2.0, 5.0]])
    u = np.zeros(model.basis.N)
    for c, dofs in enumerate(model.basis.split_indices()):
        u[dofs] = a[c] @ model.basis.doflocs[:, dofs]
    strain = (strain_operator(model, gauss_points(model)) @ u).reshape(64, 9, 3)
    # coordinates of 8 over sides of 0.5: two digits of sixteen
    np.testing.assert_allclose(strain, np.broadcast_to([1, 5, 2], strain.shape), rtol=0, atol=1e-12)


@variants
def test_scaling(stress_at: StressPosition) -> None:
    """J(c f) = c J; the modulus E0 cancels. Forces far from one do not matter at p = 100, where s^p leaves doubles."""
    x = densities(32)

    def objective(force: float = 1.0, young: float = 1.0, p: float = 12.0) -> float:
        scene = stressed(PNormStress(p), force, Material(young))
        return design_problem(scene, 1.0, stress_at=stress_at).evaluate(x).objective

    # two solves of rounding 1e-16 times the condition number, 1e5 for these moduli
    assert objective(force=7.0) == pytest.approx(7 * objective(), rel=1e-11)
    assert objective(young=1e6) == pytest.approx(objective(), rel=1e-11)
    assert objective(force=1e8, p=100.0) == pytest.approx(1e8 * objective(p=100.0), rel=1e-11)
    assert objective(force=1e-8, p=100.0) == pytest.approx(1e-8 * objective(p=100.0), rel=1e-11)


def test_p_norm_of_numbers() -> None:
    """Weights count as multiplicity; no power leaves the range of doubles; nothing gives nothing."""
    # a few powers and sums in double precision
    assert p_norm(np.array([3.0, 4.0]), 2) == pytest.approx(5, rel=1e-14)
    weighted = p_norm(np.array([1.0, 2.0]), 12, np.array([3.0, 2.0]))
    assert weighted == pytest.approx(p_norm(np.array([1.0, 1, 1, 2, 2]), 12), rel=1e-14)
    assert p_norm(np.full(10, 1e200), 100) == pytest.approx(10**0.01 * 1e200, rel=1e-14)
    assert p_norm(np.full(10, 1e-200), 100) == pytest.approx(10**0.01 * 1e-200, rel=1e-14)
    assert p_norm(np.zeros(3), 12) == 0
    assert np.isnan(p_norm(np.array([1.0, np.nan]), 12))  # not hidden


@variants
def test_large_exponents_approach_the_maximum(stress_at: StressPosition) -> None:
    """max / g^(1/p) <= J <= max N^(1/p), g positions in each of N elements; the gradient is finite."""
    rho = densities(128)
    distance = []
    for p in (12.0, 60.0, 100.0):
        problem = design_problem(stressed(PNormStress(p)), 0.5, stress_at=stress_at)
        evaluation = problem.analyse(rho)
        positions = STRESS_POSITIONS[stress_at](problem.model)
        vm = von_mises(elasticity.stress(problem.model, evaluation.u, np.ones(128), positions))
        largest = np.max(rho[:, None] ** 0.5 * vm)
        ratio = evaluation.objective / largest
        # equality is possible but for rounding
        assert positions.shape[1] ** (-1 / p) * (1 - 1e-12) <= ratio <= 128 ** (1 / p) * (1 + 1e-12)
        distance.append(abs(np.log(ratio)))
        gradient = problem.density_gradient(evaluation)
        assert np.all(np.isfinite(gradient)) and np.any(gradient != 0)
    assert distance[2] < 0.02  # g^(1/100) - 1 = 1.4 %, less for one position and a largest stress alone
    if stress_at == "centre":
        assert distance[0] > distance[1] > distance[2]


# --- gradient ---------------------------------------------------------------------------------------------------------


def problems(
    stress_at: StressPosition, plane: Plane, order: int = 1, p: float = 12.0, measure: StressMeasure = "von_mises"
) -> DesignProblem:
    scene = stressed(PNormStress(p, 0.5, measure), material=Material(5.0, 0.3, plane))
    return design_problem(scene, 0.5, order, stress_at)


@pytest.mark.parametrize("order", [1, 2])
@planes
@variants
def test_gradient_has_a_second_order_remainder(stress_at: StressPosition, plane: Plane, order: int) -> None:
    problem = problems(stress_at, plane, order)
    x, d = densities(128), densities(128, seed=2) - 0.5
    slope = problem.gradient(problem.evaluate(x))[0] @ d
    order = taylor_orders(lambda x: problem.evaluate(x).objective, x, d, slope, (2e-3, 1e-3))
    assert order == pytest.approx(2, abs=0.05)  # the third-order term: t times p, over the densities


@measures
@planes
@variants
def test_gradient_by_central_differences(stress_at: StressPosition, plane: Plane, measure: StressMeasure) -> None:
    """Of fourth order, at variables of the largest, median and smallest derivative, and at the clamp."""
    problem = problems(stress_at, plane, measure=measure)
    rho = densities(128)
    at = problem.analyse(rho)
    gradient = problem.density_gradient(at)
    rank = np.argsort(np.abs(gradient))
    chosen = [rank[-1], rank[-2], rank[64], rank[0], 0]

    def central(h: float) -> Array:
        units = np.eye(128)[chosen]
        return np.array([central_difference(lambda rho: problem.analyse(rho).objective, rho, d, h) for d in units])

    h = 1e-3
    difference = (4 * central(h / 2) - central(h)) / 3
    # rounding of J, 1e-12 of it, over h; the truncation of order h^4 is no larger: halving h does not lower the sum
    np.testing.assert_allclose(gradient[chosen], difference, rtol=0, atol=4e-9 * at.objective)


@pytest.mark.parametrize("p", [12.0, 100.0])
@planes
@variants
def test_gradient_identities(stress_at: StressPosition, plane: Plane, p: float) -> None:
    """J is of degree one in u and q in rho: u . dJ/du = f . lambda = J, rho . dJ/drho = q J at fixed u."""
    problem = problems(stress_at, plane, p=p)
    at = problem.analyse(densities(128))
    by = problem.functional.derivative(problem.model, at.rho, at.u)
    assert by.rho is not None
    work = problem.model.f_ext @ adjoint(at.state, by)
    assert work == pytest.approx(at.objective, rel=1e-11)  # rounding times condition number
    assert at.rho @ by.rho == pytest.approx(0.5 * at.objective, rel=1e-13)


@variants
def test_one_factorisation(stress_at: StressPosition) -> None:
    """State and adjoint share it; a compliance gradient does not even solve."""
    for objective, expected in (
        (PNormStress(), ["factorise", "solve", "solve"]),
        (Compliance(), ["factorise", "solve"]),
    ):
        problem = design_problem(cantilever(objective=objective), 1.0, stress_at=stress_at)
        calls: list[str] = []

        def counted(
            K: sp.csc_matrix, factorise: Factorise = problem.model.factorise, calls: list[str] = calls
        ) -> Solve:
            solve = factorise(K)
            calls.append("factorise")

            def solve_counted(f: Array) -> Array:
                calls.append("solve")
                return solve(f)

            return solve_counted

        problem = replace(problem, model=replace(problem.model, factorise=counted))
        problem.gradient(problem.evaluate(problem.x0))
        assert calls == expected


@variants
@pytest.mark.parametrize("p", [12.0, 100.0])
def test_voids_do_no_harm(stress_at: StressPosition, p: float) -> None:
    """At rho = 0 the derivative is zero, as the objective says on the way there. A body of void has no stress, and the
    first density anywhere in it an infinite slope, that of rho^q, q < 1."""
    problem = design_problem(stressed(PNormStress(p)), 0.5, stress_at=stress_at)
    rho = densities(128)
    void = np.flatnonzero(np.abs(problem.model.centres - (4, 2)).max(axis=1) < 1)
    rho[void] = 0
    at = problem.analyse(rho)
    gradient = problem.density_gradient(at)
    assert np.all(gradient[void] == 0) and np.all(np.isfinite(gradient)) and np.abs(gradient).max() > 0
    step = np.where(np.arange(128) == void[5], 1e-2, 0)
    slope = (problem.analyse(rho + step).objective - at.objective) / 1e-2
    assert abs(slope) < 1e-2 * np.abs(gradient).max()  # q p >= 6: its stress is nothing; its modulus is 1e-6
    nothing = problem.analyse(np.zeros(128))
    assert nothing.objective == 0
    assert np.all(problem.density_gradient(nothing) == np.inf)


@variants
def test_unstressed_elements_do_no_harm(stress_at: StressPosition) -> None:
    """A body at rest beyond x = 4: no derivative there, the same finite ones elsewhere. At rest everywhere: zero."""
    problem = design_problem(stressed(), 0.5, stress_at=stress_at)
    at = problem.evaluate(densities(128))
    u = np.where(problem.model.basis.doflocs[0] < 4, at.u, 0)
    by = problem.functional.derivative(problem.model, at.rho, u)
    assert by.rho is not None
    still = problem.model.centres[:, 0] > 4
    assert np.all(by.rho[still] == 0) and np.all(by.rho[~still] > 0) and np.all(np.isfinite(adjoint(at.state, by)))
    assert problem.functional.value(problem.model, at.rho, 0 * u) == 0
    at_rest = problem.functional.derivative(problem.model, at.rho, 0 * u)
    assert at_rest.u is None and at_rest.rho is not None and np.all(at_rest.rho == 0)


# --- scenes and choices -----------------------------------------------------------------------------------------------


def l_bracket() -> Scene:
    """Arms 20 wide in a square of 50, clamped at the top, pulled down at the lower arm's upper right corner."""
    domain = Difference(Rectangle((0, 0), (50, 50)), Rectangle((20, 20), (50, 50)))
    body = Body(domain, (Support(Rectangle((0, 50), (50, 50))),), (PointLoad((50, 20), (0, -1)),))
    return Scene("L-bracket", body, Design(0.4, 1.0), PNormStress())


def test_l_bracket() -> None:
    """6,400 elements, the paper's number of material points; its start beside the material point method's 11.850.

    12.259 is 3.4 % more. The stress at the re-entrant corner is singular and decides the number, which therefore is a
    matter of resolution: elements of twice the size give 28 % less. Hence 5 % is agreement.
    """
    coarse, fine = (design_problem(l_bracket(), size) for size in (1.0, 0.5))
    start = fine.evaluate(fine.x0).objective
    assert len(fine.model.area) == 6400
    assert start == pytest.approx(11.850, rel=0.05)
    assert coarse.evaluate(coarse.x0).objective < 0.75 * start


def test_choice_of_positions() -> None:
    """Named at the edge, told apart by the fingerprint, refused if unknown."""
    scene = stressed()
    centre, gauss = (design_problem(scene, 1.0, stress_at=at) for at in ("centre", "gauss"))
    assert centre.fingerprint != gauss.fingerprint
    x = densities(32)
    assert centre.evaluate(x).objective < gauss.evaluate(x).objective  # bending is largest away from the centres
    with pytest.raises(InvalidScene, match="centre, gauss"):
        design_problem(scene, 1.0, stress_at="nodes")  # type: ignore[arg-type]


# --- the judge --------------------------------------------------------------------------------------------------------


@measures
def test_judge_at_one_element_per_point_is_the_objective(measure: StressMeasure) -> None:
    """On one bilinear element per point the p-norm is Eq. (9), as the problem has it."""
    scene = stressed(PNormStress(measure=measure))
    problem = design_problem(scene, 0.5)
    rho = densities(128)
    half = np.full((128, 2), 0.25)
    judge = build_judge(scene, problem.model.centres, half, split=1, order=1)
    judged = judge_stress(judge, rho, judge(rho))
    assert judged.p_norm == pytest.approx(problem.analyse(rho).objective, rel=1e-11)  # rounding times condition number
    assert judged.largest == judged.s.max() <= judged.p_norm
    compliance = judge_stress(replace(judge, objective=Compliance()), rho, judge(rho))
    assert (compliance.p_norm == judged.p_norm) == (measure == "von_mises")  # the defaults: the paper's p and q


@pytest.mark.parametrize("split", [1, 2, 3])
def test_judge_does_not_count_its_elements(split: int) -> None:
    """Uniform stress: the p-norm is N^(1/p) of it for N points on any mesh, also for points of two sizes."""
    coarse = np.stack(np.meshgrid(np.arange(4) + 0.5, [0.5, 1.5], indexing="ij"), -1).reshape(-1, 2)
    fine = np.stack(np.meshgrid(4.25 + 0.5 * np.arange(8), 0.25 + 0.5 * np.arange(4), indexing="ij"), -1).reshape(-1, 2)
    x, half = np.concatenate([coarse, fine]), np.repeat([[0.5, 0.5], [0.25, 0.25]], [8, 32], axis=0)
    judge = build_judge(bar(sides=4 * split), x, half, split)
    rho = np.ones(40)
    judged = judge_stress(judge, rho, judge(rho))
    assert judged.s.shape == (64 * split**2,)
    # rounding times the condition number, 1e5 on the finest mesh
    assert judged.largest == pytest.approx(3, rel=1e-10)
    assert judged.p_norm == pytest.approx(40 ** (1 / 12) * 3, rel=1e-10)


def test_judge_relaxes_by_the_owner() -> None:
    """s = rho^q vm with the density of the element's owner, and E0, not E, in vm."""
    scene = stressed(PNormStress(12.0, 0.7), material=Material(5.0))
    x = design_problem(scene, 1.0).model.centres
    judge = build_judge(scene, x, np.full((32, 2), 0.5))
    rho = densities(32)
    rho[3] = 0
    judgement = judge(rho)
    judged = judge_stress(judge, rho, judgement)
    vm = von_mises(elasticity.stress(judge.model, judgement.u, np.full(128, 5.0)))[:, 0]
    inside = np.abs(judge.model.centres[:, None] - x).max(axis=-1) < 0.5
    density = inside @ rho
    np.testing.assert_allclose(judged.s, density**0.7 * vm, rtol=1e-14)
    assert np.all(judged.s[inside[:, 3]] == 0)
    with pytest.raises(ValueError, match="32 points"):
        judge_stress(judge, rho[:-1], judgement)
