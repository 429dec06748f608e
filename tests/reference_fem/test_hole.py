"""Body-fitted meshes: the rectangle with a circular hole, and the finite element model on quads of any shape."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from skfem import MeshQuad

from mpmtop.errors import InvalidScene, UnsupportedBody
from mpmtop.region import Circle, Difference
from reference_fem.hole import around_hole
from reference_fem.mesh import element_centres
from reference_fem.simp import design_problem
from tests.reference_fem.plates import BODY, HOLE, area, cantilever, corner_areas, edges_of, plate
from validation.measures.orders import observed_order


def check(mesh: MeshQuad, upper: tuple[float, float], hole: Circle, size: float) -> None:
    """Convex, conforming, around one hole whose nodes lie on the circle."""
    assert corner_areas(mesh).min() > 0
    pairs, elements = edges_of(mesh)
    assert mesh.p.shape[1] - len(elements) + mesh.t.shape[1] == 0  # Euler characteristic of a body with one hole
    assert elements.max() == 2
    boundary = mesh.p[:, pairs[:, elements == 1]]
    radius = np.hypot(*(boundary - np.reshape(hole.centre, (2, 1, 1))))
    circle = np.all(np.abs(radius - hole.radius) < 1e-12 * max(upper), axis=0)  # rounding of coordinates
    outer = np.zeros(len(circle), bool)
    for a in range(2):
        for side in (0.0, upper[a]):
            outer |= np.all(np.abs(boundary[a] - side) < 1e-12 * max(upper), axis=0)
    assert np.all(circle ^ outer)
    assert outer.sum() == round(2 * (upper[0] + upper[1]) / size)
    # a polygon with its corners on the circle: the angles of its n edges sum to a turn
    angle = 2 * np.arcsin(np.hypot(*(boundary[:, 1, circle] - boundary[:, 0, circle])) / (2 * hole.radius))
    assert angle.sum() == pytest.approx(2 * np.pi, rel=1e-12)
    polygon = hole.radius**2 * np.sin(angle).sum() / 2
    assert area(mesh) == pytest.approx(upper[0] * upper[1] - polygon, rel=1e-12)
    assert mesh.is_valid()


@settings(max_examples=60, deadline=None)
@given(
    x=st.floats(0.5, 11.5), y=st.floats(0.5, 7.5), radius=st.floats(0.25, 4.0), size=st.sampled_from([0.25, 0.5, 1.0])
)
def test_any_hole_that_fits_has_a_mesh(x: float, y: float, radius: float, size: float) -> None:
    assume(2 * radius >= size and min(x, 12 - x, y, 8 - y) - radius >= size / 2)
    mesh = around_hole((0, 0), (12, 8), (x, y), radius, size)
    check(mesh, (12, 8), Circle((x, y), radius), size)


@pytest.mark.parametrize("size", [3.0, 1.5, 0.5])
def test_mesh_of_the_plate(size: float) -> None:
    """The O-grid fills the box [0, 30]^2 from its perimeter nodes, and the rest are cells of the lattice."""
    mesh = plate(size)
    check(mesh, (45, 30), HOLE, size)
    centres = element_centres(mesh)
    cells = centres[:, 0] > 30
    assert cells.sum() == (15 / size) * (30 / size)
    assert np.all(corner_areas(mesh)[:, cells] == pytest.approx(size**2 / 2, rel=1e-10))
    assert np.count_nonzero(~cells) % round(120 / size) == 0  # whole layers
    corners = mesh.p[:, mesh.t[:, ~cells]]
    side = np.hypot(*(np.roll(corners, -1, axis=1) - corners))
    aspect = np.log((side[0] + side[2]) / (side[1] + side[3]))  # along the rays over across them
    # square on average, to 10 %: layers cross the rays obliquely towards the box's corners, and their number is whole
    assert abs(aspect.mean()) < np.log(1.1)
    assert np.abs(aspect).max() < np.log(2.2)  # rays are twice as dense towards the box's corners as between them


def test_area_is_of_second_order() -> None:
    """The chords of a circle: twice as many leave a quarter of the error."""
    error = [area(plate(size)) - (1350 - 100 * np.pi) for size in (1.5, 0.75, 0.375)]
    assert min(error) > 0
    assert observed_order(error[:-1], error[1:]) == pytest.approx(2, abs=0.01)  # angle^5 of the sine, 0.1^2 / 20


def test_cells_may_be_oblong() -> None:
    mesh = around_hole((-1, 2), (5, 5), (1, 3.5), 1.0, (0.5, 0.25))
    assert corner_areas(mesh).min() > 0
    assert area(mesh) == pytest.approx(18 - np.pi, rel=2e-3)  # 48 chords: pi (2 pi / 48)^2 / 6 = 9e-3 in 15
    assert np.array_equal(mesh.p.min(axis=1), [-1, 2]) and np.array_equal(mesh.p.max(axis=1), [5, 5])


@pytest.mark.parametrize(
    ("centre", "radius", "size", "advice"),
    [
        ((15, 15), 0.7, 1.5, "use smaller ones"),
        ((15, 15), 15.0, 1.5, "move it inwards"),
        ((40, 15), 4.5, 1.5, "move it inwards"),
        ((60, 15), 4.5, 1.5, "move it inwards"),
        ((15, 15), np.nan, 1.5, "use smaller ones"),
        ((15, 15), -3.0, 1.5, "use smaller ones"),
        ((15, 15), 10.0, 2.0, "divide"),
    ],
)
def test_holes_that_are_refused(centre: tuple[float, float], radius: float, size: float, advice: str) -> None:
    with pytest.raises(InvalidScene, match=advice):
        around_hole((0, 0), (45, 30), centre, radius, size)


def test_holes_of_stairs() -> None:
    """On the voxel mesh a hole inside the body never leaves a loose or a hinged element, whatever it cuts.

    A disc that holds two opposite corners of a square holds a third: the sums of their squared distances to its centre
    are equal. So two elements that meet in a corner alone are not what a disc can leave of a lattice.
    """
    rng = np.random.default_rng(7)
    for radius in rng.uniform(0.5, 14, 20):
        centre = rng.uniform((radius, radius), (45 - radius, 30 - radius))
        p = design_problem(cantilever(domain=Difference(BODY, Circle(tuple(centre), radius))), 1.0)
        at = p.evaluate(p.x0)
        assert 0 < at.objective < np.inf and np.all(np.isfinite(p.gradient(at)[0]))


def test_hole_that_cuts_off_a_chip() -> None:
    """Named, with its place, if the hole is absence; as passive void, it hangs on what is left of the stiffness."""
    chip = Circle((31.7, 24.6), 13.75)
    with pytest.raises(UnsupportedBody, match=r"1 of 2 .* rigidly, the first around \[44\.75 29\.5"):
        design_problem(cantilever(domain=Difference(BODY, chip)), 0.5)
    void = design_problem(cantilever(domain=BODY, passive_void=chip), 0.5)
    assert 0 < void.evaluate(void.x0).objective < np.inf
