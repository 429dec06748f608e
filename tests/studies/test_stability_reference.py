"""The stress test's reference is right where the answer is known, and sees wrong physics."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NoReturn

import numpy as np
import pytest
import scipy.sparse as sp

from mpmtop import model as library
from mpmtop.arrays import Array, Mask
from mpmtop.equilibrium import Derivative, equilibrium
from mpmtop.objectives import COMPLIANCE
from mpmtop.transfer import Transfer
from tests.studies.planted import beam_analysis
from validation.measures.derivatives import central_difference
from validation.oracles.dense import equations_of
from validation.oracles.extended import Undetermined, condition, extended, full_stiffness, pseudo_compliance
from validation.studies.stability import judge as stability
from validation.studies.stability.cases import FUNCTIONS, fields, lattice, model_of
from validation.studies.stability.judge import Analysis, direct, outcome

pytestmark = pytest.mark.filterwarnings("ignore::mpmtop.diagnose.ModelWarning")  # bodies are moved and cut on purpose


@pytest.mark.parametrize("function", FUNCTIONS)
def test_reference_is_of_the_same_problem(function: str) -> None:
    """Two routes to N, B, D, f_ext and K: some roundings apart."""
    model = direct(model_of(function, (0.1, 0.05), ghost=0.0 if "spline" in function else 0.01))
    equations = equations_of(model)
    np.testing.assert_array_equal(equations.nodes, model.transfer.nodes)
    np.testing.assert_array_equal(equations.free, model.stiffness.dof)
    for ours, theirs in (
        (model.transfer.N_matrix.toarray(), equations.N),
        (model.transfer.B.toarray(), equations.B),
        (model.D, equations.D),
        (model.f_ext, equations.f_ext),
    ):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-14)
    moduli = np.random.default_rng(0).uniform(1e-3, 1, 40)
    K, s = full_stiffness(model, moduli), model.stiffness
    ours = np.zeros_like(K)
    ours[s.row, s.col] = ours[s.col, s.row] = s.data(moduli)
    np.testing.assert_allclose(K, ours, rtol=0, atol=1e-14)


def test_reference_in_exact_arithmetic() -> None:
    """u of K u = f for a given u: exact in extended precision, where double precision leaves cond x eps = 1e-10."""
    model = direct(model_of("GIMP", (0.1, 0.05), ghost=0.01))
    rho = dict(fields(lattice().x))["loaded end on void"]
    moduli = np.where(rho > 0, 1.0, 1e-6)
    exact = extended(model, moduli)
    equations, K = exact.equations, full_stiffness(model, moduli)
    values = np.linalg.eigvalsh(K / np.sqrt(np.outer(np.diag(K), np.diag(K))))
    assert exact.condition == pytest.approx(values[-1] / values[0], rel=3)  # of another norm
    u = np.random.default_rng(0).normal(size=len(equations.free))
    at = np.zeros(len(equations.f_ext), np.longdouble)
    at[equations.free] = u
    stress = (equations.volume * moduli)[:, None] * ((equations.B @ at).reshape(-1, 3) @ equations.D)
    load = equations.B.T @ stress.ravel() + model.ghost.force(moduli, at)
    # eps of extended precision, 1e-19, times the condition number, 1e6; 1e-9 where long doubles are doubles
    eps = float(np.finfo(np.longdouble).eps)
    assert np.abs(exact.solve(load[equations.free]) - u).max() < 100 * eps * exact.condition
    assert pseudo_compliance(model, moduli) == pytest.approx(float(equations.f_ext @ exact.u), rel=1e-8)


def test_gradients_of_the_reference() -> None:
    """sum dC/dlnE = -C, and the p-norm's gradient beside a central difference, of an error of 1e-8."""
    model = direct(model_of("GIMP", (0.1, 0.05), ghost=0.01))
    rng = np.random.default_rng(4)
    rho, direction = rng.uniform(0.3, 1, 40), rng.uniform(-1, 1, 40)
    moduli = rng.uniform(0.1, 1, 40)
    found = stability.reference(model, moduli, rho)[0]
    assert np.sum(found.compliance_gradient) == pytest.approx(-found.compliance[0], rel=1e-12)

    def p_norm(logarithm: Array) -> float:
        return float(stability.reference(model, np.exp(logarithm), rho)[0].p_norm[0])

    slope = central_difference(p_norm, np.log(moduli), direction, 1e-4)
    assert found.p_norm_gradient @ direction == pytest.approx(slope, rel=1e-6)


def linear_in(monkeypatch: pytest.MonkeyPatch, change: Callable[[Transfer], Transfer]) -> None:
    """Every model is made with changed weights."""
    made = library.transfer
    monkeypatch.setattr(library, "transfer", lambda *arguments: change(made(*arguments)))


def too_large(m: pytest.MonkeyPatch) -> None:
    linear_in(m, lambda t: replace(t, B=1.2 * t.B, grad_N=1.2 * t.grad_N))


def deleted(m: pytest.MonkeyPatch) -> None:
    def change(t: Transfer) -> Transfer:
        kept = np.ones(len(t.N))
        kept[len(kept) // 2] = 0
        B = sp.csr_array(sp.diags_array(np.repeat(kept, 3)) @ t.B)
        return replace(t, B=B, grad_N=t.grad_N * kept[:, None, None])

    linear_in(m, change)


def load_lost(m: pytest.MonkeyPatch) -> None:
    force = library.external_force
    m.setattr(library, "external_force", lambda *arguments: (at := force(*arguments))._replace(fixed=0.7 * at.fixed))


def stiff_in_shear(m: pytest.MonkeyPatch) -> None:
    D = library.tangent
    m.setattr(library, "tangent", lambda material: D(material) * np.array([[1, 1, 1], [1, 1, 1], [1, 1, 2]]))


def held_in_x(m: pytest.MonkeyPatch) -> None:
    """y held at one node only."""
    held = library.held_dofs

    def change(*arguments: Any, **settings: Any) -> Mask:
        whole = held(*arguments, **settings)
        kept = whole & (np.arange(len(whole)) % 2 == 0)
        kept[np.flatnonzero(whole)[1]] = True
        return kept

    m.setattr(library, "held_dofs", change)


def twice_the_gradient(m: pytest.MonkeyPatch) -> None:
    m.setattr(stability, "COMPLIANCE", COMPLIANCE._replace(work=2.0))


def gradient_upside_down(m: pytest.MonkeyPatch) -> None:
    derivative = stability.p_norm_stress_derivative

    def change(*arguments: Any, **settings: Any) -> Derivative:
        by = derivative(*arguments, **settings)
        return by if by.u is None else by._replace(u=-by.u)

    m.setattr(stability, "p_norm_stress_derivative", change)


@pytest.mark.parametrize(
    "plant",
    [too_large, deleted, load_lost, stiff_in_shear, held_in_x, twice_the_gradient, gradient_upside_down],
    ids=lambda plant: plant.__name__,
)
def test_wrong_physics_is_found(plant: Callable[[pytest.MonkeyPatch], None], monkeypatch: pytest.MonkeyPatch) -> None:
    """What is wrong in model and objectives alike is right by itself: only a reference of its own sees it."""
    plant(monkeypatch)
    for function in FUNCTIONS:
        body = Analysis("", "", partial(model_of, function, (0.1, 0.05)), np.linspace(0.3, 1, 40))
        assert outcome(body.case).kind == "other"


def test_an_error_of_the_reference_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: Any) -> NoReturn:
        equilibrium(beam_analysis().make(), np.full(40, np.nan))
        raise AssertionError("NaN was taken")

    monkeypatch.setattr(stability, "objectives", refuse)
    assert outcome(beam_analysis().case).what.startswith("Wrong: no reference")


def test_reference_of_a_singular_body() -> None:
    model = direct(model_of("tent"))
    moduli = np.where(np.abs(model.points.x[:, 0] - 2.5) < 0.6, 0.0, 1.0)
    assert condition(model, moduli) > 1e15
    with pytest.raises(Undetermined):
        extended(model, moduli)
