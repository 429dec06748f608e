"""Pictures show what was computed, for both solvers; they are looked at through their artists, not their pixels."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.image
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from mpmtop import plot
from mpmtop.body import Bed, Body, EdgeSupport, Material, Part, Spring, Support
from mpmtop.design import Design
from mpmtop.fields import SCALARS, fields, rectangles
from mpmtop.loads import Pressure, RegionLoad, Traction
from mpmtop.model import discretise
from mpmtop.optimizers import GCMMA, optimize
from mpmtop.problem import design_problem as points_problem
from mpmtop.region import Circle, Difference, Rectangle
from mpmtop.scene import LoadCase, Scene
from mpmtop.shape_functions import gimp
from reference_fem.hole import around_hole
from reference_fem.simp import design_problem
from tests.scenes import LEFT_CLAMP, cantilever

HOLE = Circle((3.0, 2.0), 1.0)
SCENE = cantilever(
    domain=Difference(Rectangle((0.0, 0.0), (8.0, 4.0)), HOLE),
    supports=(LEFT_CLAMP, Support(Rectangle((8.0, 0.0), (8.0, 0.0)), (False, True))),
    loads=(RegionLoad(Rectangle((5.0, 3.5), (6.0, 4.0)), (0.5, -1.0)),),
    passive_solid=Rectangle((7.0, 1.0), (8.0, 3.0)),
)
PROBLEMS: dict[str, Any] = {
    "points": lambda: points_problem(SCENE, 1.0, 2, gimp),
    "elements": lambda: design_problem(SCENE, 0.5),
    "elements around the hole": lambda: design_problem(SCENE, mesh=around_hole((0, 0), (8, 4), (3, 2), 1.0, 0.5)),
}
SOLVERS = pytest.mark.parametrize("solver", PROBLEMS)


@pytest.fixture(autouse=True)
def _closed() -> Any:
    yield
    plt.close("all")


def values(ax: plt.Axes) -> np.ndarray:
    """What the picture's coloured cells hold, gaps left out."""
    for image in ax.images:
        return np.ma.filled(image.get_array(), np.nan)[np.isfinite(np.ma.filled(image.get_array(), np.nan))]
    coloured = [c for c in ax.collections if isinstance(c, PolyCollection) and c.get_array() is not None]
    return np.asarray(coloured[0].get_array())


@SOLVERS
def test_every_field_in_one_line(solver: str) -> None:
    problem = PROBLEMS[solver]()
    at = problem.evaluate(np.random.default_rng(0).uniform(0.2, 1, len(problem.x0)))
    told = fields(problem.model, at.state, at.rho)
    assert np.sort(values(plot.design(problem.model, at))) == pytest.approx(np.sort(at.rho))
    for name, (label, of) in SCALARS.items():
        ax = plot.field(problem.model, at, name)
        assert np.sort(values(ax)) == pytest.approx(np.sort(of(told)))
        assert ax.figure.axes[1].get_ylabel() == label
        assert ax.get_aspect() == 1.0
        lower, upper = (ax.images or [c for c in ax.collections if c.get_array() is not None])[0].get_clim()
        signed = name.endswith(plot.SIGNED)
        assert lower == -upper if signed else lower == 0.0
        plt.close(ax.figure)
    with pytest.raises(ValueError, match="say one of density, young, "):
        plot.field(problem.model, at, "mises")


@SOLVERS
def test_deformed_body(solver: str) -> None:
    """The corners drawn are those at rest plus the scale times what they move; by itself it is a tenth of the side."""
    problem = PROBLEMS[solver]()
    at = problem.evaluate(problem.x0)
    told = fields(problem.model, at.state, at.rho)
    ax = plot.deformed(problem.model, at, "von_mises", scale=0.02)
    drawn = next(c for c in ax.collections if c.get_array() is not None)
    corners = np.array([path.vertices[:4] for path in drawn.get_paths()])
    assert corners == pytest.approx(told.layout.corners + 0.02 * told.corner_displacement)
    ax = plot.deformed(problem.model, at)
    drawn = next(c for c in ax.collections if c.get_array() is not None)
    corners = np.array([path.vertices[:4] for path in drawn.get_paths()])
    assert np.hypot(*(corners - told.layout.corners).reshape(-1, 2).T).max() == pytest.approx(0.8)


@SOLVERS
def test_scene(solver: str) -> None:
    problem = PROBLEMS[solver]()
    ax = plot.scene(SCENE, problem.model)
    where = fields(problem.model, (at := problem.evaluate(problem.x0)).state, at.rho).layout
    marks = {c.get_label(): np.asarray(c.get_offsets()) for c in ax.collections if c.get_label()[0] != "_"}
    assert np.array_equal(marks["points, or element centres"], where.x)
    assert np.array_equal(marks["held nodes"], where.nodes[np.all(where.held, axis=1)])
    assert np.array_equal(marks["held in one component"], [[8.0, 0.0]])
    said = {text.get_text() for text in ax.get_legend().get_texts()}
    assert said == {"passive solid", "held nodes", "held in one component", "points, or element centres", "load"}
    (arrow,) = ax.texts
    step = np.array(arrow.xyann) - arrow.xy
    assert -step / np.hypot(*step) == pytest.approx(np.array([0.5, -1]) / np.hypot(0.5, 1))
    assert arrow.xyann == pytest.approx((5.5, 3.75), abs=0.05)  # a pixel or two
    alone = plot.scene(SCENE)
    assert len(alone.images) == 4  # domain, passive solid, two supports
    picture = np.isfinite(np.asarray(alone.images[0].get_array(), float))
    assert picture.mean() == pytest.approx(1 - np.pi / 32, abs=0.01)


def test_history_and_given_axes() -> None:
    problem = PROBLEMS["points"]()
    iterates = list(optimize(problem, GCMMA(), max_iterations=3))
    figure, (left, right) = plt.subplots(1, 2)
    assert plot.history(iterates, left) is left and plot.design(problem.model, iterates[-1].evaluation, right) is right
    k, objective = left.lines[0].get_data()
    assert list(k) == [it.iteration for it in iterates] and list(objective) == [it.objective for it in iterates]
    assert list(figure.axes[2].lines[0].get_ydata()) == [it.constraints[0] for it in iterates]
    with pytest.raises(ValueError, match="keep those"):
        plot.history([])


@pytest.mark.parametrize("solver", ["points", "elements"])
def test_live(solver: str, tmp_path: Path) -> None:
    """Files by iteration, the last one too, and the newest by one name; a GIF with as many frames; all passed on."""
    problem = PROBLEMS[solver]()
    for step, iterate in enumerate(plot.live(tmp_path, problem.model, optimize(problem, GCMMA(), max_iterations=3), 2)):
        assert iterate.iteration == step
        assert (tmp_path / "latest.png").exists()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["00000.png", "00002.png", "00003.png", "latest.png"]
    assert matplotlib.image.imread(tmp_path / "latest.png").std() > 0.05
    gif = tmp_path / "run.gif"
    list(plot.live(gif, problem.model, optimize(problem, GCMMA(), max_iterations=3), 2))
    from PIL import Image

    with Image.open(gif) as picture:
        assert picture.n_frames == 3
    assert not plt.get_fignums()


def test_a_lattice_is_one_image_and_the_rest_one_collection() -> None:
    """Also with a gap; of other sizes, turned, one above another or mostly empty, it is none."""
    x = np.stack(np.meshgrid(np.arange(4) + 0.5, np.arange(3) + 0.5), axis=-1).reshape(-1, 2)
    square = rectangles(x, np.full(2, 0.5))

    def kind(corners: np.ndarray) -> str:
        return type(plot.cells(plt.subplots()[1], corners, np.arange(len(corners), dtype=float))).__name__

    assert kind(square) == kind(square[1:]) == kind(square[:, ::-1]) == "AxesImage"
    turned = square @ np.array([[0.8, 0.6], [-0.6, 0.8]])
    mixed = np.concatenate([square, rectangles(np.array([[4.25, 0.25]]), np.full(2, 0.25))])
    for other in (
        rectangles(x, np.full(2, 0.4)),
        turned,
        mixed,
        np.concatenate([square, square[:1]]),
        np.stack([square[0], square[0] + 100]),
    ):
        assert kind(other) == "PolyCollection"
    ax = plt.subplots()[1]
    image = plot.cells(ax, square, x[:, 0] + 10 * x[:, 1])
    assert np.asarray(image.get_array())[2, 1] == 26.5  # type: ignore[index]
    assert tuple(image.get_extent()) == (0, 4, 0, 3)  # type: ignore[union-attr]


def test_import_loads_neither_matplotlib_nor_meshio() -> None:
    """`import mpmtop` and `mpmtop.plot` are quick: pictures are paid for when they are drawn."""
    code = "import sys, mpmtop, mpmtop.plot; print({'matplotlib', 'meshio', 'skfem'} & set(sys.modules))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "set()"


def test_a_scene_shows_the_loads_of_all_its_cases() -> None:
    body = SCENE.body
    cases = tuple(LoadCase((replace(body.loads[0], force=force),)) for force in ((1.0, 0.0), (0.0, 1.0)))
    both = plot.scene(replace(SCENE, body=replace(body, loads=()), cases=cases))
    assert len(both.texts) == 2 * len(plot.scene(SCENE).texts) > 0  # an arrow is an annotation


def test_a_scene_shows_parts_and_supports_of_every_kind() -> None:
    """Each with its own word in the legend; what a body does not have has none."""
    wide = Rectangle((0, 0), (8, 4))
    supports = (
        EdgeSupport(Rectangle((0, 0), (0, 4))),
        Bed(Rectangle((0, 0), (8, 0)), 0.1, "normal"),
        Spring((8, 4), 0.2, (1, 0)),
        Support(Rectangle((8, 0), (8, 1)), (True, False), (0.01, 0.0)),
    )
    layers = (
        Part(Rectangle((0, 2), (8, 4)), Material(10.0, 0.2)),
        Part(Rectangle((3, 0), (4, 1)), Material(0.1, 0.3)),
    )
    loads = (Pressure(Rectangle((0, 4), (8, 4)), 1.0), Traction(Rectangle((8, 1), (8, 4)), lambda x: 0 * x + [0, 1]))
    body = Body(wide, supports, loads, parts=layers)
    for model in (None, discretise(body, 1.0)):
        ax = plot.scene(Scene("all", body, Design(0.5, 1.0)), model)
        said = [text.get_text() for text in ax.get_legend().get_texts()]
        kinds = ["held along the edge", "elastic bed", "spring", "load", "displaced"]
        assert said[:2] == ["E0 = 10, nu = 0.2", "E0 = 0.1, nu = 0.3"] and said[-5:] == kinds
        assert said[2:-5] == (["support"] if model is None else ["points, or element centres", "held in one component"])
        hatched = [c.hatches for c in ax.collections if getattr(c, "hatches", [None])[0]]
        assert hatched == [["//"], ["xx"]]
        edge, bed, spring = (line for line in ax.lines if str(line.get_label()) in kinds)
        assert set(np.asarray(edge.get_xdata())) == {0.0} and set(np.asarray(bed.get_ydata())) == {0.0}
        assert (list(spring.get_xdata()), list(spring.get_ydata())) == ([8.0], [4.0])
        assert len(ax.texts) > 10  # of the pressure, the traction and the displacement
    plain = plot.scene(Scene("plain", Body(wide, (Support(Rectangle((-1, 0), (0, 4))),), loads[:1]), Design(0.5, 1.0)))
    assert [text.get_text() for text in plain.get_legend().get_texts()] == ["support", "load"]
