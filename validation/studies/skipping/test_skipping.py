"""What is skipped

Whatever a scene does not need is not computed. Each rule is shown where it applies and where it does not, in counts of
what is computed, the same on any machine; what it saves in CPU time is on the timings page. `plan(problem)` prints what
holds for a scene of your own.

Figures are skipped, too: a section draws its own and stores them as files, so that a run of one study draws that
study's alone and the pages of the others keep theirs. A run cannot count what other runs draw.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple
from unittest.mock import Mock, patch

import numpy as np
import pandas as pd
import pytest

from mpmtop import equilibrium as equilibria
from mpmtop import objectives
from mpmtop.arrays import Array
from mpmtop.optimizers import GCMMA, optimize
from mpmtop.points import seed
from mpmtop.problem import DesignProblem, design_problem
from mpmtop.scene import Scene
from mpmtop.shape_functions import Ends, ShapeFunction, Stencil, gimp, tent
from validation.bodies.scenes import SPACING, H, cantilever, changed, l_bracket, perforated
from validation.bodies.sketch import CHOSEN, opening
from validation.harness.report import Report
from validation.measures.timing import Work, cpu_seconds, evaluation_with_gradient, iteration

# points are moved off the clamp and over grid lines on purpose
pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")

ASKED = "What need not be computed, and is it skipped?"


class Saving(NamedTuple):
    """A rule on a scene: what is counted, how many there were without the rule, and how many there are."""

    rule: str
    scene: str
    counted: str
    without: int
    computed: int


def problem(
    scene: Scene, shape_function: ShapeFunction = tent, shift: float = 0.0, spacing: float = SPACING
) -> DesignProblem:
    points = seed(scene.body.domain, (spacing, spacing)).moved((shift, shift))
    return design_problem(scene, H, points=points, shape_function=shape_function)


@contextmanager
def calls(owner: object, name: str) -> Iterator[Mock]:
    """Count the calls of a function of a module or class, which does its work as before."""
    with patch.object(owner, name, autospec=True, side_effect=getattr(owner, name)) as counted:
        yield counted


def untouched_nodes(name: str, of: DesignProblem) -> Saving:
    lower, upper = of.model.body.domain.bounds
    box = int(np.prod((upper - lower) / H + 1))
    return Saving("no point, no unknown", name, "nodes of the bounding box", box, len(of.model.transfer.nodes))


def short_stencils(name: str, of: DesignProblem) -> Saving:
    touched = of.model.transfer.touched
    return Saving("domain in one cell, tent's stencil", name, "nodes of all points", touched.size, int(touched.sum()))


def adjoint(name: str, of: DesignProblem) -> Saving:
    with calls(equilibria, "checked_solve") as solves:
        of.gradient(of.evaluate(of.x0))
    return Saving("self-adjoint, no adjoint solve", name, "solves for value and gradient", 2, solves.call_count)


def stresses(name: str, of: DesignProblem) -> Saving:
    """Evaluations of von Mises stress, one for the value and one for the gradient of an objective that needs them."""
    with calls(objectives, "von_mises") as von_mises:
        of.gradient(of.evaluate(of.x0))
    return Saving("stresses for stress objectives only", name, "passes over all stresses", 2, von_mises.call_count)


def refinements(name: str, of: DesignProblem, rho: Array) -> Saving:
    """Solves; without a look at the residual, one more would tell that the first was enough."""
    solves = of.analyse(rho).state.solves
    return Saving("linear law, no check by another solve", name, "solves for a state", max(2, solves), solves)


def passive(name: str, of: DesignProblem) -> Saving:
    return Saving("passive points are no variables", name, "design variables", len(of.model.points.x), len(of.x0))


def optimised(name: str, of: DesignProblem, rule: GCMMA) -> tuple[Saving, Saving]:
    """Gradients, one for each design but the last if rejected ones had theirs, and factorisations in a run.

    Svanberg's own GCMMA analyses the accepted design anew for its gradient.
    """
    with calls(DesignProblem, "gradient") as gradient, calls(type(of.model.solver), "factor") as factor:
        *_, last = optimize(of, rule, max_iterations=15)
    all_new = last.solves + gradient.call_count
    return (
        Saving("rejected design, no gradient", name, "gradients", last.solves - 1, gradient.call_count),
        Saving("unchanged design, not factored again", name, "factorisations", all_new, factor.call_count),
    )


def differences(name: str, of: DesignProblem) -> Saving:
    """Forward differences by three variables: each design is another one."""
    designs = of.x0 + 1e-4 * np.eye(4, len(of.x0), k=-1)
    with calls(type(of.model.solver), "factor") as factor:
        for design in designs:
            of.evaluate(design)
    return Saving("unchanged design, not factored again", name, "factorisations", len(designs), factor.call_count)


def test_rules(report: Report) -> None:
    """Rule by rule

    For each rule first a scene where it applies, then one where it does not. Steps and gradients are of 15 iterations.
    """
    sources = {"load": CHOSEN, "filter radius": CHOSEN, "E_min / E0": CHOSEN, "rho_min": CHOSEN}
    opening(report, cantilever(), sources, note="One of the scenes; each row of the table names its own.")
    beam, bracket = problem(cantilever()), problem(l_bracket())
    x = beam.model.points.x[:, 0]
    cut = np.where(np.abs(x - 21) < 1, 0.0, 1.0)  # void 2h wide, between the clamp and the load
    rejecting, reused = optimised("L-bracket, p-norm", bracket, GCMMA())
    accepting, _ = optimised("L-bracket, p-norm, first design taken", bracket, GCMMA(max_inner=1))
    savings = [
        untouched_nodes("L-bracket", bracket),
        untouched_nodes("cantilever", beam),
        short_stencils("cantilever, GIMP", problem(cantilever(), gimp)),
        short_stencils("cantilever, GIMP, a point in a cell, moved by 0.1 h", problem(cantilever(), gimp, 0.1, H)),
        adjoint("cantilever, compliance", beam),
        adjoint("L-bracket, p-norm", bracket),
        stresses("cantilever, compliance", beam),
        stresses("L-bracket, p-norm", bracket),
        refinements("cantilever, solid", beam, np.ones_like(x)),
        refinements("cantilever, cut through by void", beam, cut),
        reused,
        differences("cantilever, forward differences by three variables", beam),
        rejecting,
        accepting,
        passive("cantilever with a hole, void", problem(perforated(absent=False))),
        passive("cantilever with a hole, absent", problem(perforated(absent=True))),
    ]
    table = pd.DataFrame(savings)
    table["saved"] = 1 - table["computed"] / table["without"]
    report.table("rules", table, "What is computed, beside what would be without the rule.", 3)
    applies, others = int(np.sum(table["saved"][::2] <= 0)), int(np.sum(table["saved"][1::2] != 0))
    holds = [
        report.check("rules that save nothing where they apply", applies, 0, source="our aim"),
        report.check("rules that save something where they do not apply", others, 0, source="by their statement"),
    ]
    report.found(
        f"{len(table) // 2 - applies} of {len(table) // 2} rules save what they should, "
        f"{len(table) // 2 - others} of {len(table) // 2} leave the rest as it is."
    )
    assert all(holds)


def long_gimp(xi: Array, half_length: Array, tol: float = 0.0, ends: Ends | None = None) -> Stencil:
    """GIMP with three nodes along an axis for every point of the body, whatever they weigh."""
    stencil = gimp(xi, half_length, tol, ends)
    node = stencil.first[:, None] + np.arange(3)
    within = ends is None or (node >= ends[0]) & (node <= ends[1])
    return stencil._replace(N=np.where(within & (stencil.N == 0), 1e-30, stencil.N))  # stored, and changes no sum


def alternatives() -> dict[str, tuple[Work, Work]]:
    """By rule: the work as it would be without it, and as it is."""
    beam, bracket, void = problem(cantilever()), problem(l_bracket()), perforated(absent=False)
    model, start = beam.model, beam.evaluate(beam.x0)
    moduli, f = start.state.moduli, model.f_ext[model.stiffness.dof]
    soft, hard = evaluation_with_gradient(beam), evaluation_with_gradient(bracket)
    holes = {absent: evaluation_with_gradient(problem(perforated(absent=absent))) for absent in (False, True)}
    long, short = (evaluation_with_gradient(problem(cantilever(), shape)) for shape in (long_gimp, gimp))
    return {
        "no point, no unknown: a hole, else void": (holes[False], holes[True]),
        "domain in one cell, tent's stencil: cantilever": (long, short),
        "self-adjoint, no adjoint solve: cantilever": (lambda: (soft(), start.state.solve(f)), soft),
        "stresses for stress objectives only: cantilever": (
            lambda: (soft(), [bracket.functional.value(model, start.state, start.rho) for _ in ("value", "gradient")]),
            soft,
        ),
        "linear law, no check by another solve: cantilever": (
            lambda: (soft(), model.solver.factor(model.stiffness.data(moduli))(f)),
            soft,
        ),
        "unchanged design, not factored again: L-bracket": (lambda: (bracket.evaluate(bracket.x0), hard()), hard),
        "rejected design, no gradient: L-bracket": (hard, lambda: bracket.evaluate(bracket.x0)),
        "passive points are no variables: iteration, void hole": (
            iteration(problem(changed(void, passive_void=None))),
            iteration(problem(void)),
        ),
    }


@pytest.mark.slow
def test_seconds(report: Report) -> None:
    """CPU time by rule

    Value and gradient, or what is named, without the rule and with it: on the timings page.
    """
    rules = alternatives()
    seconds = cpu_seconds({f"{rule}{k}": work for rule, pair in rules.items() for k, work in enumerate(pair)})
    rows = {rule: {"without [s]": seconds[f"{rule}0"], "with [s]": seconds[f"{rule}1"]} for rule in rules}
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("rule")
    table["saved"] = 1 - table["with [s]"] / table["without [s]"]
    report.timed.table("seconds", table, "CPU seconds without each rule and with it.", 3)
