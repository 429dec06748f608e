"""What load steps show in pictures and files, and what they do not."""

from pathlib import Path

import matplotlib.pyplot as plt
import meshio
import numpy as np
import pytest

from mpmtop import export, plot
from mpmtop.design import Design
from mpmtop.fields import fields
from mpmtop.large_deformation.problem import LoadStepProblem
from mpmtop.large_deformation.step import operators, start
from mpmtop.large_deformation.steps import trajectory
from mpmtop.optimizers import GCMMA, optimize
from mpmtop.region import Rectangle
from tests.mpmtop.large_deformation.cases import METHODS, model, moduli


@pytest.mark.parametrize("method", ["total", "GIMP, free"])
def test_fields_are_those_of_the_body_at_full_load(method: str) -> None:
    """Reactions balance the loads where no background holds; corners of neighbours meet to second order."""
    body = model(METHODS[method], steps=4)
    path = trajectory(body, moduli())
    at = fields(body, path, np.ones(200))
    np.testing.assert_allclose(at.reaction.sum(axis=0), -body.force.sum(axis=0), atol=1e-10)
    np.testing.assert_allclose(at.layout.load.sum(axis=0), body.force.sum(axis=0), atol=1e-15)
    np.testing.assert_allclose(at.corner_displacement.mean(axis=1), at.displacement, atol=1e-13)
    area = at.layout.corners + at.corner_displacement
    a, b = area[:, 2] - area[:, 0], area[:, 3] - area[:, 1]
    J = np.linalg.det(path.states[-1].F)
    np.testing.assert_allclose((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2, J * at.layout.volume, rtol=1e-12)
    np.testing.assert_allclose(at.strain[:, :2].sum(axis=1), np.log(J), atol=1e-12)
    trace = at.stress[:, 0] + at.stress[:, 1]
    # Hencky's law in plane strain: tau_zz = nu (tau_xx + tau_yy)
    np.testing.assert_allclose(at.stress[:, 3], 0.3 * trace, atol=1e-12)


def test_designs_are_drawn_and_written(tmp_path: Path) -> None:
    design = Design(0.5, 3.0, passive_solid=Rectangle((18, 2), (20, 8)))
    of = LoadStepProblem(model(METHODS["GIMP"], load=4e-3, steps=2), design)
    *_, last = export.series(tmp_path / "run.pvd", of.model, optimize(of, GCMMA(), max_iterations=1))
    for axes in (
        plot.design(of.model, last.evaluation),
        plot.field(of.model, last.evaluation, "von_mises"),
        plot.deformed(of.model, last.evaluation, scale=1.0),
    ):
        plt.close(axes.figure)  # type: ignore[arg-type]
    export.write_points(tmp_path / "points.vtu", of.model, last.evaluation.state, last.evaluation.rho)
    written = meshio.read(tmp_path / "points.vtu").cell_data["displacement"][0][:, :2]
    np.testing.assert_array_equal(written, last.evaluation.path.displacement())


@pytest.mark.parametrize("method", ["total", "GIMP, free"])
def test_nodes_are_written_with_displacements_where_they_keep_them(method: str, tmp_path: Path) -> None:
    """Those of the total frame, which displace the points; a grid that is reset has reactions only."""
    body = model(METHODS[method], steps=2)
    path = trajectory(body, moduli())
    export.write_nodes(tmp_path / "nodes.vtu", body, path, np.ones(200))
    written = meshio.read(tmp_path / "nodes.vtu").point_data
    np.testing.assert_allclose(written["reaction"].sum(axis=0)[:2], -body.force.sum(axis=0), atol=1e-10)
    assert ("displacement" in written) == (method == "total")
    if method == "total":
        N = operators(body, start(body)).N
        np.testing.assert_allclose(N @ written["displacement"][:, :2], path.displacement(), atol=1e-12 * 20)
