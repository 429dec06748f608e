"""VTU files reopen with what was written."""

from pathlib import Path

import meshio
import numpy as np
import pytest

from mpmtop import export
from mpmtop.equilibrium import discretise
from mpmtop.problem import DesignProblem
from tests.scenes import cantilever


def test_points_and_grid_round_trip(tmp_path: Path) -> None:
    model = discretise(cantilever(), 1.0)
    problem = DesignProblem(model)
    evaluation = problem.evaluate(problem.x0)
    state = evaluation.state
    export.write_points(tmp_path / "points.vtu", model, state, evaluation.rho)
    export.write_grid(tmp_path / "grid.vtu", model, state)

    points = meshio.read(tmp_path / "points.vtu")
    np.testing.assert_array_equal(points.points[:, :2], model.points.x)
    np.testing.assert_array_equal(points.point_data["rho"], evaluation.rho)
    np.testing.assert_array_equal(points.point_data["stress"], model.stress(state.moduli, state.strain))
    np.testing.assert_array_equal(points.point_data["half_length"][:, :2], model.points.half_length)
    np.testing.assert_array_equal(points.point_data["displacement"][:, :2], model.transfer.interpolate(state.u))

    grid = meshio.read(tmp_path / "grid.vtu")
    quads = grid.points[grid.cells_dict["quad"]][..., :2]
    np.testing.assert_array_equal(quads.min(axis=1) + 1.0, quads.max(axis=1))  # every cell is a unit square
    assert len(quads) == np.prod(model.grid.cells)
    # interpolating the exported nodal field at the points gives the exported point displacement
    nodal = grid.point_data["displacement"][model.transfer.nodes, :2]
    np.testing.assert_array_equal(model.transfer.interpolate(nodal.ravel()), points.point_data["displacement"][:, :2])
    assert sorted(p.name for p in tmp_path.iterdir()) == ["grid.vtu", "points.vtu"]


def test_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = discretise(cantilever(), 1.0)
    problem = DesignProblem(model)
    target = tmp_path / "grid.vtu"
    target.write_text("old")

    def broken(self: meshio.Mesh, path: str, **options: object) -> None:
        Path(path).write_text("half")
        raise OSError("disk full")

    monkeypatch.setattr(meshio.Mesh, "write", broken)
    with pytest.raises(OSError, match="disk full"):
        export.write_grid(target, model, problem.evaluate(problem.x0).state)
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]
