"""Fixtures of the study: analyses of the bracket, optimised designs, and their judge."""

import pytest
from joblib import Parallel, delayed

from reference_fem.reanalyse import Judge, build_judge
from validation.bodies.scenes import l_bracket
from validation.harness.progress import ShowProgress
from validation.methods.analyser import JOBS, METHODS, SHAPE_FUNCTIONS, Analyser, Optimisation
from validation.methods.optima import optimised_bracket
from validation.studies.crossing.l_bracket.bracket import CROSSED, CROSSING, build, optimise


@pytest.fixture(scope="package")
def analysers() -> dict[str, Analyser]:
    """Every shape function with crossing, standard without, and finite elements."""
    crossed = {name: build(name, CROSSING) for name in SHAPE_FUNCTIONS}
    return {"standard, no crossing": build("standard", None), "FEM": METHODS["FEM"](l_bracket())} | crossed


@pytest.fixture(scope="package")
def runs(progress: ShowProgress) -> dict[str, Optimisation]:
    done = Parallel(n_jobs=JOBS, return_as="generator")(delayed(optimise)(name) for name in CROSSED)
    crossed = dict(zip(CROSSED, progress(done, "crossed brackets"), strict=True))
    return {"standard, no crossing": optimised_bracket("standard")} | crossed


@pytest.fixture(scope="package")
def judge(analysers: dict[str, Analyser]) -> Judge:
    return build_judge(l_bracket(), analysers["FEM"].x, analysers["FEM"].half_length, split=1)
