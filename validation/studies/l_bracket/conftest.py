"""Fixtures of the study: the bracket by every method, optimised designs, and their judge."""

import pytest
from joblib import Parallel, delayed

from mpmtop.optimizers import UpdateRule
from reference_fem.reanalyse import Judge, build_judge
from validation.bodies.scenes import l_bracket
from validation.harness.progress import ShowProgress
from validation.methods.analyser import JOBS, METHODS, Analyser, Optimisation
from validation.studies.l_bracket.rules import RULES, SOLVES, WARM, optimise


@pytest.fixture(scope="package")
def analysers() -> dict[str, Analyser]:
    scene = l_bracket()
    return {name: build(scene) for name, build in METHODS.items()}


@pytest.fixture(scope="package")
def runs(progress: ShowProgress) -> dict[str, Optimisation]:
    """Every method to convergence, and standard MPM by every rule for the same number of solves.

    GIMP's problem is standard MPM's, number by number, as `test_optimisation` checks: so is its run.
    """
    # FEM first: it takes as long as all others together
    cases: dict[str, tuple[str, UpdateRule, int | None]] = {n: (n, WARM, None) for n in ("FEM", "standard")}
    cases |= {name: ("standard", rule, SOLVES) for name, rule in RULES.items()}
    done = Parallel(n_jobs=JOBS, return_as="generator")(delayed(optimise)(*case) for case in cases.values())
    results = dict(zip(cases, progress(done, "L-bracket runs"), strict=True))
    return results | {"GIMP": results["standard"]}


@pytest.fixture(scope="package")
def judge(analysers: dict[str, Analyser]) -> Judge:
    return build_judge(l_bracket(), analysers["standard"].x, analysers["standard"].half_length)
