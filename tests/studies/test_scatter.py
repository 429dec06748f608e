"""Sweeps on a Dask cluster: joblib's calls go to its workers and come back with the same numbers."""

from typing import Any

import pytest
from joblib import Parallel, delayed, parallel_config

from mpmtop.crossing import Crossing, Jitter, Uniform
from mpmtop.points import seed
from validation.bodies.scenes import SPACING, cantilever
from validation.studies.shape_functions.scatter import Scattered, fem_gradients, scattered

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # bodies are moved and cut on purpose

distributed = pytest.importorskip("distributed", reason="no Dask cluster here: pip install -e '.[cluster]'")

MOVES: tuple[Crossing, ...] = (Uniform(0.3), Jitter(0.3, 1))


def sweep() -> list[Scattered]:
    """The shape function study's sweep over arrangements of points, as the study calls it, with fewer of them."""
    reference = fem_gradients(seed(cantilever().body.domain, (SPACING, SPACING)))
    cases = [(name, move) for name in ("standard", "GIMP") for move in MOVES]
    return list(Parallel(return_as="generator")(delayed(scattered)(*case, reference) for case in cases))


def executed(client: Any) -> int:
    """Tasks that the cluster's workers have run; joblib may make one of several calls."""
    # a lambda travels as code: the workers need not import this module
    return sum(client.run(lambda dask_worker: dask_worker.state.executed_count).values())


def test_cluster_gives_the_local_numbers() -> None:
    local = sweep()
    # port 0: any free one, as the usual one may be another cluster's
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster,
        distributed.Client(cluster) as client,
        parallel_config("dask"),
    ):
        remote = sweep()
        assert executed(client) > 0
    assert remote == local  # to the last bit: the same code on the same machine
