"""What hangs on nothing is named."""

import numpy as np
import pytest

from mpmtop.body import Support
from mpmtop.equilibrium import equilibrium
from mpmtop.errors import LoadOutsideBody, NotConverged, UnsupportedBody
from mpmtop.loads import PointLoad, PositionLoad, RegionLoad
from mpmtop.model import discretise
from mpmtop.points import MaterialPoints
from mpmtop.region import Rectangle
from tests.mpmtop.solvers.table import EXACT
from tests.scenes import cantilever
from validation.oracles.extended import full_stiffness

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # bodies are moved and cut on purpose


@EXACT
def test_floating_body_is_named(solver: type) -> None:
    """A body that can rotate about its one held node, and one that floats on a slit of no material."""
    pin = Support(Rectangle((0, 0), (0, 0)))
    model = discretise(cantilever(supports=(pin,)).body, 1.0, solver=solver)
    # a rotation is a mechanism of many nodes: SuperLU's order leaves its pivot just above rounding, not its residual
    with pytest.raises((UnsupportedBody, NotConverged), match="support"):
        equilibrium(model, np.ones(128))
    roller = Support(Rectangle((0, 0), (8, 0)), (False, True))
    model = discretise(cantilever(supports=(roller,)).body, 1.0, solver=solver)
    with pytest.raises(UnsupportedBody, match="displacement x"):
        equilibrium(model, np.ones(128))
    model = discretise(cantilever().body, 1.0, solver=solver)
    with pytest.raises(UnsupportedBody, match="node at"):
        equilibrium(model, np.where(np.abs(model.points.x[:, 0] - 4) < 1, 0.0, 1.0))


def test_misplaced_loads_and_supports_are_named() -> None:
    with pytest.raises(UnsupportedBody, match="move it onto the body"):
        discretise(cantilever(supports=(Support(Rectangle((-3, 0), (-2, 4))),)).body, 1.0)
    with pytest.raises(LoadOutsideBody, match="no material point"):
        discretise(cantilever(load=RegionLoad(Rectangle((20, 0), (21, 4)), (0.0, -1.0))).body, 1.0)
    with pytest.raises(LoadOutsideBody, match="held nodes only"):
        discretise(cantilever(load=PositionLoad((0.0, 2.0), (0.0, -1.0))).body, 1.0)
    with pytest.raises(LoadOutsideBody, match="lower `points`"):
        discretise(cantilever(1, 1, load=PointLoad((1.0, 0.5), (0.0, -1.0), points=6)).body, 1.0)
    with pytest.raises(ValueError, match="densities"):
        equilibrium(discretise(cantilever().body, 1.0), np.full(128, np.nan))


def test_islands_are_named() -> None:
    """Points that stiff material ties to no support: how many, and from where to where."""
    model = discretise(cantilever().body, 1.0)
    x = model.points.x
    for contrast in (0.0, 1e-16):  # no tie at all, and one that is lost in rounding
        island = (x[:, 0] > 5) & (x[:, 0] < 7) & (x[:, 1] < 2)
        moduli = np.where(island | (x[:, 0] < 2), 1.0, contrast)
        with pytest.raises(UnsupportedBody, match="node at") as caught:
            equilibrium(model, moduli)
        if contrast > 0:
            assert "on an island that no support holds, of 16 points from (5.25, 0.25) to (6.75, 1.75)" in str(
                caught.value
            )
        else:  # between the two no node has any stiffness
            assert "where all material is void" in str(caught.value)
    everywhere = discretise(cantilever(supports=(Support(Rectangle((0, 0), (0, 0))),)).body, 1.0)
    with pytest.raises((UnsupportedBody, NotConverged)) as caught_whole:
        equilibrium(everywhere, np.ones(128))
    assert "island" not in str(caught_whole.value)  # held, if by one node


@EXACT
def test_mechanism_behind_small_pivots(solver: type) -> None:
    """A cloud in which a node can move without energy. Rounding leaves its pivot at 2e-11 of the diagonal, far above
    that of a matrix that is singular to rounding: K v = 0 tells."""
    rng = np.random.default_rng(60)
    p = int(rng.integers(6, 80))
    half = rng.uniform(0.05, 0.5, (p, 2))
    points = MaterialPoints(rng.uniform((0, 0), (5, 2), (p, 2)), np.prod(2 * half, axis=1), half)
    model = discretise(cantilever(5, 2).body, 1.0, points=points, solver=solver)
    moduli = np.ones(len(model.points.x))
    K = full_stiffness(model, moduli)
    root = np.sqrt(np.diag(K))
    values, vectors = np.linalg.eigh(K / np.outer(root, root))
    assert values[0] < 1e-15 < 1e-6 < values[1]  # one mechanism
    with pytest.raises(UnsupportedBody, match="displacement") as caught:
        equilibrium(model, moduli)
    dof = model.stiffness.dof[int(np.argmax(np.abs(vectors[:, 0])))]
    x, y = model.grid.node_positions(model.transfer.nodes[[dof // 2]])[0]
    assert f"displacement {'xy'[dof % 2]} of the node at ({x:g}, {y:g})" in str(caught.value)
