"""Criteria, load cases, projection, symmetry: values, derivatives beside complex steps, what is shared and refused."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpmtop.body import Body, Support
from mpmtop.criteria import (
    AtLeast,
    AtMost,
    Compliance,
    Displacement,
    PNormStress,
    Response,
    Sensitivity,
    Volume,
    Worst,
)
from mpmtop.design import Design, Mirror, Projection
from mpmtop.equilibrium import equilibrium
from mpmtop.errors import InvalidScene
from mpmtop.loads import PointLoad, PositionLoad, RegionLoad
from mpmtop.optimizers import GCMMA, MMA, Stage, continuation, optimize
from mpmtop.planning import plan
from mpmtop.problem import DesignProblem, design_problem
from mpmtop.region import Rectangle
from mpmtop.scene import LoadCase, Scene
from mpmtop.shape_functions import ShapeFunction, bspline2, gimp, tent
from validation.oracles.criteria import stepped_criteria

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # bodies of a few cells

LEFT, BELOW = Support(Rectangle((-1, -1), (0, 3))), Support(Rectangle((-1, -1), (5, 0)))
TIP, PULL = PointLoad((4.0, 0.5), (0.2, -1.0), 4), RegionLoad(Rectangle((3, 0), (4, 2)), (1.0, 0.3))
BODY = Body(Rectangle((0.0, 0.0), (4.0, 2.0)), (LEFT,))
CASES = LoadCase((TIP,), 0.7), LoadCase((PULL,), 1.3), LoadCase((TIP, PULL), 0.4, supports=(BELOW,))
DESIGN = Design(0.5, 1.2, contrast=1e-4)
ALONG = Displacement(Rectangle((3, 1), (4, 2)), (3.0, -4.0))


@dataclass(frozen=True)
class Own:
    """A criterion that depends on all that there is."""

    power: float = 2.0

    def value(self, at: Response) -> float:
        return np.sum(at.volume * (at.rho * np.sum(at.displacement**2, axis=1) + at.strain[:, 2] * at.stress[:, 0]))

    def gradient(self, at: Response) -> Sensitivity:
        by_strain, by_stress = np.zeros_like(at.strain), np.zeros_like(at.stress)
        by_strain[:, 2], by_stress[:, 0] = at.volume * at.stress[:, 0], at.volume * at.strain[:, 2]
        by_displacement = (self.power * at.volume * at.rho)[:, None] * at.displacement
        return Sensitivity(at.volume * np.sum(at.displacement**2, axis=1), by_displacement, by_strain, by_stress)


LIMITS = (
    AtMost(Compliance(), 90.0),
    AtMost(PNormStress(8, 0.5, weight="volume"), 3.0, case=1),
    AtMost(PNormStress(6, 0.3), 5.0, case=2),
    AtLeast(ALONG, 0.0, scale=2.0),
    AtLeast(Volume(), 0.2),
    AtMost(Own(), 10.0, case=0),
)
DESIGNS = {
    "plain": DESIGN,
    "projected": replace(DESIGN, projection=Projection(4.0, 0.4)),
    "volume kept": replace(DESIGN, projection=Projection(4.0, preserve_volume=True)),
    "symmetric": replace(DESIGN, symmetry=(Mirror((2, 1), (0, 2)), Mirror((2, 1), (1, 0)))),
    "all": replace(
        DESIGN,
        projection=Projection(3.0, preserve_volume=True),
        symmetry=(Mirror((0, 1), (0, 1)),),
        passive_solid=Rectangle((3.5, 0), (4, 2)),
        passive_void=Rectangle((1, 0.5), (2, 1.5)),
    ),
}


def problem(objective: Any = None, design: Design = DESIGN, f: ShapeFunction = tent, **changes: Any) -> DesignProblem:
    scene = Scene("cases", BODY, design, objective or Compliance(), **({"cases": CASES} | changes))
    return design_problem(scene, 1.0, 2, f, filter_passive=True)


@pytest.mark.parametrize("f", [tent, gimp, bspline2], ids=lambda f: f.__name__)
@pytest.mark.parametrize("name", DESIGNS)
def test_values_and_derivatives(name: str, f: ShapeFunction) -> None:
    """All criteria at once, in three cases on two supports, beside complex steps through dense equations."""
    of = problem(Worst(Compliance()), DESIGNS[name], f, constraints=LIMITS)
    rng = np.random.default_rng(0)
    x = rng.uniform(0.2, 1, len(of.x0))
    at = of.evaluate(x)
    df, dg = of.gradient(at)
    some = rng.choice(len(x), min(4, len(x)), replace=False)
    values, by = stepped_criteria(of, x, some)
    np.testing.assert_allclose(np.append(at.objectives, at.constraints), values, rtol=1e-9, atol=1e-9)
    ours = np.vstack([df, dg])
    largest = np.abs(ours).max(axis=1, keepdims=True)
    assert np.abs(ours[:, some] - by).max() > 0  # not the same arithmetic
    np.testing.assert_allclose(ours[:, some] / largest, by / largest, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    "objective", [Compliance(), PNormStress(), ALONG, Volume(), Own(), PNormStress(10, 0.5, weight="volume")], ids=repr
)
def test_each_as_objective(objective: Any) -> None:
    """The weighted sum of the cases, but of the volume, which is one."""
    of = problem(objective, DESIGNS["projected"], constraints=(AtMost(Compliance(), 100.0),))
    x = np.random.default_rng(1).uniform(0.2, 1, len(of.x0))
    at = of.evaluate(x)
    values, by = stepped_criteria(of, x, np.arange(3))
    assert at.objective == pytest.approx(values[0], rel=1e-9)
    df = of.gradient(at)[0]
    np.testing.assert_allclose(df[:3], by[0], rtol=0, atol=1e-8 * np.abs(df).max())


def test_cases_are_problems_of_their_own() -> None:
    """The sum is that of three problems made apart, and the worst is the largest of them."""
    x = np.random.default_rng(2).uniform(0.2, 1, 32)
    apart = []
    for case in CASES:
        body = replace(BODY, loads=case.loads, supports=case.supports or BODY.supports)
        apart.append(case.weight * design_problem(Scene("one", body, DESIGN), 1.0, 2).evaluate(x).objective)
    assert problem().evaluate(x).objective == pytest.approx(sum(apart), rel=1e-12)
    worst = problem(Worst(Compliance())).evaluate(x)
    np.testing.assert_allclose(worst.objectives, apart, rtol=1e-12)
    assert worst.objective == worst.objectives.max()


def test_one_factorisation_for_all_on_the_same_supports(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two stiffnesses for three cases; adjoints take none. Supports said otherwise but alike share, too."""
    of = problem(PNormStress(), constraints=(AtMost(ALONG, 1.0),))
    solver = type(of.model.solver)
    factor, count = solver.factor, []

    def counted(self: Any, *arguments: Any) -> Any:
        count.append(1)
        return factor(self, *arguments)

    monkeypatch.setattr(solver, "factor", counted)
    of.gradient(of.evaluate(of.x0))
    assert len(count) == 2
    alike = LoadCase((PULL,), supports=(Support(Rectangle((-9, -9), (0, 9))),))
    assert len({id(model.stiffness) for model in problem(cases=(CASES[0], alike)).models}) == 1
    text = plan(of)
    assert "load cases: 3, one solve each, 2 factorisation(s): cases 0, 1 share one; case 2 has its own" in text
    assert "adjoint solves: 6, with the factorisations of the states" in text
    assert "objective of the cases: weighted sum" in text
    assert "by a bound variable" in plan(problem(Worst(Compliance())))


def test_plan_says_what_is_asked_and_no_more() -> None:
    asked = problem(Volume(), replace(DESIGNS["all"], volume_fraction=1.0), constraints=(AtMost(Compliance(), 9.0),))
    text = plan(asked)
    assert "constraints: no volume fraction, 3 of values" in text
    assert "projection: beta 3, threshold that keeps the volume" in text
    assert "symmetry: 12 variables for 24 active points" in text
    bare = plan(design_problem(one_case(), 1.0, 2))
    assert not any(word in bare for word in ("load cases", "constraints", "projection", "symmetry"))


def one_case() -> Scene:
    return Scene("one", replace(BODY, loads=(TIP,)), DESIGN)


def test_displacement_is_the_work_of_a_unit_load() -> None:
    """At a position the field itself, over a region its mean by volume; along the load it is the compliance."""
    of = design_problem(one_case(), 1.0, 2, gimp)
    state = equilibrium(of.model, np.ones(32))
    place = (3.3, 1.2)
    at_place = of.model.at(np.array([place])).displacement(state.u)[0]
    points = of.model.points
    inside = ALONG.place.contains(points.x)  # type: ignore[union-attr]
    mean = of.model.transfer.interpolate(state.u)[inside].mean(axis=0)
    for criterion, expected in (
        (Displacement(place, (1, 0)), at_place[0]),
        (Displacement(place, (3, 4)), at_place @ (0.6, 0.8)),
        (ALONG, mean @ (0.6, -0.8)),
    ):
        found = of.model.forces_of((criterion.unit_load,)).fixed @ state.u
        assert found == pytest.approx(expected, rel=1e-13)
    pulled = replace(BODY, loads=(PositionLoad(place, (0.0, -2.0)),))
    design = replace(DESIGN, projection=None)
    deflected = design_problem(Scene("u", pulled, design, Displacement(place, (0, -1))), 1.0, 2)
    stiff = design_problem(Scene("C", pulled, design), 1.0, 2)
    x = np.random.default_rng(3).uniform(0.2, 1, 32)
    one, other = deflected.evaluate(x), stiff.evaluate(x)
    assert 2 * one.objective == pytest.approx(other.objective, rel=1e-12)
    # one by an adjoint solve, one without: both to the solver's tolerance
    np.testing.assert_allclose(2 * deflected.gradient(one)[0], stiff.gradient(other)[0], rtol=1e-9)


@pytest.mark.parametrize("projection", [Projection(1.0), Projection(64.0, 0.3), Projection(8.0, preserve_volume=True)])
def test_projection_keeps_ends_order_and_volume(projection: Projection) -> None:
    """0 and 1 stay, larger stays larger; the start meets the volume constraint, and the kept volume is that of the
    filtered design whatever that is."""
    of = problem(design=replace(DESIGN, projection=projection))
    r = np.linspace(0, 1, 32)
    rho = of.densities(r)
    assert rho[0] == 0 and rho[-1] == pytest.approx(1, abs=1e-15) and np.all(np.diff(rho) >= 0)
    start = of.evaluate(of.x0)
    assert start.constraints[0] == pytest.approx(0, abs=1e-10)
    if projection.preserve_volume:
        assert of.volume_weight @ rho == pytest.approx(of.volume_weight @ r, rel=1e-12)
        assert of.densities(np.full(32, 0.3)) == pytest.approx(0.3, abs=1e-12)


def test_projected_densities_of_no_design_have_no_gradient() -> None:
    of = problem(design=DESIGNS["projected"])
    with pytest.raises(ValueError, match="come from no design"):
        of.gradient(of.analyse(np.full(32, 0.5)))


def test_symmetry_is_of_the_densities() -> None:
    """Every point has the density of its images, whatever the design; a point on the mirror is its own."""
    of = problem(design=DESIGNS["symmetric"])
    assert len(of.x0) == len(of.positions) == 8
    rho = of.evaluate(np.random.default_rng(4).uniform(0.2, 1, 8)).rho.reshape(8, 4)
    np.testing.assert_allclose(rho, rho[::-1], rtol=0, atol=1e-15)
    np.testing.assert_allclose(rho, rho[:, ::-1], rtol=0, atol=1e-15)
    for mirror in (Mirror((2.1, 1), (1, 0)), Mirror((2, 1), (1, 1))):
        with pytest.raises(InvalidScene, match="have no image"):
            problem(design=replace(DESIGN, symmetry=(mirror,)))
    with pytest.raises(InvalidScene, match="have no image"):  # the passive part has none
        problem(design=replace(DESIGN, symmetry=(Mirror((2, 1), (1, 0)),), passive_solid=Rectangle((3.5, 0), (4, 2))))


def test_volume_is_no_constraint_where_it_limits_nothing() -> None:
    """Least volume under limits: those alone. It starts solid, where it is feasible if anything is."""
    of = problem(Volume(), replace(DESIGN, volume_fraction=1.0), constraints=(AtMost(Compliance(), 50.0),))
    at = of.evaluate(of.x0)
    assert len(at.constraints) == 3 and np.all(of.x0 == 1) and at.objective == pytest.approx(1)
    assert len(of.gradient(at)[1]) == 3
    alone = problem(design=replace(DESIGN, volume_fraction=1.0))
    assert len(alone.evaluate(alone.x0).constraints) == 1  # an optimiser needs one


def changes() -> dict[str, Callable[[], DesignProblem]]:
    limit = AtMost(ALONG, 1.0)
    return {
        "nothing": lambda: problem(constraints=(limit,)),
        "weight": lambda: problem(cases=(replace(CASES[0], weight=0.8), *CASES[1:]), constraints=(limit,)),
        "load": lambda: problem(cases=(*CASES[:2], replace(CASES[2], loads=(TIP,))), constraints=(limit,)),
        "support": lambda: problem(cases=(*CASES[:2], replace(CASES[2], supports=None)), constraints=(limit,)),
        "bound": lambda: problem(constraints=(AtMost(ALONG, 1.1),)),
        "sense": lambda: problem(constraints=(AtLeast(ALONG, 1.0),)),
        "scale": lambda: problem(constraints=(AtMost(ALONG, 1.0, 2.0),)),
        "case": lambda: problem(constraints=(AtMost(ALONG, 1.0, case=0),)),
        "place": lambda: problem(constraints=(AtMost(replace(ALONG, place=(3.5, 1.5)), 1.0),)),
        "worst": lambda: problem(Worst(Compliance()), constraints=(limit,)),
        "own": lambda: problem(Own(), constraints=(limit,)),
        "own, otherwise": lambda: problem(Own(3.0), constraints=(limit,)),
        "stress": lambda: problem(PNormStress(), constraints=(limit,)),
        "stress by volume": lambda: problem(PNormStress(weight="volume"), constraints=(limit,)),
        "projection": lambda: problem(design=DESIGNS["projected"], constraints=(limit,)),
        "sharper": lambda: problem(design=replace(DESIGN, projection=Projection(5.0, 0.4)), constraints=(limit,)),
        "volume kept": lambda: problem(design=DESIGNS["volume kept"], constraints=(limit,)),
        "symmetry": lambda: problem(design=DESIGNS["symmetric"], constraints=(limit,)),
    }


def test_fingerprint_tells_all_of_it_apart() -> None:
    prints = {name: make().fingerprint for name, make in changes().items()}
    assert len(set(prints.values())) == len(prints)
    assert prints == {name: make().fingerprint for name, make in changes().items()}


def test_continuation_of_projections_resumes_bit_for_bit(tmp_path: Path) -> None:
    """Penal, beta and filter radius in stages: killed anywhere, it goes on as if nothing had happened."""

    def stages() -> list[Stage[Any]]:
        first = problem(design=replace(DESIGN, projection=Projection(1.0)))
        designs = [
            replace(DESIGN, projection=Projection(beta), penal=penal, filter_radius=radius)
            for beta, penal, radius in ((1.0, 2.0, 1.4), (4.0, 3.0, 1.2), (16.0, 3.0, 1.0))
        ]
        return [Stage(replace(first, design=design), MMA(0.2), max_iterations=3) for design in designs]

    whole = list(continuation(stages()))
    assert len(whole) == 12 and {iterate.stage for iterate in whole} == {0, 1, 2}
    for kill in (2, 5, 9):
        path = tmp_path / f"{kill}.npz"
        run = continuation(stages(), checkpoint=path)
        for _ in range(kill):
            next(run)
        run.close()
        rest = list(continuation(stages(), checkpoint=path))
        for ours, theirs in zip(rest, whole[kill - 1 :], strict=True):
            assert np.array_equal(ours.x, theirs.x) and ours.objective == theirs.objective
            assert (ours.stage, ours.iteration) == (theirs.stage, theirs.iteration)


def test_a_worst_of_cases_resumes_bit_for_bit(tmp_path: Path) -> None:
    of = problem(Worst(Compliance()), constraints=(AtMost(PNormStress(8), 6.0),))
    whole = list(optimize(of, GCMMA(), max_iterations=4))
    run = optimize(of, GCMMA(), max_iterations=4, checkpoint=tmp_path / "worst.npz")
    next(run), next(run)
    run.close()
    last = list(optimize(of, GCMMA(), max_iterations=4, checkpoint=tmp_path / "worst.npz"))[-1]
    assert np.array_equal(last.x, whole[-1].x) and last.objective == whole[-1].objective
