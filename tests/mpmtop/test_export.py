"""VTU files reopen with what was written, by either solver, and reactions balance the loads."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest

from mpmtop import export
from mpmtop.body import Body, Material, Support
from mpmtop.criteria import PNormStress
from mpmtop.design import Design
from mpmtop.fields import fields
from mpmtop.loads import PointLoad
from mpmtop.optimizers import GCMMA, optimize
from mpmtop.problem import DesignProblem
from mpmtop.problem import design_problem as points_problem
from mpmtop.region import Circle, Difference, Rectangle
from mpmtop.scene import Scene
from mpmtop.shape_functions import bspline2, bspline3, gimp, tent
from reference_fem.simp import DesignProblem as ElementProblem
from reference_fem.simp import design_problem
from tests.scenes import cantilever

SOLVERS = pytest.mark.parametrize("solver", ["points", "elements"])


def analysed(solver: str, **changes: Any) -> tuple[DesignProblem | ElementProblem, Any]:
    """A problem and the evaluation of an uneven design."""
    scene = cantilever(**changes)
    problem = points_problem(scene, 1.0, 2, gimp) if solver == "points" else design_problem(scene, 0.5)
    return problem, problem.evaluate(np.random.default_rng(3).uniform(0.2, 1, len(problem.x0)))


@SOLVERS
@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_points_round_trip(solver: str, plane: Any, tmp_path: Path) -> None:
    """Each cell is a quad of its true size; tensors are in VTK's order, with the strain Hooke's law asks for."""
    material = Material(2.0, 0.3, plane)
    problem, at = analysed(solver, material=material)
    export.write_points(tmp_path / "points.vtu", problem.model, at.state, at.rho)
    back = export.read_points(tmp_path / "points.vtu")
    assert np.array_equal(back.rho, at.rho) and back.points.volume == pytest.approx(0.25, rel=1e-12)
    assert np.array_equal(back.points.half_length, np.full((128, 2), 0.25))
    if isinstance(problem, DesignProblem):
        assert np.array_equal(back.points.x, problem.model.points.x)
    else:
        assert np.array_equal(back.points.x, problem.model.centres)

    file = meshio.read(tmp_path / "points.vtu")
    quads = file.points[file.cells_dict["quad"]]
    assert np.array_equal(quads.min(axis=1)[:, :2], back.points.x - 0.25)
    assert np.array_equal(quads.max(axis=1)[:, :2], back.points.x + 0.25)
    data = {name: parts[0] for name, parts in file.cell_data.items()}
    xx, yy, zz, xy, yz, xz = data["stress"].T
    assert not np.any([yz, xz]) and np.array_equal(zz, data["sigma_zz"])
    assert np.all(zz == 0) if plane == "stress" else zz == pytest.approx(0.3 * (xx + yy))
    moduli = at.state.moduli
    assert np.ptp(moduli) > 0.1
    hooke = (1.3 * data["stress"] - 0.3 * (xx + yy + zz)[:, None] * [1, 1, 1, 0, 0, 0]) / moduli[:, None]
    assert data["strain"] == pytest.approx(hooke, rel=0, abs=1e-12 * abs(hooke).max())  # zz too, of either plane
    full = np.zeros((128, 3, 3))
    for (a, b), s in zip([(0, 0), (1, 1), (2, 2), (0, 1)], (xx, yy, zz, xy), strict=True):
        full[:, a, b] = full[:, b, a] = s
    deviator = full - np.trace(full, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3
    assert data["von_mises"] == pytest.approx(np.sqrt(1.5 * np.sum(deviator**2, axis=(1, 2))))
    same = data["von_mises"] == pytest.approx(data["von_mises_in_plane"])
    assert same == (plane == "stress")
    assert [p.name for p in tmp_path.iterdir()] == ["points.vtu"]


def test_von_mises_of_a_run() -> None:
    """The largest of an optimised beam, with sigma_zz of plane strain 1.489; that of the plane reads 1.904."""
    clamp, load = Support(Rectangle((-1, 0), (0, 20))), PointLoad((40, 10), (0, -1))
    scene = Scene("beam", Body(Rectangle((0, 0), (40, 20)), (clamp,), (load,)), Design(0.4, 1.5), PNormStress(8.0, 0.5))
    problem = points_problem(scene, 2.0, 2, gimp)
    *_, last = optimize(problem, GCMMA(), max_iterations=20)
    at = fields(problem.model, last.evaluation.state, last.evaluation.rho)
    assert export.von_mises(at.stress).max() == pytest.approx(1.489, abs=5e-4)  # digits of the stated value
    assert export.von_mises_in_plane(at.stress).max() == pytest.approx(1.904, abs=5e-4)


MODELS: dict[str, Any] = {
    "tent": lambda scene: points_problem(scene, 1.0, 2, tent),
    "GIMP, cut cells, ghost penalty": lambda scene: points_problem(scene, 1.0, 2, gimp, ghost=0.05),
    "quadratic": lambda scene: points_problem(scene, 1.0, 2, bspline2),
    "cubic": lambda scene: points_problem(scene, 1.0, 2, bspline3),
    "B-bar": lambda scene: points_problem(scene, 1.0, 2, tent, b_bar=True),
    "bilinear": lambda scene: design_problem(scene, 0.5),
    "biquadratic": lambda scene: design_problem(scene, 0.5, 2),
}


@pytest.mark.parametrize("name", MODELS)
def test_reactions_balance_the_loads(name: str, tmp_path: Path) -> None:
    """Force and moment about the origin vanish to 1e-10 of the load; rounding takes 1e-13."""
    body = Rectangle((0.0, 0.0), (8.0, 4.0))
    domain = Difference(body, Circle((4.0, 4.0), 1.4)) if "cut" in name else body
    problem = MODELS[name](cantilever(domain=domain, load=PointLoad((8.0, 3.0), (0.4, -1.0))))
    at = problem.evaluate(np.random.default_rng(5).uniform(0.2, 1, len(problem.x0)))
    if "ghost" in name:
        assert problem.model.ghost.modulus.shape[0] > 0
    export.write_nodes(tmp_path / "nodes.vtu", problem.model, at.state, at.rho)
    file = meshio.read(tmp_path / "nodes.vtu")
    load, reaction = file.point_data["load"], file.point_data["reaction"]
    assert load.sum(axis=0) == pytest.approx([0.4, -1, 0], abs=1e-12)
    assert reaction.sum(axis=0) == pytest.approx([-0.4, 1, 0], abs=1e-10)
    moment = np.cross(file.points, load + reaction).sum(axis=0)
    assert moment == pytest.approx(0, abs=1e-9)  # arms of eight
    assert abs(np.cross(file.points, reaction).sum(axis=0)[2]) > 1  # it is not zero by itself
    where = fields(problem.model, at.state, at.rho).layout
    assert np.all(where.nodes[np.any(where.held, axis=1), 0] <= 1e-12)
    assert not np.any(reaction[:, :2][~where.held])


@SOLVERS
def test_corners_move_with_the_body(solver: str, tmp_path: Path) -> None:
    """Under a homogeneous strain the corners of neighbours meet, and each moves as the field says at its place."""
    problem, at = analysed(solver)
    gradient, shift = np.array([[0.01, 0.03], [-0.02, 0.04]]), np.array([0.5, -0.1])
    where = fields(problem.model, at.state, at.rho).layout
    u = where.nodes @ gradient.T + shift
    if isinstance(problem, DesignProblem):
        flat = u.ravel()
    else:
        flat = np.zeros(problem.model.basis.N)
        for a, dofs in enumerate(problem.model.basis.split_indices()):
            flat[dofs] = u[:, a]
    state = type(at.state)(**(vars(at.state) | {"u": flat}))
    export.write_points(tmp_path / "moved.vtu", problem.model, state, at.rho)
    file = meshio.read(tmp_path / "moved.vtu")
    expected = file.points[:, :2] @ gradient.T + shift
    assert file.point_data["displacement"][:, :2] == pytest.approx(expected, abs=1e-13)
    centres = export.read_points(tmp_path / "moved.vtu").points.x
    assert file.cell_data["displacement"][0][:, :2] == pytest.approx(centres @ gradient.T + shift, abs=1e-13)


def test_grid(tmp_path: Path) -> None:
    problem, at = analysed("points")
    export.write_grid(tmp_path / "grid.vtu", problem.model, at.state)
    grid = meshio.read(tmp_path / "grid.vtu")
    quads = grid.points[grid.cells_dict["quad"]][..., :2]
    assert np.array_equal(quads.min(axis=1) + 1.0, quads.max(axis=1))  # every cell is a unit square
    assert len(quads) == np.prod(problem.model.grid.cells)
    active = problem.model.transfer.nodes
    assert np.array_equal(np.flatnonzero(grid.point_data["active"]), active)
    assert np.array_equal(grid.point_data["displacement"][active, :2].ravel(), at.state.u)
    assert grid.point_data["reaction"].sum(axis=0) == pytest.approx([0, 1, 0], abs=1e-10)


@SOLVERS
def test_what_is_not_finite_is_refused_by_name(solver: str, tmp_path: Path) -> None:
    problem, at = analysed(solver)
    rho = at.rho.copy()
    rho[7] = np.nan
    with pytest.raises(ValueError, match="density is not finite at 1 of 128 places, the first is number 7"):
        export.write_points(tmp_path / "points.vtu", problem.model, at.state, rho)
    broken = type(at.state)(**(vars(at.state) | {"u": np.full_like(at.state.u, np.inf)}))
    with pytest.raises(ValueError, match="displacement is not finite"), np.errstate(invalid="ignore"):
        export.write_nodes(tmp_path / "nodes.vtu", problem.model, broken, at.rho)
    assert not list(tmp_path.iterdir())
    with pytest.raises(TypeError, match=r"give problem\.model"):
        export.write_points(tmp_path / "points.vtu", problem, at.state, at.rho)


@SOLVERS
def test_a_series_can_be_opened_while_it_grows_and_goes_on(solver: str, tmp_path: Path) -> None:
    problem, _ = analysed(solver)
    path, checkpoint = tmp_path / "run.pvd", tmp_path / "run.npz"

    def listed() -> list[tuple[str, str]]:
        return [(d.attrib["timestep"], d.attrib["file"]) for d in ElementTree.parse(path).getroot().iter("DataSet")]

    for last in (2, 4):
        run = optimize(problem, GCMMA(), max_iterations=last, checkpoint=checkpoint)
        for iterate in export.series(path, problem.model, run):
            assert listed()[-1][0] == str(iterate.iteration)
            design = export.read_points(tmp_path / listed()[-1][1])
            assert np.array_equal(design.rho, iterate.evaluation.rho)
    assert [int(step) for step, _ in listed()] == list(range(int(listed()[0][0]), 5))
    assert not list(tmp_path.rglob("*.partial"))


def test_files_of_others_are_refused(tmp_path: Path) -> None:
    meshio.Mesh(np.zeros((4, 3)), [("quad", [[0, 1, 2, 3]])]).write(tmp_path / "other.vtu")
    with pytest.raises(ValueError, match="no cell data position, half_length, volume, density; give a file"):
        export.read_points(tmp_path / "other.vtu")


def test_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    problem, at = analysed("points")
    target = tmp_path / "grid.vtu"
    target.write_text("old")

    def broken(self: meshio.Mesh, path: str, **options: object) -> None:
        Path(path).write_text("half")
        raise OSError("disk full")

    monkeypatch.setattr(meshio.Mesh, "write", broken)
    with pytest.raises(OSError, match="disk full"):
        export.write_grid(target, problem.model, at.state)
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]
