"""Laws: derivatives by complex steps, eigenvectors and three dimensions as the other way to the same stress."""

import numpy as np
import pytest

from mpmtop.arrays import Array
from mpmtop.body import Material
from mpmtop.errors import InvalidScene
from mpmtop.large_deformation.law import (
    SERIES_BELOW,
    Hencky,
    Law,
    NeoHookean,
    jacobian,
    kirchhoff,
    lame,
    out_of_plane,
    stress,
    tangent,
    von_mises,
)
from mpmtop.material import tangent as elastic

LAWS = pytest.mark.parametrize("law", [Hencky(0.3), NeoHookean(0.3), Hencky(-0.4), NeoHookean(0.49)], ids=repr)
STEP = 1e-30


def gradients(n: int = 60) -> Array:
    """From rigid to a stretch of ten, through the change of formula and with coincident principal stretches."""
    rng = np.random.default_rng(0)
    F = rng.standard_normal((n, 2, 2)) * np.logspace(-9, 0.3, n)[:, None, None] + np.eye(2)
    a = np.arcsinh(np.sqrt(SERIES_BELOW * np.array([0.999999, 1.000001])))  # half a logarithmic difference
    near = np.zeros((2, 2, 2))
    near[:, 0, 0], near[:, 1, 1] = np.exp(a / 2), np.exp(-a / 2)
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    return np.concatenate([F[jacobian(F) > 0.05], near, np.array([np.eye(2), 1.7 * np.eye(2), turn, 0.2 * turn])])


@LAWS
def test_stress_is_the_derivative_of_the_energy(law: Law) -> None:
    F = gradients()
    P = stress(law, F)
    for i in range(2):
        for j in range(2):
            step = F.astype(complex)
            step[:, i, j] += 1j * STEP
            np.testing.assert_allclose(law.energy(step).W.imag / STEP, P[:, i, j], rtol=1e-12, atol=1e-13)


@LAWS
def test_tangent_is_the_derivative_of_the_stress_and_symmetric(law: Law) -> None:
    F = gradients()
    P, A = tangent(law, F)
    np.testing.assert_array_equal(P, stress(law, F))
    for k in range(4):
        step = F.astype(complex).reshape(-1, 4)
        step[:, k] += 1j * STEP
        by_step = stress(law, step.reshape(-1, 2, 2)).imag / STEP
        scale = np.abs(A).max(axis=(1, 2))[:, None]
        # the closed form loses 1 / SERIES_BELOW of its digits
        np.testing.assert_allclose(by_step.reshape(-1, 4) / scale, A[:, :, k] / scale, atol=1e-13)
    np.testing.assert_allclose(A, A.swapaxes(1, 2), rtol=1e-14, atol=1e-15)


def test_hencky_by_eigenvectors() -> None:
    law = Hencky(0.3)
    lam, mu = lame(0.3)
    F = gradients()
    value, vector = np.linalg.eigh(F @ F.swapaxes(1, 2))
    e = np.log(value) / 2
    tau = (vector * (lam * e.sum(axis=1, keepdims=True) + 2 * mu * e)[:, None]) @ vector.swapaxes(1, 2)
    np.testing.assert_allclose(kirchhoff(stress(law, F), F), tau, atol=1e-14, rtol=1e-13)
    np.testing.assert_allclose(
        law.energy(F).W, lam / 2 * e.sum(axis=1) ** 2 + mu * (e**2).sum(axis=1), atol=1e-15, rtol=1e-12
    )


@LAWS
def test_von_mises_is_that_of_the_stress_in_space(law: Law) -> None:
    F = gradients()
    tau = np.zeros((len(F), 3, 3))
    tau[:, :2, :2], tau[:, 2, 2] = kirchhoff(stress(law, F), F), out_of_plane(law, F)
    deviator = tau - np.trace(tau, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    vm, by_F = von_mises(law, F)
    np.testing.assert_allclose(vm, np.sqrt(1.5 * np.sum(deviator**2, axis=(1, 2))), rtol=1e-12, atol=2e-15)
    some = vm > 1e-6  # next to none it has no derivative
    for k in range(4):
        step = F[some].astype(complex).reshape(-1, 4)
        step[:, k] += 1j * STEP
        by_step = von_mises(law, step.reshape(-1, 2, 2))[0].imag / STEP
        np.testing.assert_allclose(by_step, by_F[some].reshape(-1, 4)[:, k], rtol=1e-9, atol=1e-9)
    assert np.all(by_F[vm == 0] == 0)


@LAWS
def test_rotation_turns_the_stress_and_makes_none(law: Law) -> None:
    angle = np.linspace(0, 2 * np.pi, 9)
    R = np.stack([np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)], axis=1).reshape(-1, 2, 2)
    assert np.abs(stress(law, R)).max() < 1e-15 * np.abs(elastic(Material(1.0, law.poisson))).max() * 4
    F = gradients()[10]
    np.testing.assert_allclose(stress(law, R @ F), R @ stress(law, F[None]), atol=1e-14)


@LAWS
def test_small_strain_is_linear_elasticity(law: Law) -> None:
    A = tangent(law, np.eye(2)[None])[1][0]
    voigt = np.array([[1, 0, 0], [0, 0, 0.5], [0, 0, 0.5], [0, 1, 0]])
    np.testing.assert_allclose(
        A @ voigt, voigt @ np.diag([1, 1, 2]) @ elastic(Material(1.0, law.poisson)), atol=1e-15 * A.max()
    )


@pytest.mark.parametrize("law", [Hencky, NeoHookean])
def test_poisson_out_of_range_is_refused(law: type) -> None:
    with pytest.raises(InvalidScene, match="Poisson"):
        law(0.5)
