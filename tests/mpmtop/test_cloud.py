"""A body of points from a file is the body that they were taken from."""

from pathlib import Path

import numpy as np
import pytest

from mpmtop import (
    Circle,
    Cloud,
    Design,
    Difference,
    PointLoad,
    Rectangle,
    Scene,
    design_problem,
    export,
    read_cloud,
    seed,
)
from mpmtop.body import Body, Support
from mpmtop.errors import InvalidScene

PLATE = Difference(Rectangle((-1.0, 2.0), (3.0, 4.0)), Circle((1.0, 3.0), 0.6))
POINTS = seed(PLATE, (0.25, 0.25))


def written(folder: Path) -> Path:
    path = folder / "scan.csv"
    path.write_text("name,y,x\n" + "".join(f"p,{y!r},{x!r}\n" for x, y in POINTS.x.tolist()))
    return path


def test_points_seeded_in_a_cloud_are_those_of_the_file(tmp_path: Path) -> None:
    cloud = read_cloud(written(tmp_path))
    assert np.allclose(cloud.bounds, PLATE.bounds, rtol=0, atol=1e-12)
    again = seed(cloud, (0.25, 0.25))
    assert np.allclose(again.x, POINTS.x, rtol=0, atol=1e-12)
    assert np.allclose(again.volume.sum(), POINTS.volume.sum())


def test_a_design_of_a_vtu_is_a_body(tmp_path: Path) -> None:
    clamp = Support(Rectangle((-1.0, 2.0), (-1.0, 4.0)))
    body = Body(PLATE, (clamp,), (PointLoad((3.0, 3.0), (0.0, -1.0)),))
    problem = design_problem(Scene("plate", body, Design(0.5, 0.5)), 0.5, 2)
    evaluation = problem.evaluate(problem.x0)
    export.write_points(tmp_path / "design.vtu", problem.model, evaluation.state, evaluation.rho)
    assert np.allclose(seed(read_cloud(tmp_path / "design.vtu"), (0.25, 0.25)).x, POINTS.x, rtol=0, atol=1e-12)


def test_a_cloud_grows_and_shrinks_by_a_tolerance() -> None:
    cloud = Cloud(np.array([[0.0, 0.0]]), (1.0, 2.0))
    at = np.array([[1.0, 0.0], [1.1, 0.0], [0.95, 0.0], [0.0, 2.0]])
    assert cloud.contains(at).tolist() == [True, False, True, True]
    assert cloud.contains(at, 0.15).tolist() == [True, True, True, True]
    assert cloud.contains(at, -0.1).tolist() == [False, False, False, False]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a,b\n1,2\n", "columns x and y"),
        ("x,y\n1,two\n", "numbers in every row"),
        ("x,y\n", "holds no point"),
        ("x,y\n1,2\n1,3\n", "no spacing across"),
    ],
)
def test_a_file_without_a_body_is_refused(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "scan.csv"
    path.write_text(text)
    with pytest.raises(InvalidScene, match=said):
        read_cloud(path)


def test_points_without_a_place_or_a_size_are_refused() -> None:
    for x, half in (
        (np.zeros((0, 2)), (1.0, 1.0)),
        (np.full((1, 2), np.nan), (1.0, 1.0)),
        (np.zeros((1, 2)), (0.0, 1.0)),
    ):
        with pytest.raises(InvalidScene):
            Cloud(x, half)
