"""Peers: run time beside other codes

One iteration of compliance optimisation on the cantilever, by three codes in one process, one thread each: standard
MPM (`mpmtop`), **pyMOTO** (its own elements, filter, MMA; the best solver it finds) and the **plain scikit-fem loop**
of the cantilever study. As many design variables in each: MPM has four points for each of its cells, the others an
element for each variable. The filter's radius is 3 spacings at every size. **Kratos** has material points, too, and no
optimisation with them: one analysis of the same points on the same grid stands beside `mpmtop`'s. CPU times are on the
benchmark page; needs the extra `peers`.
"""

from importlib.util import find_spec

import numpy as np
import pandas as pd
import pytest

from mpmtop.crossing import Crossing, Jitter, Periodic, Uniform
from mpmtop.equilibrium import equilibrium
from mpmtop.grid import Grid
from mpmtop.model import Model, discretise
from mpmtop.points import seed
from reference_fem.reanalyse import build_judge
from validation.bodies.scenes import SPACING, H, cantilever
from validation.bodies.sketch import CHOSEN, opening
from validation.harness.progress import ShowProgress
from validation.harness.report import Report
from validation.measures.timing import Work, cpu_seconds, in_own_process
from validation.methods.analyser import METHODS, MOVE, Optimisation
from validation.methods.protocol import Case
from validation.methods.tracks import RULES, track

ASKED = "Do other codes give the same numbers, and how long do they take?"

FOUND = (
    "For one iteration pyMOTO takes {CPU time of an iteration, pyMOTO over mpmtop, 80 x 40 variables} times as long as "
    "mpmtop with 80 x 40 variables, {CPU time of an iteration, pyMOTO over mpmtop, 1000 x 500 variables} times with "
    "1000 x 500; the plain scikit-fem loop "
    "{CPU time of an iteration, plain scikit-fem loop over mpmtop, 80 x 40 variables} and "
    "{CPU time of an iteration, plain scikit-fem loop over mpmtop, 1000 x 500 variables} times.",
    "Kratos takes {CPU time from points to displacements, Kratos over mpmtop, 500 x 250 points} times as long from 500 "
    "x 250 points to displacements, and "
    "{CPU time of the linear solve alone, Kratos over mpmtop, 500 x 250 points} times for the linear solve alone.",
    "The design of mpmtop has "
    "{true compliance (fine reference) of mpmtop's design over that of pyMOTO's} times the true "
    "compliance of pyMOTO's.",
)
SO = (
    "Iterations of two codes are not worth the same: read the ratios with the compliances beside them, on the "
    "benchmark page.",
)

if find_spec("pymoto"):
    from validation.methods.pymoto import PyMoto
    from validation.studies.peers.iterations import Iteration, iterations, pymoto_track
if find_spec("KratosMultiphysics"):
    from validation.methods.kratos import Kratos


def needs(package: str) -> pytest.MarkDecorator:
    """Skip a section whose peer is not installed."""
    return pytest.mark.skipif(find_spec(package) is None, reason=f"no {package} here: pip install -e '.[peers]'")


# without MKL pyMOTO hands SuperLU a matrix by rows
pytestmark = [
    pytest.mark.benchmark,
    pytest.mark.filterwarnings("ignore:splu converted its input"),
    pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning"),  # points are moved off the clamp on purpose
]

SIZES = ((80, 40), (200, 100), (500, 250), (1000, 500))
"""Design variables along the cantilever's sides."""
FASTER = {"pyMOTO": 5.0, "plain scikit-fem": 30.0}
"""Our aim: how many times faster than the peer, at every size."""


@needs("pymoto")
def test_same_problem(report: Report) -> None:
    """The same problem, the same optimum

    pyMOTO's analysis of the start must be that of `reference_fem`; the designs that both codes end with are judged by
    the fine reference.
    """
    scene = cantilever()
    opening(report, scene, {"load": CHOSEN, "filter radius": CHOSEN, "E_min / E0": CHOSEN, "rho_min": CHOSEN})
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


@needs("pymoto")
def test_iteration(report: Report, progress: ShowProgress) -> None:
    """CPU time of an iteration, by size

    Analysis, sensitivities and update; medians of repeats taken in turn, after a first turn that builds what is built
    once. Compliance is that of the last design, for pyMOTO of the one before, which it analysed last.
    """
    rows: dict[tuple[str, str], Iteration] = {}
    for size in progress(SIZES, "sizes"):
        label = f"{size[0]} x {size[1]} variables"
        # pyMOTO looks through the stack for its caller: under pytest that would take longer than its analysis
        found = in_own_process(iterations, *size, 8 if size[0] <= 200 else 2)
        seconds = {code: step.seconds for code, step in found.items()}
        rows |= {(label, code): step for code, step in found.items()}
        for peer, at_least in FASTER.items():
            name = peer if peer == "pyMOTO" else f"{peer} loop"
            ratio = seconds[peer] / seconds["mpmtop"]
            what = f"CPU time of an iteration, {name} over mpmtop, {label}"
            report.timing(what, ratio, at_least=at_least, source="our aim")
    table = pd.DataFrame(rows.values(), index=pd.MultiIndex.from_tuples(rows, names=["size", "code"]))
    report.timed.table("iterations", table, "CPU seconds of an iteration, and compliance after those made.", 4)


WITHIN = (1e-2, 1e-3)
"""Of the best true compliance of all runs."""


@needs("pymoto")
def test_time_to_design(report: Report, progress: ShowProgress) -> None:
    """CPU time to an equal true objective

    The paper's cantilever and radius by pyMOTO's MMA beside three runs of mpmtop, a hundred iterations each; the
    designs on the way judged by biquadratic elements. CPU seconds from nothing, operators
    included, to within 1 % and 0.1 % of the best of all.
    """
    for nx in progress((80, 320), "sizes"):
        tracks = {"pyMOTO, MMA": in_own_process(pymoto_track, nx, nx // 2, 100)}
        for name in ("GCMMA, one solve", "MMA, move limit 0.2", "optimality criteria"):
            tracks[f"mpmtop, {name}"] = track(nx, (), RULES[name], (100,), 2)
        best = min(float(each.true.min()) for each in tracks.values())
        label = f"{nx} x {nx // 2} variables"
        table = pd.DataFrame(
            {
                f"CPU s to {part:.1%}": {name: each.seconds_to((1 + part) * best) for name, each in tracks.items()}
                for part in WITHIN
            }
        )
        table["true at the end"] = pd.Series({name: each.true[-1] for name, each in tracks.items()})
        caption = f"CPU seconds to within so much of the best true compliance, {label}; empty: not reached."
        report.timed.table(f"time_to_design_{nx}", table.rename_axis("run"), caption, 4)
        theirs, ours = table.iloc[0, 0], table.iloc[1:, 0].min()
        report.timing(
            f"CPU time to within 1 % of the best true compliance, pyMOTO over mpmtop, {label}",
            float(theirs / ours),
            at_least=1.0,
            source="our aim",
        )


ARRANGEMENTS: dict[str, Crossing] = {
    "as seeded": Uniform(0.0),
    "periodic(4, 0.26)": Periodic(4),
    "jitter of 0.3 h": Jitter(0.3, 1),
}


@needs("KratosMultiphysics")
def test_kratos(report: Report) -> None:
    """The same equilibrium by Kratos' MPM

    The solid cantilever, 40 x 20 cells of 2 x 2 points, as seeded and with points that have crossed: standard MPM in
    both codes, with the same load on the same points. Kratos makes its own shape functions and its own K.
    """
    scene = cantilever()
    seeded = seed(scene.body.domain, (SPACING, SPACING))
    agree = []
    for name, crossing in ARRANGEMENTS.items():
        model = discretise(scene.body, H, points=crossing(seeded, scene.body.domain))
        ours = equilibrium(model, solid(model)).u
        theirs = Kratos(case_of(model), "sparse_lu").solve()[model.transfer.nodes].ravel()
        agree.append(
            report.check(
                f"largest difference of nodal displacements, mpmtop and Kratos, over the largest one, {name}",
                float(np.abs(theirs - ours).max() / np.abs(ours).max()),
                at_most=1e-10,  # two factorisations of one matrix of condition number 1e6
                source="same discretisation",
            )
        )
    assert all(agree)


def case_of(model: Model) -> Case:
    """The solid body of a model, for any method."""
    return Case("solid", model.body, model.points, model.grid, solid(model))


def solid(model: Model) -> np.ndarray:
    """Young's moduli (p,) of the solid body."""
    return np.full(len(model.points.x), model.body.material.young)


def analyses_of(nx: int) -> dict[str, dict[str, Work]]:
    """Analyses of nx x nx/2 points in three depths, by both codes; Kratos by conjugate gradients and directly."""
    h = 80 / nx * H
    scene = cantilever(radius=3 * h / 2)
    grid = Grid.around(
        *scene.body.domain.bounds, (h, h), margin=0
    )  # Kratos numbers all cells, also those without points

    def discretised() -> Model:
        return discretise(scene.body, grid=grid)

    model = discretised()
    moduli = solid(model)
    K, f = model.stiffness.data(moduli), model.f_ext[model.stiffness.dof]
    iterative, direct = Kratos(case_of(model)), Kratos(case_of(model), "sparse_lu")
    iterative.solve()
    direct.solve()
    return {
        "from points to displacements": {
            "mpmtop": lambda: equilibrium(discretised(), moduli),
            "Kratos": lambda: Kratos(case_of(model)).solve(),
        },
        "of a further analysis, assembly and solve": {
            "mpmtop": lambda: equilibrium(model, moduli),
            "Kratos": iterative.solve,
        },
        "of the linear solve alone": {
            "mpmtop": lambda: model.solver.factor(K)(f),
            "Kratos": iterative.solve_again,
            "Kratos' direct solver": direct.solve_again,
        },
    }


@needs("KratosMultiphysics")
def test_kratos_time(report: Report, progress: ShowProgress) -> None:
    """CPU time of an analysis beside Kratos, by size

    The points as seeded, solid. Kratos by conjugate gradients with algebraic multigrid to a residual of 1e-9, its
    faster solver here, `mpmtop` by the one it chooses; the direct solvers are beside each other in the last row. From
    points to displacements includes the meshes that Kratos wants, which go to it node by node from Python, as its
    interface has it; 1000 x 500 points are left out, as that takes minutes.
    """
    for size in progress([s for s in SIZES if s[0] <= 500], "sizes"):
        for what, work in analyses_of(size[0]).items():
            seconds = cpu_seconds(work, repeats=8 if size[0] <= 200 else 2)
            for peer in [name for name in seconds if name != "mpmtop"]:
                report.timing(
                    f"CPU time {what}, {peer} over mpmtop, {size[0]} x {size[1]} points",
                    seconds[peer] / seconds["mpmtop"],
                    source="for comparison",
                )
