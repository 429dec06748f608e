"""What is skipped

Whatever a scene does not need is not computed. Each rule is shown where it applies and where it does not, in counts of
what is computed, the same on any machine; measured times are on the timings page. `plan(problem)` prints what holds for
a scene of your own.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd

from mpmtop.equilibrium import discretise
from mpmtop.points import seed
from mpmtop.problem import DesignProblem
from mpmtop.scene import Compliance, Scene
from mpmtop.shape_functions import ShapeFunction, gimp, tent
from validation.methods import METHODS, PAPER_RULE, Optimisation
from validation.report import Report
from validation.scenes import SPACING, H, cantilever, l_bracket, perforated
from validation.timing import cpu_seconds, evaluation_with_gradient


class Saving(NamedTuple):
    """A rule on a scene: what is counted, how many there were without the rule, and how many there are."""

    rule: str
    scene: str
    counted: str
    without: int
    computed: int


def problem(scene: Scene, shape_function: ShapeFunction = tent, shift: float = 0.0) -> DesignProblem:
    points = seed(scene.domain, (SPACING, SPACING)).moved((shift, shift))
    return DesignProblem(discretise(scene, H, points=points, shape_function=shape_function))


def untouched_nodes(name: str, of: DesignProblem) -> Saving:
    lower, upper = of.model.scene.domain.bounds
    box = int(np.prod((upper - lower) / H + 1))
    return Saving("no point, no unknown", name, "nodes of the bounding box", box, len(of.model.transfer.nodes))


def short_stencils(name: str, of: DesignProblem) -> Saving:
    touched = of.model.transfer.touched
    return Saving("domain in one cell, tent's stencil", name, "nodes of all points", touched.size, int(touched.sum()))


def adjoint(name: str, of: DesignProblem) -> Saving:
    return Saving("self-adjoint, no adjoint solve", name, "solves for value and gradient", 2, 1 + of.objective.solves)


def newton(name: str, of: DesignProblem) -> Saving:
    steps = of.evaluate(of.x0).state.newton_steps
    return Saving("linear scene, no check by another step", name, "Newton steps", 2, steps)


def passive(name: str, of: DesignProblem) -> Saving:
    return Saving("passive points are no variables", name, "design variables", len(of.model.points.x), len(of.x0))


def gradients(name: str, scene: Scene, iterations: int) -> Saving:
    """Gradients of a GCMMA run, beside its solves: one each if rejected designs were differentiated, too."""
    run = Optimisation.of(METHODS["standard"](scene), PAPER_RULE, iterations=iterations)
    return Saving("rejected design, no gradient", name, "gradients", int(run.solves[-1]), run.iterations + 1)


def test_rules(report: Report) -> None:
    """Rule by rule"""
    beam, bracket = problem(cantilever()), problem(l_bracket())
    savings = [
        untouched_nodes("L-bracket", bracket),
        untouched_nodes("cantilever", beam),
        short_stencils("cantilever, GIMP", problem(cantilever(), gimp)),
        short_stencils("cantilever, GIMP, moved by 0.1 h", problem(cantilever(), gimp, 0.1)),
        adjoint("cantilever, compliance", beam),
        adjoint("L-bracket, p-norm", bracket),
        newton("cantilever", beam),
        newton("cantilever, contrast 0.5", problem(cantilever(contrast=0.5))),
        gradients("L-bracket, p-norm, 30 iterations", l_bracket(), 30),
        gradients("cantilever, compliance, 30 iterations", cantilever(), 30),
        passive("cantilever with a hole, void", problem(perforated(absent=False))),
        passive("cantilever with a hole, absent", problem(perforated(absent=True))),
    ]
    table = pd.DataFrame(savings)
    table["saved"] = 1 - table["computed"] / table["without"]
    report.table("rules", table, "What is computed, beside what would be without the rule.", 3)
    applies = table["saved"].to_numpy()[::2]
    saves = report.check("rules that save nothing where they apply", int(np.sum(applies <= 0)), 0, source="our aim")
    seconds = cpu_seconds(
        {
            "compliance": evaluation_with_gradient(problem(l_bracket(objective=Compliance()))),
            "p-norm": evaluation_with_gradient(bracket),
            "without hole": evaluation_with_gradient(problem(perforated(absent=True))),
            "void hole": evaluation_with_gradient(problem(perforated(absent=False))),
        }
    )
    report.timing(
        "CPU time of value and gradient, p-norm over compliance: adjoint and stresses",
        seconds["p-norm"] / seconds["compliance"],
        source="for comparison",
    )
    report.timing(
        "CPU time of value and gradient, void hole over absent hole: unknowns without material",
        seconds["void hole"] / seconds["without hole"],
        source="for comparison",
    )
    assert saves
