"""What both solvers promise alike: of densities, of lengths that cut the body, of a run that goes on."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from skfem import MeshQuad, MeshQuad2, MeshTri

from mpmtop.arrays import Array, Mask
from mpmtop.body import Material
from mpmtop.criteria import PNormStress
from mpmtop.errors import InvalidScene, LoadOutsideBody
from mpmtop.loads import PointLoad, PositionLoad
from mpmtop.model import discretise
from mpmtop.optimizers import GCMMA, optimize
from mpmtop.points import seed
from mpmtop.problem import design_problem as points_problem
from mpmtop.region import Circle, Difference, LevelSet, Rectangle, Region
from mpmtop.scene import Scene
from reference_fem.mesh import lattice
from reference_fem.reanalyse import build_judge, judge_stress
from reference_fem.simp import design_problem
from tests.scenes import LEFT_CLAMP, cantilever
from validation.bodies.scenes import changed

CUTS = pytest.mark.parametrize(
    "cut", [lambda s: points_problem(s, 1.0), lambda s: design_problem(s, 0.5)], ids=["MPM", "FEM"]
)


# --- densities --------------------------------------------------------------------------------------------------------


def by_points(rho: Array) -> float:
    return points_problem(cantilever(), 1.0).analyse(rho).objective


def by_elements(rho: Array) -> float:
    return design_problem(cantilever(), 0.5).analyse(rho).objective


def by_judge(rho: Array) -> float:
    points = seed(cantilever().body.domain, (0.5, 0.5))
    judge = build_judge(cantilever(), points.x, points.half_length)
    judgement = judge(rho)
    return judgement.compliance + judge_stress(judge, rho, judgement).p_norm


READERS = pytest.mark.parametrize("read", [by_points, by_elements, by_judge])


@READERS
def test_rounding_of_densities_is_no_density(read: Callable[[Array], float]) -> None:
    """What a filter leaves outside 0 to 1 passes as 0 and 1, to the last bit, and never as a power of it."""
    rho = np.tile([0.0, 1.0], 64)
    assert read(rho + np.tile([-9e-10, 9e-10], 64)) == read(rho)


@READERS
@pytest.mark.parametrize("wrong", [-2e-9, 1 + 2e-9, 1.5, -0.2, np.nan])
def test_what_is_no_density_is_refused(read: Callable[[Array], float], wrong: float) -> None:
    rho = np.full(128, 0.5)
    rho[17] = wrong
    with pytest.raises(ValueError, match="outside 0 to 1"):
        read(rho)
    with pytest.raises(ValueError, match=r"shape \(3,\) for 128 (points|elements)"):
        read(np.ones(3))


@CUTS
@pytest.mark.parametrize("p", [1.0, 2.0, 12.0])
@pytest.mark.parametrize("empty", ["some", "all"])
def test_p_norm_grows_from_zero_density(cut: Callable[[Scene], Any], p: float, empty: str) -> None:
    """From above, by one-sided differences: zero for q p > 1, finite for q p = 1, and infinite below, where no update
    rule is given it. Where all density is zero, J is rho^q times a stress: q counts in place of q p."""
    order = 1 / p if empty == "some" else 1.0
    rho = np.random.default_rng(0).uniform(0.3, 1, 128)
    rho[[0, 60] if empty == "some" else slice(None)] = 0.0
    for q, expected in ((order, "finite"), (1.5 * order, "zero"), (0.6 * order, "infinite"), (0.0, "any")):
        problem = cut(cantilever(objective=PNormStress(p, q), penal=2.0, rho_min=0.0, contrast=1e-3))
        at = problem.analyse(rho)
        slope = problem.density_gradient(at)[0]
        unit, t = np.arange(128) == 0, np.array([1e-4, 5e-5]) * (1e-5 if expected == "infinite" else 1)
        first, second = ((problem.analyse(rho + s * unit).objective - at.objective) / s for s in t)
        if expected == "infinite":  # quotients grow as t^(q/order - 1)
            assert slope == np.inf and second / first == pytest.approx(2 ** (1 - q / order), rel=0.05)
        elif empty == "some" or expected == "finite":
            # half a quotient's error is of order t^(1/2), by the law's exponent and by q
            assert abs(slope - second) <= 1.2 * abs(first - second) / (np.sqrt(2) - 1) + 1e-6
    problem = cut(cantilever(objective=PNormStress(p, 0.5 / p), rho_min=0.0))
    with pytest.raises(InvalidScene, match="positive rho_min"):
        problem.gradient(problem.evaluate(np.zeros(128)))


# --- lengths ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("typed", [0.1428571, 0.14285714, 0.142857142857])
def test_a_length_typed_to_seven_digits_divides(typed: float) -> None:
    """In either solver, and what is cut is the exact division: nothing drifts through the cells."""
    body = Rectangle((0.0, 0.0), (8.0, 4.0))
    exact = seed(body, (1 / 7, 1 / 7))
    given = seed(body, (typed, typed))
    assert np.array_equal(given.x, exact.x) and np.array_equal(given.half_length, exact.half_length)
    assert np.array_equal(lattice(body.bounds, np.full(2, typed)).p, lattice(body.bounds, np.full(2, 1 / 7)).p)
    model, as_meant = discretise(cantilever().body, 2 * typed), discretise(cantilever().body, 2 / 7)
    assert model.grid == as_meant.grid and np.array_equal(model.f_ext, as_meant.f_ext)


@pytest.mark.parametrize("typed", [(1 + 2e-6) / 7, (1 - 2e-6) / 7, 0.3, 5.0, -1.0, 0.0, np.nan, np.inf])
def test_a_length_that_does_not_divide_is_refused_by_both(typed: float) -> None:
    said = "does not divide .* nearest that does" if typed in (0.3, 5.0) or abs(typed * 7 - 1) < 1e-5 else "positive"
    for cut in (
        lambda: discretise(cantilever().body, 2 * typed),
        lambda: design_problem(cantilever(), typed),
    ):
        with pytest.raises(InvalidScene, match=said):
            cut()


# --- loads and passive regions ----------------------------------------------------------------------------------------


IDLE = {
    "on the clamp": (PositionLoad((0, 2), (0, -1)),),
    "zero": (PointLoad((8, 2), (0, 0)),),
    "in balance": (PointLoad((8, 2), (0, -1)), PointLoad((8, 2), (0, 1))),
    "in balance but for rounding": tuple(PositionLoad((8, 2), (0, f)) for f in (0.1, 0.2, -0.3)),
}


@CUTS
@pytest.mark.parametrize("loads", IDLE.values(), ids=IDLE)
def test_loads_that_do_no_work_are_refused(cut: Callable[[Scene], Any], loads: tuple[PointLoad, ...]) -> None:
    with pytest.raises(LoadOutsideBody, match="do no work: move them away"):
        cut(cantilever(loads=loads))


@CUTS
def test_a_small_load_beside_a_large_idle_one_works(cut: Callable[[Scene], Any]) -> None:
    clamped, tip = PositionLoad((0, 2), (0, -1e9)), PositionLoad((8, 2), (0, -1))
    both, alone = (cut(cantilever(loads=loads)) for loads in ((clamped, tip), (tip,)))
    assert both.evaluate(both.x0).objective == alone.evaluate(alone.x0).objective


@CUTS
@pytest.mark.parametrize("name", ["passive_solid", "passive_void"])
@pytest.mark.parametrize(
    "region",
    [Circle((4, 2), 0.1), Rectangle((0, 3.8), (8, 4)), Rectangle((0, 4), (8, 5)), Rectangle((0, 3e3), (8e3, 4e3))],
    ids=["bolt hole", "thin deck", "outside", "in millimetres"],
)
def test_a_passive_region_that_holds_nothing_is_refused(cut: Callable[[Scene], Any], name: str, region: Region) -> None:
    with pytest.raises(InvalidScene, match=f"{name} holds no (material point|element's centre): enlarge it"):
        cut(cantilever(**{name: region}))


@pytest.mark.parametrize("kind", [MeshTri, MeshQuad2])
def test_elements_take_straight_quads_only(kind: Any) -> None:
    """Triangles are no quads, and of curved quads the curves would be lost."""
    mesh = MeshQuad.init_tensor(np.linspace(0, 8, 9), np.linspace(0, 4, 5))
    other = mesh.to_meshtri() if kind is MeshTri else MeshQuad2.from_mesh(mesh)
    with pytest.raises(InvalidScene, match=f"mesh of {type(other).__name__}: give straight-sided quads"):
        design_problem(cantilever(), mesh=other)


# --- a run that goes on -----------------------------------------------------------------------------------------------


class Box:
    """A region of one's own, without a repr or an equality."""

    bounds = np.array([0.0, 0.0]), np.array([8.0, 4.0])

    def contains(self, x: Array, tol: float = 0.0) -> Mask:
        return np.all((x >= -tol) & (x <= self.bounds[1] + tol), axis=1)


def domains() -> list[Region]:
    """Made anew at each call, as in a new process."""
    body = Rectangle((0.0, 0.0), (8.0, 4.0))
    outline = LevelSet((0.0, 0.0), (8.0, 4.0), lambda x: np.abs(x[:, 1] - 2) - (2 - 0.05 * x[:, 0]))
    return [body, outline, Box(), Difference(body, Circle((4, 2), 0.8))]


@pytest.mark.parametrize("kind", range(4), ids=["rectangle", "level set", "own region", "difference"])
def test_elements_resume_on_any_domain(kind: int, tmp_path: Path) -> None:
    """The fingerprint is of numbers: no address of a function, no name, no int that stands for a float."""
    loads = (PointLoad((7.5, 2.0), (0.0, -1.0)),)
    first, again = (
        design_problem(cantilever(domain=domains()[kind], loads=loads, name=name, penal=penal), 0.5)
        for name, penal in (("first", 3), ("again", 3.0))
    )
    checkpoint = tmp_path / "run.npz"
    list(optimize(first, GCMMA(), max_iterations=2, checkpoint=checkpoint))
    iterates = list(optimize(again, GCMMA(), max_iterations=3, checkpoint=checkpoint))
    assert iterates[-1].iteration == 3 and len(iterates) < 3


def test_every_number_of_the_scene_is_in_the_fingerprint_of_elements() -> None:
    scene = cantilever()
    steel = scene.body.material
    prints = [
        design_problem(changed(scene, **changes), 0.5).fingerprint
        for changes in (
            {},
            {"material": replace(steel, young=2.0)},
            {"material": replace(steel, poisson=0.2)},
            {"material": Material(1.0, 0.3, "stress")},
            {"material": Material(1.0, 0.0, "strain")},
            {"material": Material(1.0, 0.0, "stress")},
            {"volume_fraction": 0.5},
            {"filter_radius": 2.0},
            {"penal": 2.0},
            {"contrast": 1e-6},
            {"rho_min": 0.0},
            {"objective": PNormStress()},
            {"objective": PNormStress(p=8.0)},
            {"objective": PNormStress(q=0.4)},
            {"objective": PNormStress(measure="von_mises_in_plane")},
            {"loads": (PointLoad((8, 1), (0, -1)),)},
            {"supports": (replace(LEFT_CLAMP, region=Rectangle((0, 0), (0, 2))),)},
            {"domain": Rectangle((0, 0), (8, 3.5))},
        )
    ]
    assert len(set(prints)) == len(prints)
