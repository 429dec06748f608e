"""Peers: run time beside other codes

One iteration of compliance optimisation on the cantilever, by three codes in one process, one thread each: standard
MPM (`mpmtop`), **pyMOTO** (its own elements, filter, MMA; the best solver it finds) and the **plain scikit-fem loop**
of the cantilever study. As many design variables in each: MPM has four points for each of its cells, the others an
element for each variable. The filter's radius is 3 spacings at every size. CPU times are on the timings page; needs
the extra `peers`.
"""

from importlib.util import find_spec

import numpy as np
import pandas as pd
import pytest

from mpmtop.equilibrium import discretise
from mpmtop.problem import DesignProblem
from reference_fem.reanalyse import build_judge
from validation.conftest import ShowProgress
from validation.methods import METHODS, MOVE, Optimisation
from validation.plain_fem import PlainProblem
from validation.report import Report
from validation.scenes import SPACING, H, cantilever
from validation.timing import Work, cpu_seconds, iteration

if find_spec("pymoto") is None:
    pytest.skip("pyMOTO is not installed: pip install -e '.[peers]'", allow_module_level=True)
from validation.peers import PyMoto

# without MKL pyMOTO hands SuperLU a matrix by rows
pytestmark = [pytest.mark.benchmark, pytest.mark.filterwarnings("ignore:splu converted its input")]

SIZES = ((80, 40), (200, 100), (500, 250), (1000, 500))
"""Design variables along the cantilever's sides."""
FASTER = {(80, 40): 5.0, (500, 250): 4.0, (1000, 500): 4.0}
"""Our aim: how many times faster than pyMOTO."""


def test_same_problem(report: Report) -> None:
    """The same problem, the same optimum

    pyMOTO's analysis of the start must be that of `reference_fem`; the designs that both codes end with are judged by
    the fine reference.
    """
    scene = cantilever()
    peer = PyMoto(scene, 80, 40, MOVE)
    peer.step()
    fem = METHODS["FEM"](scene)
    same = report.check(
        "compliance of the start, pyMOTO over reference_fem",
        peer.compliance / float(fem.problem.evaluate(fem.problem.x0).objective),
        1.0,
        rtol=1e-8,  # two factorisations of one matrix
        source="same discretisation",
    )
    history = [np.inf, peer.compliance]
    while abs(history[-2] / history[-1] - 1) >= 1e-5 and len(history) < 300:
        peer.step()
        history.append(peer.compliance)
    ours = METHODS["standard"](scene)
    run = Optimisation.of(ours)
    judge = build_judge(scene, ours.x, ours.half_length, split=1)
    theirs = judge(fem.design(peer.element_densities).at(ours.x)).compliance
    table = pd.DataFrame(
        {
            "own compliance": {"mpmtop": run.final, "pyMOTO": peer.compliance},
            "iterations": {"mpmtop": run.iterations, "pyMOTO": len(history) - 1},
            "compliance, fine reference": {"mpmtop": judge(run.design.rho).compliance, "pyMOTO": theirs},
        }
    )
    report.table("designs", table.rename_axis("code"), "Optimised cantilevers. pyMOTO ends at a change below 1e-5.")
    close = report.check(
        "true compliance (fine reference) of mpmtop's design over that of pyMOTO's",
        judge(run.design.rho).compliance / theirs,
        1.0,
        rtol=0.01,
        source="our aim",
    )
    assert same and close


def step_of(nx: int, ny: int) -> dict[str, Work]:
    """One more iteration of each code with nx x ny design variables."""
    spacing = SPACING * 80 / nx
    scene = cantilever(radius=3 * spacing)
    return {
        "mpmtop": iteration(DesignProblem(discretise(scene, 2 * spacing * H, 2))),
        "pyMOTO": PyMoto(scene, nx, ny, MOVE).step,
        "plain scikit-fem": iteration(PlainProblem(scene, nx, ny)),
    }


def test_iteration(report: Report, progress: ShowProgress) -> None:
    """CPU time of an iteration, by size

    Analysis, sensitivities and update; medians of repeats taken in turn, after a first turn that builds what is built
    once.
    """
    for size in progress(SIZES, "sizes"):
        label = f"{size[0]} x {size[1]} variables"
        seconds = cpu_seconds(step_of(*size), repeats=8 if size[0] <= 200 else 2)
        report.timing(
            f"CPU time of an iteration, pyMOTO over mpmtop, {label}",
            seconds["pyMOTO"] / seconds["mpmtop"],
            at_least=FASTER.get(size),
            source="our aim" if size in FASTER else "for comparison",
        )
        report.timing(
            f"CPU time of an iteration, plain scikit-fem loop over mpmtop, {label}",
            seconds["plain scikit-fem"] / seconds["mpmtop"],
            at_least=10.0,
            source="our aim",
        )
