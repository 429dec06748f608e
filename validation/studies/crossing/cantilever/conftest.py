"""Fixtures of the study: calibrated crossings, designs optimised with them, and their judge."""

import numpy as np
import pytest

from mpmtop.crossing import FAMILIES
from reference_fem.reanalyse import Judge, build_judge
from validation import paper
from validation.bodies.scenes import cantilever
from validation.harness.progress import ShowProgress
from validation.methods.analyser import METHODS, SHAPE_FUNCTIONS, Analyser, Optimisation
from validation.methods.optima import optimised_cantilever
from validation.studies.crossing.cantilever.calibration import NAMES, REPRODUCTION, Calibration, tip


@pytest.fixture(scope="package")
def calibrations() -> dict[str, Calibration]:
    still = {name: tip(name) for name in NAMES}
    target = paper.CANTILEVER_CROSSING_TIP_STANDARD.value
    chosen = {}
    for family, members in FAMILIES.items():
        rises = [tip("standard", member) / still["standard"] - 1 for member in members]
        best = int(np.argmin(np.abs(np.array(rises) - target)))
        gimp = tip("GIMP", members[best]) / still["GIMP"] - 1
        chosen[family] = Calibration(members[best], {"standard": rises[best], "GIMP": gimp})
    return chosen


@pytest.fixture(scope="package")
def uncrossed() -> Analyser:
    return METHODS["standard"](cantilever())


@pytest.fixture(scope="package")
def still() -> Optimisation:
    """The optimum without crossing; standard and GIMP are one."""
    return optimised_cantilever("standard")


@pytest.fixture(scope="package")
def runs(calibrations: dict[str, Calibration], progress: ShowProgress) -> dict[tuple[str, str], Optimisation]:
    """Optimisations by family and method; the reproduction also with the B-splines."""
    cases = [(f, name) for f in FAMILIES for name in (SHAPE_FUNCTIONS if f == REPRODUCTION else NAMES)]
    return {
        (family, name): optimised_cantilever(name, calibrations[family].crossing)
        for family, name in progress(cases, "crossed optimisations")
    }


@pytest.fixture(scope="package")
def judge(uncrossed: Analyser) -> Judge:
    return build_judge(cantilever(), uncrossed.x, uncrossed.half_length, split=1)
