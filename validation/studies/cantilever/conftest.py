"""Fixtures of the study: the cantilever by every method, optimised designs, and their judge."""

import pytest

from reference_fem.reanalyse import Judge, build_judge
from validation.bodies.scenes import cantilever
from validation.methods.analyser import METHODS, Analyser, Optimisation
from validation.methods.optima import optimised_cantilever


@pytest.fixture(scope="package")
def analysers() -> dict[str, Analyser]:
    scene = cantilever()
    return {name: build(scene) for name, build in METHODS.items()}


@pytest.fixture(scope="package")
def optimisations() -> dict[str, Optimisation]:
    return {name: optimised_cantilever(name) for name in METHODS}


@pytest.fixture(scope="package")
def judge(analysers: dict[str, Analyser]) -> Judge:
    points = analysers["standard"]
    return build_judge(cantilever(), points.x, points.half_length)
