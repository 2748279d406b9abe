from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.identification.black_box.resampling import (
    NoContinuousModel,
    at_rate,
    continuous,
    trims,
    with_real_logarithm,
)
from heli3dof.identification.black_box.stabilisation import (
    spectral_radius,
    stable_plant,
    with_stable_predictor,
)
from heli3dof.model.discretisation import c2d_zoh
from tests.identification.systems import integrating_system, record


def test_twenty_samples_of_the_fast_model_are_one_of_the_slow() -> None:
    slow = integrating_system()
    fast = at_rate(slow, 0.04, 0.002)
    np.testing.assert_allclose(np.linalg.matrix_power(fast.A, 20), slow.A, atol=1e-9)
    total = sum(np.linalg.matrix_power(fast.A, i) @ fast.B for i in range(20))
    np.testing.assert_allclose(total, slow.B, atol=1e-9)


def test_continuous_time_is_the_hand_computed_one() -> None:
    # ẋ = −2 x + 3 u held for 0.1 s: A = e^−0.2, B = 3 (1 − e^−0.2)/2
    one = np.ones((1, 1))
    s = replace(
        integrating_system(), A=np.exp(-0.2) * one, B=1.5 * (1 - np.exp(-0.2)) * one,
        C=one, K=0.1 * one, S=one, d=np.zeros(1),
    )  # fmt: skip
    A, B = continuous(s, 0.1)
    np.testing.assert_allclose([A[0, 0], B[0, 0]], [-2, 3])


def test_a_double_integrator_is_converted_exactly() -> None:
    A, B = c2d_zoh(np.array([[0.0, 1.0], [0, 0]]), np.array([[0.0], [2.0]]), 0.04)
    s = replace(integrating_system(), A=A, B=B, C=np.eye(1, 2), K=np.ones((2, 1)), S=np.eye(1))
    Ac, Bc = continuous(s, 0.04)
    np.testing.assert_allclose(Ac, [[0, 1], [0, 0]], atol=1e-8)
    np.testing.assert_allclose(Bc, [[0], [2]], atol=1e-8)


def test_a_mode_at_zero_is_replaced_with_the_same_gain() -> None:
    A, B = np.diag([0.9, -0.1]), np.array([[1.0], [2.0]])
    A2, B2 = with_real_logarithm(A, B)
    np.testing.assert_allclose(np.linalg.eigvals(A2), [0.9, 0.1])
    # 2/(1 + 0.1) stays: B2 = 2 · 0.9/1.1
    np.testing.assert_allclose(B2[:, 0], [1.0, 2 * 0.9 / 1.1])


def test_a_slow_ringing_mode_has_no_continuous_model() -> None:
    with pytest.raises(NoContinuousModel, match=r"-0\.800"):
        with_real_logarithm(np.diag([0.9, -0.8]), np.ones((2, 1)))


def test_trims_reproduce_the_predictor_s_offset() -> None:
    s = replace(integrating_system(), d=np.array([0.01, -0.02, 0.03]))
    u0, y0 = trims(s, np.array([7.0, 7.1]), np.array([0.1, 0.2, 0.3]))
    # the constant output of the predictor about (u0, y0), written about the means
    CG = s.C @ np.linalg.inv(np.eye(5) - s.At)
    du, dy = u0 - [7.0, 7.1], y0 - [0.1, 0.2, 0.3]
    np.testing.assert_allclose(dy - CG @ (s.B @ du + s.K @ dy), s.d, atol=1e-9)


def test_the_resampled_predictor_is_stable_and_predicts_as_well() -> None:
    slow = integrating_system()
    fast = at_rate(slow, 0.04, 0.002)
    assert spectral_radius(fast.At) < 1


def test_an_unstable_predictor_is_given_a_kalman_gain() -> None:
    s = integrating_system()
    bad = replace(s, K=-s.K)
    assert spectral_radius(bad.At) > 1
    good = with_stable_predictor(bad, 0.95)
    assert spectral_radius(good.At) <= 0.95
    np.testing.assert_array_equal(good.A, s.A)


def test_stable_plant_keeps_stable_poles() -> None:
    s = replace(integrating_system(), A=np.diag([1.2, 0.9, 0.8, 0.7, 0.6]))
    lam = np.sort(np.linalg.eigvals(stable_plant(s, 0.99).A))
    np.testing.assert_allclose(lam, [0.6, 0.7, 0.8, 0.9, 0.99], rtol=2e-4)


def test_the_test_system_is_only_stable_with_feedback() -> None:
    _, y = record(integrating_system(), 2000, 0)
    assert np.abs(y).max() < 10
