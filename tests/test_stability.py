"""The stress test's engine: it must see what is planted, and its reference must be right where the answer is known."""

import re
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from mpmtop.equilibrium import Equilibrium, Model, equilibrium
from mpmtop.linear_solver import BandedCholesky
from mpmtop.multigrid import Solve
from mpmtop.scene import Array, NotConverged, PointLoad, UnsupportedBody
from validation import stability
from validation.extended import Undetermined, condition, extended, full_stiffness, pseudo_compliance
from validation.stability import Analysis, Case, Finding, direct, is_named, outcome, refused, tally
from validation.stability_cases import ANALYSES, beam, fields, lattice, model_of, over_edge
from validation.stability_parameters import invalid
from validation.stability_runs import Bars, damaged


def kind(run: Callable[[], Finding]) -> str:
    return outcome(Case("family", "name", "judge", run)).kind


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
        for message in ("", "no", "nothing to do about it"):
            caught.value.args = (message,)
            assert not is_named(caught.value)
    assert kind(partial(refused, partial(model_of, "tent", (0.9, 0.0)))) == "named error"
    assert kind(partial(refused, lambda: 3)) == "other"


def test_every_invalid_input_is_refused() -> None:
    assert {kind(partial(refused, make)) for make in invalid()} == {"named error"}


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
        values.ravel()[-1] = np.nan if state.u.dtype == float else values.ravel()[-1]
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
    make = partial(model_of, "tent", scene=beam(contrast=0.0, loads=(PointLoad((2.0, 1.0), (0.0, -1.0)),)))
    loose_end = Analysis("", "", make, np.where(np.floor(lattice().x[:, 0]) == 3, 0.0, 1.0))
    assert outcome(loose_end.case).kind == "named error"

    def unchecked(self: BandedCholesky, data: Array) -> Solve:
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
    assert outcome(beam_analysis(sane=C / 3, limit="documented").case).kind == "limit"
    assert outcome(beam_analysis(sane=C * 3, limit="documented", compliance=2 * C).case).kind == "other"


def state_of(analysis: Analysis) -> tuple[Model, Equilibrium, Array]:
    model = direct(analysis.make())
    rho, moduli = stability.densities(model, analysis.rho)
    return model, equilibrium(model, moduli), rho


def test_reference_in_exact_arithmetic() -> None:
    """u of K u = f for integers: exact in extended precision, where double precision leaves cond x eps = 1e-10."""
    model = direct(model_of("GIMP", (0.1, 0.05), ghost=0.01))
    rho = dict(fields(lattice().x))["loaded end on void"]
    moduli = np.where(rho > 0, 1.0, 1e-6)
    exact = extended(model, moduli)
    K = full_stiffness(model, moduli)
    free = model.stiffness.dof
    assembled = np.zeros_like(K)
    s = model.stiffness
    assembled[s.row, s.col] = assembled[s.col, s.row] = s.data(moduli)
    np.testing.assert_allclose(K, assembled, rtol=0, atol=1e-15 * np.abs(K).max() * 10)
    values = np.linalg.eigvalsh(K / np.sqrt(np.outer(np.diag(K), np.diag(K))))
    assert exact.condition == pytest.approx(values[-1] / values[0], rel=3)  # of another norm
    u = np.random.default_rng(0).normal(size=len(free))
    at = np.zeros(len(model.f_ext), np.longdouble)
    at[free] = u
    strain = model.transfer.B.astype(np.longdouble) @ at
    stress = (model.points.volume * moduli)[:, None] * (strain.reshape(-1, 3) @ model.D)
    load = model.transfer.B.T.astype(np.longdouble) @ stress.ravel() + model.ghost.force(moduli, at)
    # eps of extended precision, 1e-19, times the condition number, 1e6; 1e-9 where long doubles are doubles
    eps = float(np.finfo(np.longdouble).eps)
    assert np.abs(exact.state.solve(load[free]) - u).max() < 100 * eps * exact.condition
    assert pseudo_compliance(model, moduli) == pytest.approx(float(model.f_ext @ exact.state.u), rel=1e-8)


def test_reference_of_a_singular_body() -> None:
    model = direct(model_of("tent"))
    moduli = np.where(np.abs(model.points.x[:, 0] - 2.5) < 0.6, 0.0, 1.0)
    assert condition(model, moduli) > 1e15
    with pytest.raises(Undetermined):
        extended(model, moduli)


def test_solvers_that_differ_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    assert outcome(beam_analysis().twice).kind == "right"
    factor = BandedCholesky.factor

    def off(self: BandedCholesky, data: Array) -> Solve:
        return factor(self, data * (1 + 1e-4))

    monkeypatch.setattr(BandedCholesky, "factor", off)
    # refinement mends what a wrong factor gives
    assert outcome(beam_analysis().twice).kind == "right"
    planted_on = stability.equilibrium

    def direct_only(model: Model, moduli: Array) -> Equilibrium:
        state = planted_on(model, moduli)
        return replace(state, u=state.u * (1 + 1e-4)) if isinstance(model.solver, BandedCholesky) else state

    monkeypatch.setattr(stability, "equilibrium", direct_only)
    assert outcome(beam_analysis().twice).kind == "other"


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
    assert kind(damaged) == "named error"  # cut to nothing
    assert kind(partial(damaged, content=b"text")) == "named error"
    kinds = {kind(partial(damaged, flip=i)) for i in range(20)}
    assert kinds <= {"named error", "right"}


def test_cases_have_their_own_names() -> None:
    """No case is counted twice; every message of an outcome fits a table."""
    for make in ANALYSES.values():
        names = [(a.family, a.name) for a in make()]
        repeated = len(names) - len(set(names))
        assert repeated == 0 or {f for f, _ in names if "random" in f}, "only random fields share a name"
    assert over_edge("tent", 1e-3) == over_edge("GIMP", 0.0) == ""
    assert not re.search(r"[|\n]", over_edge("GIMP", 1e-3))
