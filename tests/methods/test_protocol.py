"""One protocol for all methods: what they are asked alike they answer alike, and what one lacks it says in a word."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.body import Material, Part
from mpmtop.errors import InvalidScene
from mpmtop.grid import Grid
from mpmtop.loads import PositionLoad, RegionLoad
from mpmtop.points import seed
from mpmtop.region import Circle, Difference, Rectangle
from mpmtop.shape_functions import tent
from tests.scenes import SHAPE_FUNCTIONS, cantilever
from validation.measures.derivatives import central_difference
from validation.methods.elements import ElementMethod
from validation.methods.plain_fem import PlainFem
from validation.methods.points import PointMethod
from validation.methods.protocol import Answer, Case, Method, compliance, lacking, stated

TENT = PointMethod("standard", tent)
OURS: list[Method] = [*(PointMethod(f.__name__, f) for f in SHAPE_FUNCTIONS), ElementMethod(), PlainFem()]


def pymoto() -> Method:
    pytest.importorskip("pymoto", reason="pyMOTO is in the extra `peers`")
    from validation.methods.pymoto import PyMotoMethod

    return PyMotoMethod()


def kratos() -> Method:
    pytest.importorskip("KratosMultiphysics", reason="Kratos is in the extra `peers`")
    from validation.methods.kratos import KratosMethod

    return KratosMethod()


def case(**changes: Any) -> Case:
    """The cantilever, 8 x 4 cells, of uneven moduli; `changes` are to its body or to the case."""
    body = cantilever().body
    of_body = [name for name in ("domain", "loads", "material", "parts") if name in changes]
    body = replace(body, **{name: changes.pop(name) for name in of_body})
    points = seed(body.domain, (0.5, 0.5))
    moduli = np.random.default_rng(0).uniform(0.5, 1, len(points.x))
    grid = Grid.around(*body.domain.bounds, (1.0, 1.0))
    return replace(Case("cantilever", body, points, grid, moduli), **changes)


def stretched(x: Array) -> Array:
    return np.stack([0.1 - 0.2 * x[:, 1], 0.2 * x[:, 0] + 0.3 * x[:, 1]], axis=1)


CASES: dict[str, Callable[[], Case]] = {
    "point load": case,
    "load by region": lambda: case(loads=(RegionLoad(Rectangle((7.0, 0.0), (8.0, 4.0)), (0.3, -1.0)),)),
    "load at a position": lambda: case(loads=(PositionLoad((7.3, 2.1), (0.3, -1.0)),)),
    "body forces": lambda: case(loads=(), body_force=np.random.default_rng(1).normal(size=(128, 2))),
    "prescribed displacements": lambda: case(loads=(), prescribed=stretched),
    "plane stress": lambda: case(material=Material(2.0, 0.2, "stress")),
    "materials by region": lambda: case(parts=(Part(Rectangle((0, 2), (8, 4)), Material(1.0, 0.4)),)),
    "hole": lambda: case(domain=Difference(Rectangle((0.0, 0.0), (8.0, 4.0)), Circle((4.0, 2.0), 1.1))),
}


def alike(a: Answer, b: Answer, rtol: float) -> None:
    assert np.abs(a.u - b.u).max() <= rtol * np.abs(a.u).max()
    if a.stress is not None and b.stress is not None:
        assert np.abs(a.stress - b.stress).max() <= rtol * np.abs(a.stress).max()
    if a.compliance is not None and b.compliance is not None:
        assert abs(a.compliance - b.compliance) <= rtol * abs(a.compliance)


@pytest.mark.parametrize("name", CASES)
def test_two_codes_of_one_discretisation_answer_alike(name: str) -> None:
    """Assemblies, factorisations and evaluations that share no line but the statement of the case."""
    asked = CASES[name]()
    elements, plain = ElementMethod(), PlainFem()
    if lacking(plain, asked):
        assert name in ("plane stress", "materials by region") and lacking(plain, asked) == f"not supported: {name}"
        return
    alike(elements.analyse(asked), plain.analyse(asked), 1e-9)  # condition number 1e5, rounding 1e-16, and room
    if name != "prescribed displacements":
        np.testing.assert_allclose(elements.gradient(asked), plain.gradient(asked), rtol=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_the_order_of_points_is_the_answer_s(name: str) -> None:
    asked = CASES[name]()
    order = np.random.default_rng(2).permutation(len(asked.moduli))
    points = replace(
        asked.points,
        **{what: getattr(asked.points, what)[order] for what in ("x", "volume", "half_length")},
    )
    body_force = None if asked.body_force is None else asked.body_force[order]
    shuffled = replace(asked, points=points, moduli=asked.moduli[order], body_force=body_force)
    for method in OURS:
        if not lacking(method, asked):
            answer = method.analyse(asked)
            assert answer.stress is not None
            alike(Answer(answer.u[order], answer.stress[order]), method.analyse(shuffled), 1e-9)


@pytest.mark.parametrize("method", OURS, ids=lambda method: method.name)
@pytest.mark.parametrize("name", ["point load", "load by region", "body forces"])
def test_energies_and_gradient(method: Method, name: str) -> None:
    """f.u is the work of the forces at the points; C is of degree -1 in the moduli; a difference quotient of one."""
    asked = CASES[name]()
    answer, gradient = method.analyse(asked), method.gradient(asked)
    force = asked.point_forces + (0 if asked.body_force is None else asked.points.volume[:, None] * asked.body_force)
    assert answer.compliance == pytest.approx(float(np.sum(force * answer.u)), rel=1e-10)
    assert gradient @ asked.moduli == pytest.approx(-float(answer.compliance or 0), rel=1e-9)
    unit = np.eye(len(gradient))[40]
    slope = central_difference(lambda E: compliance(method, replace(asked, moduli=E)), asked.moduli, unit, 1e-5)
    # of the quotient: 1e-10 by its step, 1e-13 / 1e-5 by rounding of C, which is some hundred times the derivative
    assert gradient[40] == pytest.approx(slope, rel=1e-5)


@pytest.mark.parametrize("method", OURS, ids=lambda method: method.name)
def test_displacements_of_a_linear_field(method: Method) -> None:
    """Held all around at a linear field, uniform points have it, and one stress."""
    everywhere = replace(
        cantilever().body.supports[0],
        region=Difference(Rectangle((-9.0, -9.0), (17.0, 13.0)), Rectangle((0.0, 0.0), (8.0, 4.0))),
    )
    asked = case(loads=(), moduli=np.ones(128), prescribed=stretched)
    asked = replace(asked, body=replace(asked.body, supports=(everywhere,)))
    answer = method.analyse(asked)
    np.testing.assert_allclose(answer.u, stretched(asked.points.x), atol=1e-12)
    nu = asked.body.material.poisson
    expected = np.array([nu, 1 - nu, 0]) * 0.3 / ((1 + nu) * (1 - 2 * nu))  # of eps_yy = 0.3 alone
    np.testing.assert_allclose(answer.stress, np.tile(expected, (128, 1)), atol=1e-12)


def test_supports_that_methods_are_not_asked_are_refused() -> None:
    """And not passed over: nodes are held where `prescribed` says."""
    clamp = replace(cantilever().body.supports[0], displacement=(0.1, 0.0))
    with pytest.raises(InvalidScene, match="say by `prescribed` where"):
        replace(case(), body=replace(cantilever().body, supports=(clamp,)))


def test_what_a_method_lacks_is_a_word() -> None:
    moved = replace(case(), points=case().points.moved((0.3, 0.0)))
    assert lacking(TENT, moved) == ""
    assert lacking(ElementMethod(), moved) == "not supported: points anywhere"
    assert compliance(ElementMethod(), moved) == "not supported: points anywhere"
    unequal = replace(case().points, half_length=case().points.half_length * np.linspace(0.5, 1, 128)[:, None])
    assert lacking(ElementMethod(), replace(case(), points=unequal)) == "not supported: points anywhere"
    half = seed(Rectangle((0.0, 0.0), (4.0, 4.0)), (0.5, 0.5))
    assert lacking(PlainFem(), replace(case(), points=half)) == "not supported: points anywhere"
    assert stated(None) == "not stated" and stated(0.0) == 0.0


@pytest.mark.parametrize("name", CASES)
def test_pymoto(name: str) -> None:
    """Its elements are the reference's: displacements, compliance and its own gradient; two stresses of three.

    The shear that its module `Stress` gives (2.0.1) is twice that of the law its stiffness is made of.
    """
    asked, method = CASES[name](), pymoto()
    if lacking(method, asked):
        assert name in ("load at a position", "prescribed displacements", "hole")
        return
    ours, theirs = ElementMethod().analyse(asked), method.analyse(asked)
    assert ours.stress is not None and theirs.stress is not None
    alike(replace(ours, stress=ours.stress * [1, 1, 2]), theirs, 1e-8)  # two factorisations of one matrix
    np.testing.assert_allclose(method.gradient(asked), ElementMethod().gradient(asked), rtol=1e-7)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("moved", [0.0, 0.3])
def test_kratos(name: str, moved: float) -> None:
    """Standard MPM in two codes; its stress is of finite strain and taken where that is small."""
    asked, method = CASES[name](), kratos()
    asked = replace(asked, points=asked.points.moved((moved, 0.1 * moved)))
    if lacking(method, asked):
        assert name == "load at a position"
        return
    alike(TENT.analyse(asked), method.analyse(asked), 2e-9)
