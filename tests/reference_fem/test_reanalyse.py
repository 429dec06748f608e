"""The judge: designs on a finer mesh."""

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.body import Body, Support
from mpmtop.design import Design
from mpmtop.errors import EmptyDomain, InvalidScene
from mpmtop.loads import PointLoad, PositionLoad, RegionLoad
from mpmtop.model import discretise as discretise_points
from mpmtop.region import Circle, Rectangle
from mpmtop.scene import Scene
from reference_fem.elasticity import discretise, solve
from reference_fem.reanalyse import build_judge, owners, reanalyse
from reference_fem.simp import simp
from tests.reference_fem.bodies import cantilever, densities


def points(spacing: float) -> tuple[Array, Array]:
    model = discretise(cantilever().body, spacing)
    return model.centres, np.full((len(model.area), 2), spacing / 2)


@pytest.mark.parametrize("order", [1, 2])
def test_judge_at_one_element_per_point_is_the_model(order: int) -> None:
    """Without refinement the judge is the finite element model; in bilinear elements its loads are the same, too."""
    x, half = points(1.0)
    rho = densities(800)
    scene = cantilever(RegionLoad(Rectangle((39, 0), (40, 20)), (0, -1)))
    model = discretise(scene.body, 1.0, order)
    judgement = reanalyse(scene, x, half, rho, split=1, order=order)
    u = solve(model, simp(rho, scene.body.material, scene.design)[0])
    assert judgement.elements == 800
    if order == 1:
        assert judgement.compliance == pytest.approx(model.f_ext @ u, rel=1e-12)  # the same matrix
    else:
        assert judgement.compliance < model.f_ext @ u  # spread, the forces do less work than as point forces


def test_judge_converges_from_below() -> None:
    """Compliance of a displacement method rises with refinement, by ever smaller amounts; so does it with the order."""
    scene = cantilever()
    x, half = points(2.0)
    rho = densities(200)
    coarse, middle, fine = (reanalyse(scene, x, half, rho, split=k).compliance for k in (1, 2, 4))
    assert coarse < middle < fine
    assert fine - middle < 0.7 * (middle - coarse)  # corners of the density field allow about h^1: halved
    assert reanalyse(scene, x, half, rho, split=2, order=1).compliance < middle


def test_judge_serves_mixed_sizes() -> None:
    """Four quarter-size points of one density are their parent; the order of the points does not matter."""
    scene = cantilever(RegionLoad(Rectangle((30, 0), (40, 20)), (0, -1)))
    x, half = points(2.0)
    rho = densities(200)
    judge = build_judge(scene, x, half, split=4)
    fine = np.flatnonzero(x[:, 0] > 30)  # exactly the loaded points, so that the shares stay equal
    coarse = np.flatnonzero(x[:, 0] < 30)
    corner = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, -0.5], [0.5, 0.5]])
    mixed_x = np.concatenate([x[coarse], (x[fine, None] + corner).reshape(-1, 2)])
    mixed_half = np.repeat([[1.0, 1.0], [0.5, 0.5]], [len(coarse), 4 * len(fine)], axis=0)
    mixed_rho = np.concatenate([rho[coarse], np.repeat(rho[fine], 4)])
    shuffle = np.random.default_rng(4).permutation(len(mixed_x))
    mixed = build_judge(scene, mixed_x[shuffle], mixed_half[shuffle], split=2)
    assert np.array_equal(
        np.bincount(mixed.owner)[np.argsort(shuffle)], np.repeat([16, 4], [len(coarse), 4 * len(fine)])
    )
    # the same mesh, moduli and load: rounding only
    assert mixed(mixed_rho[shuffle]).compliance == pytest.approx(judge(rho).compliance, rel=1e-11)


def test_owner_of_overlaps_and_gaps() -> None:
    """The rectangle that holds a cell owns it, in an overlap the nearest by its own size; outside all, nobody."""
    x, half = np.array([[1.0, 1.0], [2.25, 1.0]]), np.array([[1.0, 1.0], [0.5, 0.5]])
    cells = np.array([[0.5, 0.5], [1.8, 1.0], [1.95, 1.0], [2.5, 1.2], [2.5, 1.8], [3.0, 1.0]])
    assert owners(cells, x, half).tolist() == [0, 0, 1, 1, -1, -1]


def test_judge_keeps_the_load() -> None:
    """The spread load has the whole force, on any split, and rests on the six points alone."""
    scene = cantilever()
    x, half = points(1.0)
    for split in (1, 2):
        model = build_judge(scene, x, half, split).model
        loaded = model.basis.doflocs[:, model.f_ext != 0]
        assert model.f_ext.sum() == pytest.approx(-1, abs=1e-14)  # a sum of tens of numbers
        assert np.all(loaded[0] >= 38) and np.all(np.abs(loaded[1] - 10) <= 3)


def test_judge_spreads_or_concentrates() -> None:
    """Spread over a biquadratic element, a force enters with the integrals of its functions; at a node, there."""
    x, half = points(2.0)
    spread = build_judge(cantilever(PointLoad((39, 11), (0, -36), points=1)), x, half, split=1).model.f_ext
    assert np.sort(spread[spread != 0]) == pytest.approx([-16, *4 * [-4], *4 * [-1]], abs=1e-12)  # Simpson's weights
    at_node = build_judge(cantilever(PositionLoad((39, 11), (0, -36))), x, half, split=1).model.f_ext
    assert np.sort(at_node)[:2] == pytest.approx([-36, 0], abs=1e-12)  # functions of size 1 at other nodes: rounding


def test_judge_errors() -> None:
    scene = cantilever()
    x, half = points(2.0)
    judge = build_judge(scene, x, half)
    with pytest.raises(ValueError, match="200 points"):
        judge(np.ones(100))
    with pytest.raises(ValueError, match="0 to 1"):
        judge(np.full(200, np.nan))
    with pytest.raises(InvalidScene, match="split"):
        build_judge(scene, x, half, split=0)
    with pytest.raises(EmptyDomain, match="rectangle"):
        build_judge(scene, x + 100, half)


def test_judge_of_cut_points_is_as_large_as_the_body() -> None:
    """Whole rectangles about the centroids of pieces reach over a disc; trimmed they do not, and shares of a load by
    volume are those of what is left."""
    disc = Circle((0.0, 0.0), 4.0)
    body = Body(disc, (Support(Rectangle((-4, -4), (-3, 4))),), (RegionLoad(Rectangle((2, -4), (4, 4)), (0, -1)),))
    scene = Scene("disc", body, Design(0.5, 1.0))
    points = discretise_points(body, 1.0, cut=True).points
    whole, trimmed = (build_judge(scene, points.x, points.half_length, trim=trim).models[0] for trim in (False, True))
    assert trimmed.area.sum() == pytest.approx(16 * np.pi, rel=0.01)  # stairs of a quarter of h
    assert whole.area.sum() > 1.03 * 16 * np.pi
    assert trimmed.f_ext.sum() == pytest.approx(-1, abs=1e-12)
    direct = discretise(body, 0.25, 2)
    rho = np.ones(len(points.x))
    judged = reanalyse(scene, points.x, points.half_length, rho, trim=True)
    by_elements = float(direct.f_ext @ solve(direct, simp(np.ones(len(direct.area)), body.material, scene.design)[0]))
    assert judged.compliance == pytest.approx(by_elements, rel=0.02)  # the load's region ends at other cells
