"""Bodies of several materials: closed forms, a plain loop, points at Gauss positions and Q1 elements, gradients."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve
from skfem import Basis, BilinearForm, ElementQuad0, ElementQuad1, ElementQuad2, ElementVector, condense
from skfem.helpers import ddot, eye, sym_grad, trace

from mpmtop import export
from mpmtop.arrays import Array
from mpmtop.body import Body, EdgeSupport, Material, Part, Spring, Support, elastic
from mpmtop.criteria import Compliance, Criterion, PNormStress, Response, Sensitivity
from mpmtop.design import Design, Mirror
from mpmtop.equilibrium import equilibrium
from mpmtop.errors import InvalidScene
from mpmtop.fields import von_mises
from mpmtop.large_deformation.model import discretise as in_load_steps
from mpmtop.loads import PointLoad, PositionLoad, Traction
from mpmtop.model import discretise
from mpmtop.optimizers import MMA, optimize
from mpmtop.planning import plan
from mpmtop.points import seed, to_gauss_points
from mpmtop.problem import DesignProblem
from mpmtop.region import Circle, Difference, Rectangle
from mpmtop.shape_functions import ShapeFunction, gimp, tent
from reference_fem import elasticity, simp
from reference_fem.large_deformation import LogarithmicLaw, large_model
from reference_fem.reanalyse import build_judge, judge_criteria
from tests.scenes import LEFT_CLAMP, SHAPE_FUNCTIONS, cantilever
from validation.oracles.complex_step import stepped_problem

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

INF = np.inf
BOX = Rectangle((0, 0), (6, 4))
STIFF, SOFT = Material(3.0, 0.2), Material(0.5, 0.45)
PARTS = (Part(Rectangle((0, 0), (6, 1)), STIFF), Part(Rectangle((4, 2), (6, 4)), SOFT))
Plane = Literal["strain", "stress"]
EVERY = pytest.mark.parametrize("shape_function", SHAPE_FUNCTIONS, ids=lambda f: f.__name__)
ROLLERS = (
    Support(Rectangle((-INF, -INF), (0, INF)), (True, False)),
    Support(Rectangle((-INF, -INF), (INF, 0)), (False, True)),
)


def composite(plane: Plane = "strain", **changes: Any) -> Body:
    parts = tuple(replace(part, material=replace(part.material, plane=plane)) for part in PARTS)
    return Body(
        **{
            "domain": BOX,
            "supports": (LEFT_CLAMP,),
            "loads": (PointLoad((6, 2), (0.2, -1.0)),),
            "material": Material(1.0, 0.3, plane),
            "parts": parts,
        }
        | changes
    )


def compressed() -> Body:
    """A layer of STIFF below and of SOFT above, each half as high as the whole, under a pressure of 1 between walls."""
    walls = (
        Support(Rectangle((-INF, -INF), (0, INF)), (True, False)),
        Support(Rectangle((6, -INF), (INF, INF)), (True, False)),
        Support(Rectangle((-INF, -INF), (INF, 0)), (False, True)),
    )
    load = Traction(Rectangle((0, 4), (6, 4)), (0.0, -1.0))
    return Body(BOX, walls, (load,), SOFT, (Part(Rectangle((-INF, -INF), (INF, 2)), STIFF),))


def constrained(material: Material) -> tuple[float, float, float]:
    """Strain, lateral and von Mises stress under a stress of 1 between walls: sigma_xx = sigma_zz = nu / (1 - nu)."""
    E, nu = material.young, material.poisson
    lateral = nu / (1 - nu)
    return (1 + nu) * (1 - 2 * nu) / ((1 - nu) * E), lateral, 1 - lateral


@pytest.mark.parametrize("shape_function", [tent, gimp])
def test_layers_between_walls(shape_function: ShapeFunction, tmp_path: Path) -> None:
    """In series, each with its own constrained modulus; uniform in each layer, so exact, and so it is exported."""
    model = discretise(compressed(), 1.0, shape_function=shape_function)
    below = model.points.x[:, 1] < 2
    state = equilibrium(model, np.broadcast_to(model.elastic.young, below.shape))
    fem = elasticity.discretise(compressed(), 1.0)
    young = np.broadcast_to(fem.elastic.young, fem.area.shape)
    by_elements = elasticity.stress(fem, elasticity.solve(fem, young), young)[:, 0]
    stress = export.fields(model, state, np.ones(len(below))).stress
    for material, points, elements in (
        (STIFF, below, fem.centres[:, 1] < 2),
        (SOFT, ~below, fem.centres[:, 1] > 2),
    ):
        strain, lateral, vm = constrained(material)
        np.testing.assert_allclose(state.strain[points], np.broadcast_to([0, -strain, 0], (48, 3)), atol=1e-12)
        for found in (stress[points], by_elements[elements]):
            np.testing.assert_allclose(
                found, np.broadcast_to([-lateral, -1, 0, -lateral], found.shape), rtol=0, atol=1e-12
            )
            np.testing.assert_allclose(von_mises(found), vm, rtol=1e-12)


@pytest.mark.parametrize("plane", ["strain", "stress"])
@pytest.mark.parametrize("order", [1, 2])
def test_elements_are_those_of_a_plain_loop(plane: Plane, order: int) -> None:
    """scikit-fem with constants interpolated from elements, and the rule that is exact on squares."""
    body = composite(plane)
    fem = elasticity.discretise(body, 0.5, order)
    u = elasticity.solve(fem, np.broadcast_to(fem.elastic.young, fem.area.shape))
    basis = Basis(fem.basis.mesh, ElementVector((ElementQuad1, ElementQuad2)[order - 1]()), intorder=2 * order + 1)
    by_element = basis.with_element(ElementQuad0())
    x, y = fem.centres.T
    young, nu = np.full(len(x), 1.0), np.full(len(x), 0.3)
    young[y < 1], nu[y < 1] = STIFF.young, STIFF.poisson
    young[(x > 4) & (y > 2)], nu[(x > 4) & (y > 2)] = SOFT.young, SOFT.poisson
    mu = young / (2 * (1 + nu))
    lam = young * nu / ((1 + nu) * (1 - 2 * nu)) if plane == "strain" else young * nu / (1 - nu**2)

    @BilinearForm
    def energy(u: Any, v: Any, w: Any) -> Any:
        strain = sym_grad(u)
        return ddot(2 * w["mu"] * strain + w["lam"] * eye(trace(strain), 2), sym_grad(v))

    K = energy.assemble(basis, lam=by_element.interpolate(lam), mu=by_element.interpolate(mu))
    held = basis.get_dofs(lambda x: np.isclose(x[0], 0)).all()
    expected = np.zeros(basis.N)
    A, b, _, free = condense(K, fem.f_ext, D=held)
    expected[free] = spsolve(A.tocsc(), b)
    np.testing.assert_allclose(u, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


TIED = (
    EdgeSupport(Rectangle((0, 0), (0, 4))),
    EdgeSupport(Rectangle((1, 4), (3, 4)), "normal"),
    Spring((6, 3), 0.4, (1, 2)),
)


@dataclass(frozen=True)
class MeanSquareStress:
    """sum V rho sigma . sigma / sum V."""

    def value(self, at: Response) -> float:
        return float(at.volume * at.rho @ np.sum(at.stress**2, axis=1) / at.volume.sum())

    def gradient(self, at: Response) -> Sensitivity:
        share = at.volume / at.volume.sum()
        return Sensitivity(share * np.sum(at.stress**2, axis=1), stress=2 * (share * at.rho)[:, None] * at.stress)


@pytest.mark.parametrize("plane", ["strain", "stress"])
@pytest.mark.parametrize("supports", [(LEFT_CLAMP,), TIED], ids=["clamp", "tied"])
@pytest.mark.parametrize("criterion", [Compliance(), PNormStress(6, weight="volume"), MeanSquareStress()], ids=str)
def test_points_at_gauss_positions_are_elements(plane: Plane, supports: tuple[Any, ...], criterion: Criterion) -> None:
    """Value and density gradient, of any densities."""
    body = composite(plane, supports=supports, loads=(PositionLoad((6, 2), (0.2, -1.0)),))
    design = Design(0.5, 1.5)
    model = discretise(body, 1.0, points=to_gauss_points(seed(BOX, (0.5, 0.5))))
    points = DesignProblem(model, design, criterion)
    elements = simp.DesignProblem(elasticity.discretise(body, 1.0), design, criterion, "gauss")
    rho = np.random.default_rng(0).uniform(0.3, 1, len(elements.model.area))
    owner = np.abs(model.points.x[:, None] - elements.model.centres).max(axis=2).argmin(axis=1)
    of_points, of_elements = points.analyse(rho[owner]), elements.analyse(rho)
    assert of_points.objective == pytest.approx(of_elements.objective, rel=1e-10)
    gradient = elements.density_gradient(of_elements)
    summed = np.bincount(owner, points.density_gradient(of_points))
    np.testing.assert_allclose(summed, gradient, rtol=0, atol=1e-10 * np.abs(gradient).max())


@EVERY
@pytest.mark.parametrize(
    ("criterion", "how"),
    [
        (Compliance(), {}),
        (Compliance(), {"b_bar": True}),
        (PNormStress(8), {}),
        (PNormStress(8, measure="von_mises_in_plane"), {}),
    ],
    ids=["compliance", "b_bar", "stress", "stress in plane"],
)
def test_gradient_by_complex_steps(shape_function: ShapeFunction, criterion: Criterion, how: dict[str, Any]) -> None:
    """Interfaces on and off the grid's lines, and a Poisson's ratio of each side."""
    parts = (Part(Rectangle((0, 0), (6, 0.5)), STIFF), Part(Circle((4, 2.5), 1.2), SOFT))
    model = discretise(composite(parts=parts), 1.0, shape_function=shape_function, **how)
    problem = DesignProblem(model, Design(0.5, 1.0, contrast=1e-3), criterion)
    x = np.random.default_rng(1).uniform(0.3, 0.9, len(problem.x0))
    variables = np.arange(0, len(x), 17)
    J, g, dJ, dg = stepped_problem(problem, x, variables)
    at = problem.evaluate(x)
    gradient, volume = problem.gradient(at)
    assert at.objective == pytest.approx(J, rel=1e-10)
    np.testing.assert_allclose(gradient[variables], dJ, rtol=0, atol=1e-8 * np.abs(gradient).max())
    np.testing.assert_allclose(volume[0, variables], dg, rtol=1e-10)
    assert at.constraints[0] == pytest.approx(g, abs=1e-12)


def test_the_ghost_penalty_of_two_materials_is_differentiated() -> None:
    domain = Rectangle((0, 0), (6, 3.25))
    body = composite(
        domain=domain, parts=(Part(Rectangle((0, 2.5), (6, 4)), SOFT),), loads=(PointLoad((6, 1), (0, -1)),)
    )
    model = discretise(body, (1.0, 1.0), points=seed(domain, (0.5, 0.25)), shape_function=tent, ghost=0.01)
    assert model.ghost.modulus.shape[0] > 0
    problem = DesignProblem(model, Design(0.5, 1.0, contrast=1e-3))
    x = np.random.default_rng(2).uniform(0.3, 0.9, len(problem.x0))
    variables = np.arange(0, len(x), 11)
    dJ = stepped_problem(problem, x, variables)[2]
    gradient = problem.gradient(problem.evaluate(x))[0]
    np.testing.assert_allclose(gradient[variables], dJ, rtol=0, atol=1e-8 * np.abs(gradient).max())


def test_equal_parts_are_no_parts() -> None:
    """To the last bit, with one D and the same few distinct matrices."""
    one = discretise(composite(parts=()), 1.0, shape_function=gimp)
    same = discretise(composite(parts=(Part(Circle((3, 2), 1.1), Material(1.0, 0.3)),)), 1.0, shape_function=gimp)
    assert same.elastic.young == 1.0 and same.D.shape == (3, 3)
    moduli = np.random.default_rng(0).uniform(0.5, 1, len(one.points.x))
    np.testing.assert_array_equal(one.stiffness.data(moduli), same.stiffness.data(moduli))


@pytest.mark.parametrize("stress_at", ["centre", "gauss"])
def test_the_judge_of_one_element_for_each_is_the_elements(stress_at: simp.StressPosition) -> None:
    scene = cantilever(6, 4, parts=PARTS, objective=PNormStress(8))
    problem = simp.design_problem(scene, 1.0, stress_at=stress_at)
    at = problem.evaluate(np.random.default_rng(3).uniform(0.3, 1, len(problem.x0)))
    judge = build_judge(scene, problem.model.centres, np.full((24, 2), 0.5), split=1, order=1)
    judged = judge_criteria(judge, at.rho, judge(at.rho))
    assert judge(at.rho).compliance == pytest.approx(problem.model.f_ext @ at.u, rel=1e-10)
    if stress_at == "centre":
        assert judged.objective == pytest.approx(at.objective, rel=1e-10)
    finer = build_judge(scene, problem.model.centres, np.full((24, 2), 0.5))
    x, y = finer.model.centres.T
    expected = np.where(y < 1, 3.0, np.where((x > 4) & (y > 2), 0.5, 1.0))
    np.testing.assert_array_equal(finer.model.elastic.young, expected)


def test_optimised_with_symmetry_and_resumed(tmp_path: Path) -> None:
    """A symmetric body of layers from a checkpoint, bit for bit; another material is another problem."""
    layers = (Part(Rectangle((0, 0), (6, 1)), STIFF), Part(Rectangle((0, 3), (6, 4)), STIFF))
    design = Design(0.4, 1.5, symmetry=(Mirror((0, 2), (0, 1)),))
    model = partial(discretise, h=1.0, shape_function=gimp)
    problem = DesignProblem(model(composite(parts=layers)), design)
    whole = list(optimize(problem, MMA(), max_iterations=6))
    file = tmp_path / "layers.npz"
    list(optimize(problem, MMA(), max_iterations=3, checkpoint=file))
    again = list(optimize(problem, MMA(), max_iterations=6, checkpoint=file))
    np.testing.assert_array_equal(whole[-1].x, again[-1].x)
    other = (replace(layers[0], material=replace(STIFF, young=3.1)), layers[1])
    softer = (replace(layers[0], material=replace(STIFF, poisson=0.21)), layers[1])
    prints = {DesignProblem(model(composite(parts=parts)), design).fingerprint for parts in (layers, other, softer, ())}
    fem = partial(elasticity.discretise, size=1.0)
    of_fem = {
        simp.DesignProblem(fem(composite(parts=parts)), design).fingerprint for parts in (layers, other, softer, ())
    }
    assert len(prints) == len(of_fem) == 4


def test_plan_counts_materials() -> None:
    lines = plan(DesignProblem(discretise(composite(), 1.0), Design(0.4, 1.5)))
    assert "materials: 16 points of E0 = 0.5, nu = 0.45; 56 points of E0 = 1, nu = 0.3; 24 points of E0 = 3" in lines
    assert "materials" not in plan(DesignProblem(discretise(composite(parts=()), 1.0), Design(0.4, 1.5)))


def test_what_lies_between_two_parts_is_of_the_first() -> None:
    """Points at y = 2, on the common edge."""
    x = np.array([[1.0, 2.0], [3.0, 2.0]])
    lower, upper = Part(Rectangle((0, 0), (6, 2)), STIFF), Part(Rectangle((0, 2), (6, 4)), SOFT)
    for parts, young in (((lower, upper), 3.0), ((upper, lower), 0.5)):
        assert elastic(composite(parts=parts), x, "point").young == young


REFUSED: dict[str, tuple[Any, str]] = {
    "no tuple": (Part(BOX, STIFF), "parts of a body: give a tuple"),
    "a material": ((STIFF,), r"give a `Part\(region, material\)`"),
    "another plane": ((Part(BOX, Material(1.0, 0.3, "stress")),), "as thick everywhere"),
    "off the body": ((Part(Rectangle((7, 0), (8, 4)), STIFF),), "part 0, from .* holds the centre of no"),
    "between centres": ((PARTS[0], Part(Circle((3, 2), 0.1), SOFT)), "part 1, .* or use smaller"),
    "overlap": ((PARTS[0], Part(Rectangle((0, 0), (2, 4)), SOFT)), "parts 0 and 1 both hold"),
    "twice": ((PARTS[0], PARTS[0]), r"`Difference`"),
}


@pytest.mark.parametrize(("parts", "advice"), list(REFUSED.values()), ids=list(REFUSED))
def test_bodies_refuse_parts(parts: Any, advice: str) -> None:
    for made in (discretise, elasticity.discretise):
        with pytest.raises(InvalidScene, match=advice):
            made(composite(parts=parts), 1.0)


@pytest.mark.parametrize(
    ("made", "advice"),
    [
        (lambda: Part((0, 1), STIFF), "give a region"),
        (lambda: Part(BOX, 2.0), "give a Material"),
        (lambda: Part(BOX, Material), "give a Material"),
        (lambda: Part(BOX, Material(-1.0)), "positive, finite"),
        (lambda: Part(BOX, Material(np.nan)), "modulus nan: give a finite"),
        (lambda: Part(BOX, Material(1.0, 0.5)), "below 0.5"),
        (lambda: Part(BOX, Material("steel")), "modulus 'steel': give a finite"),  # type: ignore[arg-type]
        (lambda: Part(BOX, Material(1.0, None)), "ratio None: give a finite"),  # type: ignore[arg-type]
    ],
    ids=["no region", "a number", "a class", "negative modulus", "no modulus", "incompressible", "a word", "nothing"],
)
def test_parts_refuse(made: Any, advice: str) -> None:
    with pytest.raises(InvalidScene, match=advice):
        made()


def test_another_part_in_a_model_and_load_steps_are_refused() -> None:
    model = discretise(composite(), 1.0)
    with pytest.raises(InvalidScene, match="another material"):
        replace(model, body=composite(parts=PARTS[:1]))
    fem = elasticity.discretise(composite(), 1.0)
    for in_steps in (lambda: in_load_steps(composite(), 1.0), lambda: large_model(fem, LogarithmicLaw(0.3))):
        with pytest.raises(InvalidScene, match="leave out `parts`"):
            in_steps()


def test_a_hole_of_the_first_part_is_of_the_second() -> None:
    """An inclusion and the ring around it: `Difference` makes regions that touch."""
    core = Circle((3, 2), 1.1)
    ring = Difference(Circle((3, 2), 1.7), core)
    model = discretise(composite(parts=(Part(core, STIFF), Part(ring, SOFT))), 0.5)
    away: Array = np.hypot(*(model.points.x - (3, 2)).T)
    expected = np.where(away <= 1.1, 3.0, np.where(away <= 1.7, 0.5, 1.0))
    np.testing.assert_array_equal(model.elastic.young, expected)
