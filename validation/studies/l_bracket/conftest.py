"""Fixtures of the study: the bracket by every method, optimised designs, and their judge."""

import pytest
from joblib import Parallel, delayed

from reference_fem.reanalyse import Judge, build_judge
from validation.bodies.scenes import l_bracket
from validation.harness.progress import ShowProgress
from validation.methods.analyser import JOBS, METHODS, Analyser, Optimisation
from validation.methods.optima import optimised_bracket
from validation.studies.l_bracket.rules import RULES, SOLVES


@pytest.fixture(scope="package")
def analysers() -> dict[str, Analyser]:
    scene = l_bracket()
    return {name: build(scene) for name, build in METHODS.items()}


@pytest.fixture(scope="package")
def runs(progress: ShowProgress) -> dict[str, Optimisation]:
    """Every method to convergence.

    GIMP's problem is standard MPM's, number by number, as `test_optimisation` checks: so is its run.
    """
    # FEM first: it takes longer than the other
    done = Parallel(n_jobs=JOBS, return_as="generator")(delayed(optimised_bracket)(n) for n in ("FEM", "standard"))
    results = dict(zip(("FEM", "standard"), progress(done, "L-bracket runs"), strict=True))
    return results | {"GIMP": results["standard"]}


@pytest.fixture(scope="package")
def single_step() -> Optimisation:
    """Standard MPM by the rule without an inner loop."""
    return optimised_bracket("standard", RULES["single-step GCMMA"], SOLVES)


@pytest.fixture(scope="package")
def judge(analysers: dict[str, Analyser]) -> Judge:
    return build_judge(l_bracket(), analysers["standard"].x, analysers["standard"].half_length)
