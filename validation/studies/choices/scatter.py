"""What update rule and start make of every optimum that a study compares, beside elements with as many unknowns."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from mpmtop.arrays import Array
from mpmtop.criteria import PNormStress
from mpmtop.crossing import Periodic
from mpmtop.optimizers import GCMMA, SingleStepGCMMA, UpdateRule, optimize
from mpmtop.scene import Scene
from mpmtop.shape_functions import bspline2, gimp, tent
from reference_fem.reanalyse import Judge, build_judge, judge_stress
from validation.bodies.scenes import SPACING, l_bracket, perforated
from validation.bodies.scenes import cantilever as cantilever_scene
from validation.bodies.starts import cosines
from validation.methods.analyser import JOBS, MOVE, Analyser, Optimisation, finite_elements, material_points
from validation.methods.sub_cell import elements_of_the_grid
from validation.studies.choices.cantilever import BASES

CROSSING = Periodic(4)
"""That of the studies' designs."""
RULES: dict[str, UpdateRule] = {
    "GCMMA, warm": GCMMA(move=MOVE, warm_start=True),
    "GCMMA, single step": SingleStepGCMMA(move=MOVE),
}
"""A conservative rule, and one without an inner loop: that is left out on the bracket, where it does not converge (see
the section on update rules)."""
SEEDS = (0, 1)
"""The uniform start, and cosines."""
ITERATIONS = 500
"""At most; the paper's stopping rule ends most runs before."""
Builder = Callable[[Scene], Analyser]
MPM, GRID, FINER = "standard", "elements of the grid", "FEM"
"""Methods side by side: of as many unknowns the first two, of one design space all."""
SEEDED: dict[str, Builder] = {
    MPM: material_points(tent, "standard"),
    GRID: elements_of_the_grid,
    FINER: finite_elements,
}
CROSSED: dict[str, Builder] = {
    "standard, crossed": material_points(tent, "standard", CROSSING),
    "GIMP, crossed": material_points(gimp, "GIMP", CROSSING),
    "quadratic B-spline, crossed": material_points(bspline2, "quadratic B-spline", CROSSING),
}
OF_THE_PAPER = (MPM, "standard, crossed", "GIMP, crossed")
"""Methods whose optima it states; on the second cantilever no others."""
BRACKET = "L-bracket"
CANTILEVERS = tuple(f"cantilever, {base.load}" for base in BASES)
HOLE = "cantilever with a hole"


class Case(NamedTuple):
    """An optimum, by the names of its body and its method."""

    body: str
    method: str


SCENES: dict[str, Scene] = {
    **{name: cantilever_scene(base.load, base.radius * SPACING) for name, base in zip(CANTILEVERS, BASES, strict=True)},
    HOLE: perforated(absent=True),
    BRACKET: l_bracket(),
}
CASES: dict[str, tuple[Case, ...]] = {
    "cantilever": tuple(Case(CANTILEVERS[0], name) for name in SEEDED | CROSSED),
    "others": (
        *(Case(CANTILEVERS[1], name) for name in OF_THE_PAPER),
        *(Case(HOLE, name) for name in SEEDED),
    ),
    "bracket": tuple(Case(BRACKET, name) for name in SEEDED),
    "bracket_crossed": tuple(Case(BRACKET, name) for name in CROSSED),
}
"""By the table that they are in."""


class Outcome(NamedTuple):
    """One run: objective by its own analysis and by the fine reference, largest relaxed stress (nan for compliance),
    iterations, whether the stopping rule ended it, and the unknowns of the analysis."""

    own: float
    true: float
    largest: float
    iterations: int
    converged: bool
    unknowns: int


def outcome(case: Case, rule: str, seed: int) -> Outcome:
    """One run; a function of the module, for joblib."""
    scene = SCENES[case.body]
    analyser = (SEEDED | CROSSED)[case.method](scene)
    iterates = optimize(analyser.problem, RULES[rule], start=cosines(seed), max_iterations=ITERATIONS)
    run = Optimisation.collect(iterates, analyser)
    points = SEEDED[MPM](scene)
    judge = build_judge(scene, points.x, points.half_length, split=1)
    true = judged(judge, run.design.at(points.x))
    return Outcome(run.final, true, largest(analyser, run), run.iterations, run.converged, unknowns(analyser))


def judged(judge: Judge, rho: Array) -> float:
    """The scene's objective on the fine reference, one biquadratic element for each point."""
    judgement = judge(rho)
    stressed = isinstance(judge.objective, PNormStress)
    return judge_stress(judge, rho, judgement).p_norm if stressed else judgement.compliance


def largest(analyser: Analyser, run: Optimisation) -> float:
    """Largest relaxed von Mises stress by the method itself; nan where compliance is the objective."""
    if not isinstance(analyser.scene.objective, PNormStress):
        return np.nan
    rho = run.design.at(analyser.x)
    return float((rho**analyser.scene.objective.q * analyser.solid_von_mises(analyser.problem.analyse(rho))).max())


def unknowns(analyser: Analyser) -> int:
    """Free degrees of freedom of the analysis."""
    problem: Any = getattr(analyser.problem, "at_gauss", analyser.problem)
    model = problem.model
    return len(model.free) if hasattr(model, "free") else len(model.stiffness.dof)


Found = dict[Case, dict[tuple[str, int], Outcome]]
"""Outcomes by rule and start."""


def computed(cases: Sequence[Case]) -> Found:
    """Every case by every rule from every start."""
    conservative = next(iter(RULES))
    runs = [
        (case, rule, seed)
        for case in cases
        for rule in ((conservative,) if case.body == BRACKET else RULES)
        for seed in SEEDS
    ]
    done = Parallel(n_jobs=JOBS)(delayed(outcome)(*run) for run in runs)
    found: Found = {}
    for (case, rule, seed), result in zip(runs, done, strict=True):
        found.setdefault(case, {})[rule, seed] = result
    return found


def spread(values: Sequence[float]) -> float:
    """Largest over least, less one."""
    return max(values) / min(values) - 1


def tabulated(found: Found) -> pd.DataFrame:
    """A row for each optimum: best and mean by the own analysis, true value of that best; spreads."""
    rows: dict[Case, dict[str, Any]] = {}
    for case, of in found.items():
        own, true, stress = ([getattr(o, name) for o in of.values()] for name in ("own", "true", "largest"))
        best = min(of.values(), key=lambda o: o.own)
        rows[case] = {
            "unknowns": best.unknowns,
            "runs": len(own),
            "not converged": sum(not o.converged for o in of.values()),
            "own: best": best.own,
            "own: mean": float(np.mean(own)),
            "own: spread": spread(own),
            "true: of the best": best.true,
            "true over own": best.true / best.own,
            "true: spread": spread(true),
        } | ({"largest stress: spread": spread(stress)} if np.isfinite(stress[0]) else {})
    table = pd.DataFrame.from_dict(rows, orient="index")
    table.index = pd.MultiIndex.from_tuples(rows, names=["body", "method"])
    return table
