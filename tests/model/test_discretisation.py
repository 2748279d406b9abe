"""Between continuous and discrete time, and transfer functions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heli3dof.model.discretisation import c2d_zoh, continuous, d2c_zoh, numerators
from heli3dof.model.linear.hover import hover, hover_model
from heli3dof.model.linear.model import LinearModel
from heli3dof.paper.eq17 import DENOMINATOR, numerators_deg, paper17_model
from tests.model.examples import PROFILE

HOVER = hover_model(PROFILE)


def discrete(A: np.ndarray, dt: float = 0.01) -> LinearModel:
    n = len(A)
    rng = np.random.default_rng(0)
    return LinearModel(
        "m", "statespace", A, rng.normal(size=(n, 2)), rng.normal(size=(3, n)),
        np.zeros((n, 3)), np.eye(3), np.zeros(2), np.zeros(3), dt,
    )  # fmt: skip


@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.floats(0.001, 0.02))
@settings(max_examples=40, deadline=None)
def test_releasing_undoes_holding(seed: int, n: int, dt: float) -> None:
    rng = np.random.default_rng(seed)
    A, B = rng.normal(size=(n, n)) * 3, rng.normal(size=(n, 2))
    back = d2c_zoh(*c2d_zoh(A, B, dt), dt)
    assert back is not None
    np.testing.assert_allclose(back[0], A, atol=1e-8)
    np.testing.assert_allclose(back[1], B, atol=1e-8)


def test_the_hover_model_comes_back_from_its_samples_exactly() -> None:
    c = continuous(HOVER)
    assert c.method == "hold"
    np.testing.assert_allclose(c.A, hover(PROFILE).A, atol=1e-10)
    np.testing.assert_allclose(c.B, hover(PROFILE).B, atol=1e-10)


@pytest.mark.parametrize("pole", [-0.5, 0.0])
def test_a_pole_without_a_logarithm_goes_by_the_bilinear_rule(pole: float) -> None:
    m = discrete(np.diag([pole, 0.9]))
    c = continuous(m)
    assert c.method == "bilinear"
    # s = (2/dt)(z − 1)/(z + 1), and the gain at standstill is kept.
    expected = sorted(2 / 0.01 * (z - 1) / (z + 1) for z in (pole, 0.9))
    np.testing.assert_allclose(sorted(np.linalg.eigvals(c.A).real), expected)
    gain = m.C @ np.linalg.solve(np.eye(2) - m.A, m.B)
    np.testing.assert_allclose(c.D - c.C @ np.linalg.solve(c.A, c.B), gain)


def test_the_bilinear_rule_is_exact_on_the_unit_circle_at_its_warped_frequency() -> None:
    m = discrete(np.array([[-0.3, 0.2], [0.1, 0.8]]))
    c = continuous(m)
    w = 70.0  # rad/s, discrete
    z = np.exp(1j * w * m.dt)
    s = 1j * 2 / m.dt * np.tan(w * m.dt / 2)
    H_d = m.C @ np.linalg.solve(z * np.eye(2) - m.A, m.B)
    H_c = c.C @ np.linalg.solve(s * np.eye(2) - c.A, c.B) + c.D
    np.testing.assert_allclose(H_c, H_d, atol=1e-12)


def test_equation_17_is_printed_back_as_it_was_read() -> None:
    m = paper17_model(PROFILE)
    num, den = numerators(continuous(m))
    double = np.polymul(DENOMINATOR, DENOMINATOR)  # one realisation per motor
    np.testing.assert_allclose(den, double, rtol=1e-6)
    for motor in range(2):
        for axis in range(3):
            expected = np.polymul(np.deg2rad(numerators_deg()[motor, axis]), DENOMINATOR)
            got = num[axis, motor]
            assert abs(got[: -len(expected)]).max() < 1e-7
            np.testing.assert_allclose(got[-len(expected) :], expected, atol=1e-6)


def test_python_control_gets_the_models_response_in_both_times() -> None:
    m = paper17_model(PROFILE, corrected=True)
    d, c = m.to_control(), m.to_control(in_continuous_time=True)
    assert d.dt == 0.002
    assert c.isctime()
    w = 1.3
    expected = m.C @ np.linalg.solve(np.exp(1j * w * m.dt) * np.eye(8) - m.A, m.B)
    np.testing.assert_allclose(d(np.exp(1j * w * m.dt)), expected, atol=1e-12)
    np.testing.assert_allclose(c(1j * w), expected, rtol=0.02)
    tf = m.to_transfer_function()
    np.testing.assert_allclose(tf(1j * w), c(1j * w), rtol=1e-5)
    assert tf.input_labels == ["v_front_V", "v_back_V"]


def test_hover_transfer_functions_are_the_double_integrators_of_equation_11() -> None:
    tf = HOVER.to_transfer_function()
    h = hover(PROFILE)
    assert tf.num[0][0] == pytest.approx([h.B[3, 0]])
    assert tf.den[0][0] == pytest.approx([1, 0, 0], abs=1e-9)
    assert tf.num[2][1] == pytest.approx([h.A[5, 1] * h.B[4, 1]])
    assert tf.den[2][1] == pytest.approx([1, 0, 0, 0, 0], abs=1e-9)
