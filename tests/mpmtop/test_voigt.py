"""Voigt notation: strains of linear fields, in two dimensions and in three."""

import numpy as np
import pytest

from mpmtop.voigt import PAIRS, entries, local_B


@pytest.mark.parametrize("d", [2, 3])
def test_strain_of_a_linear_field(d: int) -> None:
    """u = A x at the corners of a simplex, whose gradients are constant: eps = (A + A^T) / 2, with engineering
    shear; a rotation has none."""
    rng = np.random.default_rng(0)
    corners, A = rng.normal(size=(d + 1, d)), rng.normal(size=(d, d))
    # rows of the inverse: N_n = c_n + grad_N_n . x
    grad_N = np.linalg.inv(np.column_stack([np.ones(d + 1), corners]))[1:].T[None]
    for gradient in (A, A - A.T):
        strain = np.einsum("pvnc,nc->pv", local_B(grad_N), corners @ gradient.T)[0]
        tensor = (gradient + gradient.T) / 2
        expected = [tensor[i, j] * (1 if i == j else 2) for i, j in PAIRS[d]]
        np.testing.assert_allclose(strain, expected, atol=1e-13)


@pytest.mark.parametrize("d", [2, 3])
def test_mean_dilatation_goes_to_every_normal_strain(d: int) -> None:
    rng = np.random.default_rng(1)
    grad_N, b_bar = rng.normal(size=(2, 5, 4, d))
    added = local_B(grad_N, b_bar) - local_B(grad_N)
    np.testing.assert_allclose(added[:, :d], np.repeat(b_bar[:, None], d, axis=1), atol=1e-15)
    assert np.all(added[:, d:] == 0)


@pytest.mark.parametrize("d", [2, 3])
def test_what_is_stored_is_what_is_not_zero(d: int) -> None:
    grad_N, b_bar = np.random.default_rng(2).uniform(1, 2, (2, 1, 3, d))
    np.testing.assert_array_equal(entries(d, False), local_B(grad_N)[0, :, 0] != 0)
    np.testing.assert_array_equal(entries(d, True), local_B(grad_N, b_bar)[0, :, 0] != 0)
