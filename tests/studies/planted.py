"""Cases of the stress test with something planted in them."""

from collections.abc import Callable
from functools import partial

import pytest

from mpmtop.arrays import Array
from mpmtop.equilibrium import Equilibrium, equilibrium
from mpmtop.errors import UnsupportedBody
from mpmtop.model import Model
from validation.studies.stability import judge as stability
from validation.studies.stability.cases import model_of
from validation.studies.stability.judge import Analysis, Case, Finding, direct, outcome


def kind(run: Callable[[], Finding]) -> str:
    return outcome(Case("family", "name", "judge", run, (UnsupportedBody,))).kind


def raising(error: Exception) -> Callable[[], Finding]:
    def run() -> Finding:
        raise error

    return run


def beam_analysis(**changes: object) -> Analysis:
    return Analysis("beam", "", partial(model_of, "tent", (0.1, 0.0)), **changes)  # type: ignore[arg-type]


def planted(monkeypatch: pytest.MonkeyPatch, change: Callable[[Equilibrium], Equilibrium]) -> None:
    """Every analysis of the engine's gives a changed state."""

    def changed(model: Model, moduli: Array) -> Equilibrium:
        return change(equilibrium(model, moduli))

    monkeypatch.setattr(stability, "equilibrium", changed)


def state_of(analysis: Analysis) -> tuple[Model, Equilibrium, Array]:
    model = direct(analysis.make())
    rho, moduli = stability.densities(model, analysis.rho, analysis.contrast)
    return model, equilibrium(model, moduli), rho
