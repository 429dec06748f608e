"""Fixtures of the study: every method on every scene, and its gradient verified."""

import pytest
from joblib import Parallel, delayed

from mpmtop.model import discretise
from mpmtop.problem import DesignProblem
from reference_fem.simp import design_problem
from validation.bodies.scenes import SPACING, H
from validation.methods.analyser import JOBS
from validation.oracles.woodbury import State, finite_elements, material_points
from validation.studies.sensitivity.subjects import SCENES, SEEDED, Key, Subject, Verified, crossing_models, verify


@pytest.fixture(scope="package")
def subjects() -> dict[tuple[str, str], Subject]:
    every = {}
    for objective, scene in SCENES.items():
        for method, model in ({SEEDED: discretise(scene.body, H, 2)} | crossing_models(scene)).items():
            problem = DesignProblem(model, scene.design, scene.objective)
            every[objective, method] = Subject(objective, method, problem, material_points(problem))
        fem = design_problem(scene, SPACING)
        every[objective, "FEM"] = Subject(objective, "FEM", fem, finite_elements(fem))
    return every


@pytest.fixture(scope="package")
def uniform(subjects: dict[tuple[str, str], Subject]) -> dict[str, State]:
    """Uniform fields without crossing, which several sections use."""
    return {objective: subjects[objective, SEEDED].state("uniform") for objective in SCENES}


@pytest.fixture(scope="package")
def verified(subjects: dict[tuple[str, str], Subject], uniform: dict[str, State]) -> dict[Key, Verified]:
    def case(objective: str, method: str, field: str) -> Verified:
        shared = method == SEEDED and field == "uniform"
        subject = subjects[objective, method]
        return verify(subject, field, uniform[objective] if shared else subject.state(field))

    keys = [(*key, field) for key in subjects for field in ("uniform", "random")]
    # threads suffice, most of it is matrix products; the longest cases first
    done = Parallel(n_jobs=JOBS, prefer="threads")(delayed(case)(*key) for key in reversed(keys))
    return dict(zip(keys, reversed(done), strict=True))
