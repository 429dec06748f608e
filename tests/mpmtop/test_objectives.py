"""The p-norm of stress: closed forms, limits, scaling and its gradient through the adjoint."""

from functools import partial
from typing import Any, Literal

import numpy as np
import pytest

from mpmtop import fields
from mpmtop.arrays import Array
from mpmtop.body import Body, Material, Support
from mpmtop.criteria import Compliance, PNormStress, StressMeasure
from mpmtop.design import Design
from mpmtop.equilibrium import adjoint, equilibrium, moduli_gradient
from mpmtop.errors import InvalidScene
from mpmtop.loads import PointLoad, PositionLoad
from mpmtop.material import von_mises, von_mises_form
from mpmtop.model import discretise
from mpmtop.objectives import p_norm_stress, p_norm_stress_derivative
from mpmtop.problem import DesignProblem, design_problem
from mpmtop.region import Difference, Rectangle
from mpmtop.scene import Scene
from mpmtop.shape_functions import ShapeFunction, tent
from mpmtop.solvers import BandedCholesky, MultigridCG
from tests.scenes import LEFT_CLAMP, SHAPE_FUNCTIONS, cantilever
from validation.measures.derivatives import taylor_orders

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # bodies are moved and cut on purpose

ALL = pytest.mark.parametrize("shape_function", SHAPE_FUNCTIONS, ids=lambda f: f.__name__)


def problem(objective: PNormStress, shape_function: ShapeFunction = tent, shift: float = 0.0) -> DesignProblem:
    scene = cantilever(objective=objective)
    points = discretise(scene.body, 1.0).points.moved((shift, 0.0))
    return design_problem(scene, 1.0, points=points, shape_function=shape_function)


def density(seed: int) -> Array:
    return np.random.default_rng(seed).uniform(0.2, 1.0, 128)


@ALL
@pytest.mark.parametrize("shift", [0.0, 0.3])
@pytest.mark.parametrize(
    "objective",
    [PNormStress(12.0), PNormStress(60.0), PNormStress(12.0, measure="von_mises_in_plane")],
    ids=["p=12", "p=60", "in plane"],
)
def test_gradient_has_a_second_order_remainder(
    shape_function: ShapeFunction, shift: float, objective: PNormStress
) -> None:
    """Taylor test at a random density and direction, without and with crossing."""
    design = problem(objective, shape_function, shift)
    rho, d = density(0), np.random.default_rng(1).uniform(-0.1, 0.1, 128)
    at = design.analyse(rho)
    slope = design.density_gradient(at) @ d
    order = taylor_orders(lambda rho: design.analyse(rho).objective, rho, d, slope, (1e-3, 1e-4))
    assert order == pytest.approx(2, abs=0.05)  # the third-order term at t = 1e-4


def test_uniform_stress_in_closed_form() -> None:
    """A bar in uniaxial plane stress: every point carries the unit stress, so J = (points)^(1/p) rho^(q - penal)."""
    ends = tuple(PositionLoad((6.0, float(j)), (1.0 if 0 < j < 3 else 0.5, 0.0)) for j in range(4))
    rollers = (Support(LEFT_CLAMP.region, (True, False)), Support(Rectangle((0, 0), (0, 0)), (False, True)))
    scene = cantilever(
        6, 3, supports=rollers, loads=ends, material=Material(2.0, 0.25, "stress"), objective=PNormStress(12, 0.5)
    )
    design = design_problem(scene, 1.0)
    for rho in (1.0, 0.5):
        value = design.analyse(np.full(72, rho)).objective
        assert value == pytest.approx(72 ** (1 / 12) * rho ** (0.5 - 3), rel=1e-8)  # the contrast, 1e-9 over rho^3


@pytest.mark.parametrize("p", [12.0, 60.0, 100.0])
@pytest.mark.parametrize("force", [1e-30, 1.0, 1e30])
def test_neither_overflow_nor_underflow(p: float, force: float) -> None:
    """J lies between the largest relaxed stress and points^(1/p) of it, whatever the unit of force."""
    scene = cantilever(load=PointLoad((8, 2), (0, -force)), objective=PNormStress(p))
    design = design_problem(scene, 1.0)
    at = design.analyse(density(2))
    unit = problem(PNormStress(p)).analyse(density(2))
    assert at.objective == pytest.approx(force * unit.objective, rel=1e-10)
    gradient = design.density_gradient(at)
    assert np.all(np.isfinite(gradient)) and np.any(gradient != 0)
    vm = von_mises(at.state.strain @ design.model.D, scene.body.material)
    largest = np.max(np.sqrt(density(2)) * vm)
    assert largest <= at.objective <= 128 ** (1 / p) * largest * (1 + 1e-12)


def test_points_without_stress_or_density_do_no_harm() -> None:
    """A load between the clamp and a free end leaves the end without stress; some densities are zero, too."""
    scene = cantilever(load=PositionLoad((4.0, 2.0), (0.0, -1.0)), objective=PNormStress(), rho_min=0.0)
    design = design_problem(scene, 1.0)
    rho = np.where(np.random.default_rng(3).random(128) < 0.2, 0.0, 1.0)
    at = design.analyse(rho)
    assert np.isfinite(at.objective)
    assert np.all(np.isfinite(design.density_gradient(at)))


def test_stress_does_not_depend_on_the_modulus() -> None:
    soft, stiff = (
        design_problem(cantilever(material=Material(E0, 0.3), objective=PNormStress()), 1.0) for E0 in (1e-6, 1e12)
    )
    a, b = soft.analyse(density(4)), stiff.analyse(density(4))
    assert a.objective == pytest.approx(b.objective, rel=1e-10)  # rounding times condition number
    np.testing.assert_allclose(soft.density_gradient(a), stiff.density_gradient(b), rtol=0, atol=1e-9 * a.objective)


@pytest.mark.parametrize("measure", ["von_mises", "von_mises_in_plane"])
@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_von_mises_form(plane: Literal["strain", "stress"], measure: StressMeasure) -> None:
    """The quadratic form, the formula and the one of exported fields, by the same name, are one."""
    material = Material(1.0, 0.3, plane)
    stress = np.random.default_rng(5).normal(size=(50, 3))
    vm = np.sqrt(np.einsum("pa,ab,pb->p", stress, von_mises_form(material, measure), stress))
    np.testing.assert_allclose(vm, von_mises(stress, material, measure), rtol=1e-13)
    zz = 0.3 * (stress[:, 0] + stress[:, 1]) * (plane == "strain")
    np.testing.assert_allclose(vm, getattr(fields, measure)(fields.tensor(stress, zz)), rtol=1e-13)


def test_measure_in_the_plane_is_larger_under_pressure() -> None:
    """vm^2 with sigma_zz = nu s, s = sx + sy, is that without it less nu (1 - nu) s^2: in plane strain a bar's end
    that cannot contract has less von Mises stress than its components in the plane. In plane stress they are one."""
    for plane, less in (("strain", True), ("stress", False)):
        of = [
            design_problem(cantilever(material=Material(1.0, 0.3, plane), objective=PNormStress(measure=measure)), 1.0)
            for measure in ("von_mises", "von_mises_in_plane")
        ]
        with_zz, without = (each.analyse(density(6)).objective for each in of)
        assert (with_zz < without) if less else (with_zz == without)


def test_measure_is_checked() -> None:
    with pytest.raises(InvalidScene, match="give one of von_mises, von_mises_in_plane"):
        PNormStress(measure="tresca")  # type: ignore[arg-type]


def test_l_bracket_start() -> None:
    """11.850 F/h at uniform 0.4: an independent prototype of the 6,400-point bracket, to the digits given."""
    domain = Difference(Rectangle((0, 0), (50, 50)), Rectangle((20, 20), (50, 50)))
    top = Support(Rectangle((-np.inf, 50), (np.inf, np.inf)))
    load = PointLoad((50, 20), (0, -1))
    scene = Scene("L", Body(domain, (top,), (load,)), Design(0.4, 1.0), PNormStress())
    design = design_problem(scene, 1.0)
    assert len(design.x0) == 6400
    assert design.evaluate(design.x0).objective == pytest.approx(11.850, abs=5e-4)


def test_exponents_are_checked() -> None:
    for p in (0.5, np.inf, np.nan):
        with pytest.raises(InvalidScene, match="exponent"):
            PNormStress(p)
    for q in (-1, np.nan):
        with pytest.raises(InvalidScene, match="relaxation"):
            PNormStress(12, q)
    assert cantilever().objective == Compliance()


@pytest.mark.parametrize("contrast", [1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("solver", [partial(MultigridCG, coarsest=20), BandedCholesky], ids=["multigrid", "direct"])
def test_gradient_where_void_carries_the_load(contrast: float, solver: Any) -> None:
    """The p-norm goes with 1 / E if all moduli do: sum E dJ/dE = -J. An adjoint by multigrid to a residual of 1e-6, and
    no more, misses a tenth of it: the soft mode of the loaded end."""
    scene = cantilever(5, 2, objective=PNormStress(), contrast=contrast)
    model = discretise(scene.body, 1.0, solver=solver)
    rho = np.where(np.floor(model.points.x[:, 0]) == 2, 0.0, 1.0)
    moduli = contrast + rho * (1 - contrast)
    state = equilibrium(model, moduli)
    value = p_norm_stress(model, state, rho, p=12, q=0.5)
    by = p_norm_stress_derivative(model, state, rho, p=12, q=0.5)
    by_moduli = moduli_gradient(model, state, adjoint(model, state, by))
    # the tolerance of multigrid, or rounding: 1e-16 over the contrast
    assert moduli @ by_moduli == pytest.approx(-value, rel=1e-5)
