"""The stress test's engine: it must see what is planted, and its reference must be right where the answer is known."""

import re
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from hashlib import md5
from itertools import chain, islice
from typing import Any

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.equilibrium import Equilibrium, equilibrium
from mpmtop.errors import NotConverged, UnsupportedBody
from mpmtop.loads import PointLoad
from mpmtop.model import Model
from mpmtop.optimizers import CheckpointError, optimize
from mpmtop.solvers import BandedCholesky, MultigridCG, Solve
from tests.studies.planted import beam_analysis, kind, planted, raising, state_of
from validation.studies.stability import cases as stability_cases
from validation.studies.stability import interruption
from validation.studies.stability import judge as stability
from validation.studies.stability.cases import ANALYSES, beam, fields, lattice, model_of, over_edge
from validation.studies.stability.judge import (
    Analysis,
    Case,
    Finding,
    Limit,
    Outcome,
    direct,
    is_named,
    outcome,
    refused,
    tally,
)
from validation.studies.stability.outcomes import SECTIONS
from validation.studies.stability.parameters import invalid, parameters
from validation.studies.stability.runs import Bars, damaged, resumed
from validation.studies.stability.scales import materials, units

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # bodies are moved and cut on purpose


def test_findings_become_outcomes() -> None:
    assert kind(lambda: Finding(0.3)) == kind(lambda: Finding(1.0)) == "right"
    assert kind(lambda: Finding(0.3, "documented")) == "limit"
    for deviation in (1.01, np.inf, np.nan):
        assert kind(lambda deviation=deviation: Finding(deviation)) == "other"
        assert kind(lambda deviation=deviation: Finding(deviation, "documented")) == "other"


def test_what_is_no_named_error() -> None:
    """Errors of other libraries, of the engine, without advice, or from elsewhere; warnings."""
    ours = "the body floats: hold it"
    for error in (
        ZeroDivisionError("division: by zero"),
        np.linalg.LinAlgError("singular: no"),
        ValueError(ours),  # not raised by mpmtop
        stability.Wrong(ours),
        UnsupportedBody(ours),
    ):
        assert kind(raising(error)) == "other"

    def warned() -> Finding:
        warnings.warn("overflow", RuntimeWarning, stacklevel=1)
        return Finding(0.0)

    assert kind(warned) == "other"


def test_named_errors() -> None:
    """Raised by mpmtop itself; an empty message, or one without advice, is none."""
    for make in (partial(model_of, "tent", (0.9, 0.0)), partial(model_of, "tent", h=-1.0)):
        with pytest.raises(ValueError, match=":") as caught:
            make()
        assert is_named(caught.value)
        for message in ("", "no", "nothing to do about it", "load at (1, 2) failed", "residual 3: giving"):
            caught.value.args = (message,)
            assert not is_named(caught.value)
    gap = Case("", "", "", partial(refused, partial(model_of, "tent", (0.9, 0.0))), (UnsupportedBody,), "holds no node")
    assert outcome(gap).kind == "named error"
    assert outcome(gap._replace(expected=())).kind == "other"
    assert outcome(gap._replace(expected=(ValueError,))).kind == "other"  # of its class, not of a wider one
    assert outcome(gap._replace(says="grid")).kind == "other"
    assert kind(partial(refused, lambda: 3)) == "other"


def test_every_invalid_input_is_refused() -> None:
    for make, error, says in invalid():
        assert outcome(Case("", "", "", partial(refused, make), (error,), says)).kind == "named error"


@pytest.mark.parametrize(
    "change",
    [
        lambda s: replace(s, u=1.000001 * s.u),
        lambda s: replace(s, u=s.u * np.nan),
        lambda s: replace(s, strain=s.strain * (1 + 1e-6)),
        lambda s: replace(s, u=s.u + 1e-6 * np.abs(s.u).max() * np.eye(len(s.u))[-3]),  # one node
        lambda s: replace(s, solve=lambda b: s.solve(b) * np.nan),  # the adjoint
    ],
    ids=["scaled", "NaN", "strain", "node", "adjoint"],
)
def test_a_planted_error_is_found(
    change: Callable[[Equilibrium], Equilibrium], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert outcome(beam_analysis().case).kind == "right"
    planted(monkeypatch, change)
    assert outcome(beam_analysis().case).kind == "other"


@pytest.mark.parametrize("part", stability.Quantities._fields)
def test_nan_is_found_wherever_it_is(part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In one quantity, at one of its entries, of what is judged and not of the reference."""
    whole = stability.quantities

    def spoilt(model: Model, state: Equilibrium, rho: Array) -> stability.Quantities:
        found = whole(model, state, rho)
        values = getattr(found, part).copy()
        values.ravel()[-1] = np.nan
        return found._replace(**{part: values})

    monkeypatch.setattr(stability, "quantities", spoilt)
    assert outcome(beam_analysis().case).kind == "other"


def test_false_alarms_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def alarmed(model: Model, moduli: Array) -> Equilibrium:
        raise NotConverged("residual 1: support the body better")

    assert outcome(Analysis("", "", partial(model_of, "tent", (0.9, 0.0))).case).what.startswith("Wrong: false alarm")
    gap = Analysis("", "", partial(model_of, "tent", (0.9, 0.0)), error=UnsupportedBody)
    assert outcome(gap.case).kind == "named error"
    monkeypatch.setattr(stability, "equilibrium", alarmed)
    assert outcome(beam_analysis().case).what.startswith("Wrong: false alarm")


def test_an_answer_to_a_singular_system_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mechanism that the load does not move, under a solver that does not look for one."""
    make = partial(model_of, "tent", scene=beam(loads=(PointLoad((2.0, 1.0), (0.0, -1.0)),)))
    loose_end = Analysis("", "", make, np.where(np.floor(lattice().x[:, 0]) == 3, 0.0, 1.0), contrast=0.0)
    assert outcome(loose_end.case).kind == "named error"

    def unchecked(self: BandedCholesky, data: Array, tolerance: float) -> Solve:
        K = np.zeros((self.m, self.m))
        K[self.row, self.col] = K[self.col, self.row] = data
        return lambda b: np.linalg.pinv(K, rcond=1e-13, hermitian=True) @ b

    monkeypatch.setattr(BandedCholesky, "factor", unchecked)
    assert outcome(loose_end.case).kind == "other"


def test_expected_compliance_and_limits() -> None:
    """An invariance that fails, and a compliance far from the body's with and without a documented limit."""
    C = float(stability.quantities(*state_of(beam_analysis())).compliance[0])
    assert outcome(beam_analysis(compliance=C).case).kind == "right"
    assert outcome(beam_analysis(compliance=C * (1 + 1e-7)).case).kind == "other"
    assert outcome(beam_analysis(sane=C / 2).case).kind == "right"
    assert outcome(beam_analysis(sane=C / 3).case).kind == "other"
    softer = Limit("documented", least=1.0, most=4.0)
    assert outcome(beam_analysis(sane=C / 3, limit=softer).case).kind == "limit"
    assert outcome(beam_analysis(sane=C / 5, limit=softer).case).kind == "other"
    assert outcome(beam_analysis(sane=C * 3, limit=softer).case).kind == "other"
    assert outcome(beam_analysis(sane=C / 3, limit=softer, compliance=2 * C).case).kind == "other"


@pytest.mark.parametrize("family", ["units", "gradients", "descent"])
def test_refusing_everything_is_found(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A named error where the input is sound is no outcome to be content with."""

    def never(model: Model, moduli: Array, **how: Any) -> Equilibrium:
        return equilibrium(model, moduli, **how | {"tol": 0.0})

    monkeypatch.setattr("validation.studies.stability.scales.equilibrium", never)
    monkeypatch.setattr("mpmtop.cases.equilibrium", never)
    cases = {"units": units, "gradients": parameters, "descent": lambda: list(parameters())[300:]}[family]()
    assert {outcome(case).kind for case in islice(cases, 5)} == {"other"}


def test_solvers_that_differ_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    assert outcome(beam_analysis().twice).kind == "right"
    factor = BandedCholesky.factor

    def off(self: BandedCholesky, data: Array, tolerance: float | None = None) -> Solve:
        return factor(self, data * (1 + 1e-4), tolerance)

    monkeypatch.setattr(BandedCholesky, "factor", off)
    # refinement mends what a wrong factor gives
    assert outcome(beam_analysis().twice).kind == "right"
    planted_on = stability.equilibrium

    def direct_only(model: Model, moduli: Array) -> Equilibrium:
        state = planted_on(model, moduli)
        return replace(state, u=state.u * (1 + 1e-4)) if isinstance(model.solver, BandedCholesky) else state

    monkeypatch.setattr(stability, "equilibrium", direct_only)
    assert outcome(beam_analysis().twice).kind == "other"


def test_multigrid_that_gives_up_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without an answer there is nothing to compare, and no reason for it."""

    def gives_up(self: MultigridCG, data: Array, tolerance: float | None = None) -> Solve:
        raise NotConverged("planted")

    monkeypatch.setattr(MultigridCG, "factor", gives_up)
    assert outcome(beam_analysis().twice).what.startswith("Wrong: false alarm")


@pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")
def test_multigrid_sees_slivers() -> None:
    """Points that reach into cells by little: what hangs there is as soft as rounding of single precision, and softer.
    A coarsest factorisation in single precision had six of these wrong."""
    cuts = [analysis for analysis in ANALYSES["Small cuts"]() if analysis.family == "cut, GIMP"]
    found = [outcome(analysis.twice) for analysis in cuts]
    assert len(found) > 30
    assert [each for each in found if each.kind == "other"] == []


def test_displacements_on_void_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """An end that hangs on void of 1e-6 may be off by the tolerance of the load over the void's stiffness: by 10."""
    density = dict(fields(lattice().x))["random islands 2"]
    ends = Analysis("", "", partial(model_of, "GIMP", (0.1, 0.1)), density, contrast=1e-6)
    whole = stability.quantities

    def found(off: float) -> Outcome:
        def moved(model: Model, state: Equilibrium, rho: Array) -> stability.Quantities:
            result = whole(model, state, rho)
            away = 0.0 if isinstance(model.solver, BandedCholesky) else off
            return result._replace(displacement=result.displacement + away)

        monkeypatch.setattr(stability, "quantities", moved)
        return outcome(ends.twice)

    size = float(np.abs(whole(*state_of(ends)).displacement).max())
    assert found(0.0).kind == "right"
    assert 5.0 / size > 1e-5  # otherwise it would be right
    assert found(5.0).what == stability.SOFT
    assert found(20.0).kind == "other"


def test_tally() -> None:
    made = [outcome(Case(f, "", "j", lambda d=d: Finding(d))) for f, d in (("b", 0.1), ("a", 2.0), ("b", np.nan))]
    table = tally(made)
    assert list(table.index) == ["b", "a"]  # in their order
    assert table.loc["b", ["cases", "right", "named error", "limit", "other"]].tolist() == [2, 1, 0, 0, 1]
    assert table.loc["a", "other"] == 1


def test_known_optimum() -> None:
    """sum c / x is least at x = sqrt(c) V / mean(sqrt(c)) while no bound acts."""
    c = np.linspace(0.8, 1.2, 20)
    exact = np.sum(np.sqrt(c)) ** 2 / (0.4 * 20)
    assert Bars(c, np.full(20, 0.4)).optimum() == pytest.approx(exact, rel=1e-12)


def test_damaged_checkpoints() -> None:
    def kind_of(**damage: Any) -> str:
        return outcome(Case("", "", "", partial(damaged, **damage), (CheckpointError,), "start afresh")).kind

    assert kind_of() == "named error"  # cut to nothing
    assert kind_of(content=b"text") == "named error"
    kinds = {kind_of(flip=i) for i in range(20)}
    assert kinds <= {"named error", "right"}


def test_kills_that_do_not_kill_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that nobody kills ends as the whole one: that says nothing."""
    problem, rule = interruption.interrupted(), interruption.RULES["MMA"]
    whole = interruption.last_of(
        optimize(problem, rule, max_iterations=interruption.ITERATIONS, stop=lambda history: False)
    )
    moments = "after iteration 0", "before renaming 0"

    def kinds() -> set[str]:
        ends = [interruption.survives(problem, rule, moment, whole) for moment in moments]
        return {kind(partial(resumed, end, must_be_hit=True)) for end in ends}

    assert kinds() == {"right"}
    monkeypatch.setattr(interruption, "killed", lambda *arguments: None)
    assert kinds() == {"other"}


def test_no_problem_is_counted_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """No two cases have one name, no two analyses with a model one grid, K, load, weights and densities, bit for bit.

    Clouds at random are left out: they differ, and are many.
    """
    quick = [make for section, make in SECTIONS.items() if section != "Interruption"]
    names = [(case.family, case.name) for make in quick for case in make()]
    assert len(set(names)) == len(names)
    monkeypatch.setattr("mpmtop.model.findings", lambda *_, **__: ())  # a third of a model's time, and not compared
    seen: dict[bytes, str] = {}
    analyses = chain(chain.from_iterable(make() for make in ANALYSES.values()), materials())
    for analysis in analyses:
        if "random cloud" in analysis.family:
            continue
        try:
            model = direct(analysis.make())
        except ValueError:
            continue
        rho, moduli = stability.densities(model, analysis.rho, analysis.contrast)
        parts = (model.stiffness.data(moduli), model.f_ext, model.transfer.B.data, model.transfer.N, rho)
        # a body moved with its grid is the same problem, of which that is the claim
        parts += (np.array(model.grid.origin),)
        digest = md5(b"".join(part.tobytes() for part in parts), usedforsecurity=False).digest()
        name = f"{analysis.family}: {analysis.name}"
        assert seen.setdefault(digest, name) == name


def test_text_of_limits() -> None:
    assert over_edge("tent", 1e-3) is over_edge("GIMP", 0.0) is None
    assert not re.search(r"[|\n]", stability_cases.OUTER_EDGE.what)
