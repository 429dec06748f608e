"""Work and precision: the closed forms, the measures of cost, and what is read from runs."""

import numpy as np
import pandas as pd
import pytest
import scipy.sparse as sp
from numpy.polynomial.legendre import leggauss

from mpmtop.body import Material
from mpmtop.crossing import Periodic, Uniform
from mpmtop.model import Model
from mpmtop.shape_functions import ShapeFunction, bspline2, bspline3, gimp, tent
from validation.bodies import manufactured
from validation.bodies.beam import (
    BEAM,
    SLENDER,
    beam,
    beam_body,
    beam_elements,
    beam_energy,
    beam_places,
    beam_tractions,
)
from validation.bodies.cook import cook_elements
from validation.bodies.crossing import points_model
from validation.measures.derivatives import central_difference
from validation.measures.orders import observed_order
from validation.measures.outcome import Measure, Outcome, stored_bytes
from validation.studies.work_precision.quantity import Quantity
from validation.studies.work_precision.runs import cheapest, front, refined, settled, slopes

DEPTH = 3.0
X = np.random.default_rng(7).uniform((0, 0), (SLENDER * DEPTH, DEPTH), (40, 2))
STEP = 1e-3
RTOL_DIFFERENCE = 1e-9
"""Central differences of cubics: their error, STEP^2 / 6 of the third derivative, 1e-7 of the largest slope over the
depth squared; polynomials of degree two in stress have none but rounding, 1e-16 / STEP."""


each_material = pytest.mark.parametrize(
    "material", [BEAM, Material(2.0, 0.4, "strain"), Material(1.0, -0.5, "strain")], ids=str
)


def slope(field: str, component: int, axis: int, material: Material = BEAM) -> np.ndarray:
    return central_difference(
        lambda x: getattr(beam(x, DEPTH, material), field)[:, component], X, np.eye(2)[axis], STEP
    )


def hooke(stress: np.ndarray, material: Material) -> np.ndarray:
    """Strains (3, p), Voigt, by the compliances of the solid: the stress out of the plane is that of `plane`."""
    (xx, yy, xy), E, nu = stress.T, material.young, material.poisson
    zz = nu * (xx + yy) if material.plane == "strain" else 0
    return np.stack([xx - nu * (yy + zz), yy - nu * (xx + zz), 2 * (1 + nu) * xy]) / E


def test_beam_is_in_equilibrium() -> None:
    largest = np.abs(beam(X, DEPTH).stress).max()
    for first, second in (((0, 0), (2, 1)), ((2, 0), (1, 1))):
        assert np.abs(slope("stress", *first) + slope("stress", *second)).max() < RTOL_DIFFERENCE * largest


@each_material
def test_strain_of_the_beam_follows_from_its_stress(material: Material) -> None:
    # with a displacement to every strain, the strains are compatible
    xx, yy, xy, yx = (slope("u", *of, material) for of in ((0, 0), (1, 1), (0, 1), (1, 0)))
    strain, expected = np.stack([xx, yy, xy + yx]), hooke(beam(X, DEPTH, material).stress, material)
    np.testing.assert_allclose(strain, expected, rtol=0, atol=1e-6 * np.abs(expected).max())  # STEP^2 / 6 / depth^2


def test_beam_meets_its_boundary_conditions() -> None:
    along = np.linspace(0, SLENDER * DEPTH, 7)
    for Y in (0.0, DEPTH):
        stress = beam(np.stack([along, np.full(7, Y)], axis=1), DEPTH).stress
        np.testing.assert_allclose(stress[:, 1:], 0, atol=1e-14)  # rounding
    base, top, tip = beam(beam_places(DEPTH), DEPTH).u  # type: ignore[arg-type]
    assert np.array_equal(base, [0, 0])
    assert top[0] == pytest.approx(0, abs=1e-14)
    # L^3 / 3EI of Bernoulli and the shear's (4 + 5 nu) depth^2 L / 24 EI
    L, i = SLENDER * DEPTH, DEPTH**3 / 12
    assert tip[1] == pytest.approx(-(L**3) / (3 * i) - (4 + 5 * BEAM.poisson) * DEPTH**2 * L / (24 * i), rel=1e-13)


def test_tractions_carry_the_unit_force_and_its_moment() -> None:
    x, force = beam_tractions(4)
    right = x[:, 0] > 0
    np.testing.assert_allclose(force[right].sum(axis=0), [0, -1], atol=1e-14)  # three Gauss points are exact
    np.testing.assert_allclose(force.sum(axis=0), 0, atol=1e-13)
    assert np.sum(x[:, 0] * force[:, 1] - x[:, 1] * force[:, 0]) == pytest.approx(0, abs=1e-12)


@each_material
def test_strain_energy_is_that_of_the_stress(material: Material) -> None:
    # Gauss points, exact for the quartic in y and the quadratic in x
    node, weight = leggauss(4)
    gx, gy = np.meshgrid((1 + node) / 2 * SLENDER * DEPTH, (1 + node) / 2 * DEPTH, indexing="ij")
    stress = beam(np.stack([gx.ravel(), gy.ravel()], axis=1), DEPTH, material).stress
    density = np.sum(stress.T * hooke(stress, material), axis=0) / 2
    area, energy = SLENDER * DEPTH**2, beam_energy(DEPTH, material)
    assert energy == pytest.approx(np.outer(weight, weight).ravel() @ density * area / 4, rel=1e-13)
    # and, by Clapeyron, half the work of the tractions
    x, force = beam_tractions(4)
    assert beam_energy(4, material) == pytest.approx(np.sum(force * beam(x, 4, material).u) / 2, rel=1e-12)


def order(coarse: Outcome, fine: Outcome, name: str) -> float:
    return float(observed_order(coarse.errors[name], fine.errors[name]))


@pytest.mark.parametrize(("degree", "expected"), [(1, 2.0), (2, 4.0)])
def test_finite_elements_converge_to_the_beam(degree: int, expected: float) -> None:
    # energy: twice the order of the stress; the next term is 1/8 of it on four elements over the depth
    coarse, fine = (beam_elements(n, degree)() for n in (4, 8))
    assert order(coarse, fine, "strain energy") == pytest.approx(expected, abs=0.2)


@pytest.mark.parametrize(("degree", "rates"), [(1, (2.0, 1.0)), (2, (3.0, 2.0))])
def test_finite_elements_converge_to_the_manufactured_solution(degree: int, rates: tuple[float, float]) -> None:
    # the next term is smaller by (wave number h)^2 < 0.15 at 8 elements
    coarse, fine = (np.array(manufactured.finite_elements(n, degree).errors) for n in (8, 16))
    np.testing.assert_allclose(observed_order(coarse, fine), rates, atol=0.1)


def test_cook_by_elements_is_too_stiff_and_converges() -> None:
    coarse, fine = (cook_elements(n, 1)().errors["tip displacement"] for n in (8, 16))
    assert 2.5 < coarse / fine < 4  # order 2, less for the singular corners of the clamp


@pytest.fixture(params=[tent, gimp, bspline2, bspline3])
def model(request: pytest.FixtureRequest) -> Model:
    function: ShapeFunction = request.param
    return points_model(beam_body(4), function, 2, Uniform(0.0))


def test_probes_reproduce_linear_fields(model: Model) -> None:
    A, b = np.array([[0.3, -0.2], [0.5, 0.7]]), np.array([1.0, 2.0])
    x = np.random.default_rng(1).uniform((0.1, 0.1), (15.9, 3.9), (20, 2))  # in end cells, too
    u = (model.grid.node_positions(model.transfer.nodes) @ A.T + b).ravel()
    probed = model.at(x, 0.05)
    np.testing.assert_allclose(probed.displacement(u), x @ A.T + b, atol=1e-13)  # rounding of numbers up to 12
    np.testing.assert_allclose(probed.strain(u), np.tile([0.3, 0.7, 0.3], (20, 1)), atol=1e-13)


def test_probes_give_forces_their_work(model: Model) -> None:
    rng = np.random.default_rng(2)
    x = rng.uniform((0.1, 0.1), (15.9, 3.9), (20, 2))
    forces, u = rng.normal(size=(20, 2)), rng.normal(size=2 * len(model.transfer.nodes))
    probed = model.at(x)
    work = np.sum(forces * probed.displacement(u))
    assert probed.force(forces) @ u == pytest.approx(work, rel=1e-12)


def test_a_probe_outside_the_body_is_refused(model: Model) -> None:
    with pytest.raises(ValueError, match="no material point"):
        model.at(np.array([[17.5, 2.0]]))


def test_stored_bytes() -> None:
    matrix = sp.csr_array(np.eye(3))
    index = matrix.indices.nbytes + matrix.indptr.nbytes
    assert stored_bytes(np.zeros((2, 5)), matrix, "no array") == 80 + 24 + index


def test_what_is_run() -> None:
    """Levels within the weights; crossed with 2 x 2 and 3 x 3 points only; no error below what is resolved."""

    def analysis(n: int, *case: object) -> Measure:
        return lambda: Outcome({"q": 4.0**-n}, 10 * n**2, 100 * n**2, 1_000)

    quantity = Quantity(
        "fake",
        analysis,
        analysis,
        levels=(1, 2, 3),
        element_levels={1: (1, 2, 3), 2: (2,)},
        crossings=(Periodic(4),),
        cells=lambda n: n**2,
        weights=9 * 2**2 * 3**2,  # quadratic B-splines: 3 x 3 points up to level 2
        resolved=0.05,
    )
    found = refined(quantity, lambda cases, label: iter(cases))
    levels = found.groupby(["method", "points", "ppc"])["n"].max()
    assert levels["quadratic B-spline", "uncrossed"].to_dict() == {1: 3, 2: 3, 3: 2, 4: 1}
    assert set(levels["standard", "periodic(4, 0.26)"].index) == {2, 3}
    assert found.groupby("method")["n"].count()[["FEM Q1", "FEM Q2"]].to_list() == [3, 1]
    assert set(found["error"]) == {0.25, 0.0625, 0.05}


def runs(errors: dict[str, list[float]]) -> pd.DataFrame:
    rows = [
        {"quantity": "q", "method": m, "ppc": 2, "points": "p", "unknowns": 10 * 4**k, "error": e}
        for m, all_errors in errors.items()
        for k, e in enumerate(all_errors)
    ]
    return settled(pd.DataFrame(rows))


def test_an_error_that_crosses_zero_is_not_settled() -> None:
    found = runs({"a": [1e-1, 1e-6, 1e-2, 1e-9]})
    # 1e-6 is followed by 1e-2; the last, 1e-9, counts as 1e-2 / 16, order four
    np.testing.assert_allclose(found["settled"], [1e-1, 1e-2, 1e-2, 1e-2 / 16], rtol=1e-12)


def test_a_case_of_two_levels_is_not_settled() -> None:
    found = runs({"a": [1e-2, 1e-8], "b": [1e-1, 5e-2, 2e-2]})
    assert np.all(np.isinf(found["settled"][:2]))
    assert set(front(found, "unknowns")["method"]) == {"b"}


def test_front_and_cheapest() -> None:
    found = runs({"a": [1e-1, 5e-2, 2e-2], "b": [5e-2, 1e-1, 1e-3]})
    best = front(found, "unknowns")
    # b's first level is not settled: its next one is worse
    assert list(zip(best["method"], best["unknowns"], strict=True)) == [("a", 10), ("a", 40), ("b", 160)]
    found_run = cheapest(found, "unknowns", 3e-2)
    assert found_run is not None
    assert (found_run["method"], found_run["unknowns"]) == ("a", 160)
    assert cheapest(found, "unknowns", 1e-9) is None


def test_slopes_are_of_the_last_levels() -> None:
    found = runs({"a": [7.0, 1e-1, 1e-1 / 4, 1e-1 / 16]})
    assert slopes(found)["q", "a", 2, "p"] == pytest.approx(-1.0, abs=1e-12)
