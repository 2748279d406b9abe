from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.identification.black_box.tf4 import companion, denominator, fit_tf4, state_space
from heli3dof.identification.transfer_function import TransferFunctions, polynomial

DEN = np.array([1.0, 1.379, 2.01, 1.072, 0.3533])  # eq (17)
NUM_DEG = np.array(
    [
        [[2.52, 6.568, 7.539, 3.989], [0.2395, -0.827, 1.139, 0.0], [-2.821, 0.3479, 1.807, 0.0]],
        [
            [-2.537, -6.706, -8.267, -3.854],
            [-0.6011, 0.5048, -1.381, -0.314],
            [2.19, -0.3158, -1.801, -1.047],
        ],
    ]
)  # [motor][axis], the paper's with 52 read as 2.52
T = 0.04


def eq17() -> TransferFunctions:
    num = np.zeros((3, 2, 5))
    num[:, :, 1:] = np.deg2rad(NUM_DEG).transpose(1, 0, 2)
    return TransferFunctions(num, DEN)


def simulate(n: int, seed: int, noise: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Voltages and angles of eq (17), input held over T, with offsets 0.1, 0.2, 0.3 rad."""
    rng = np.random.default_rng(seed)
    A, B, C = state_space(eq17(), T)
    u = np.cumsum(rng.standard_normal((n, 2)), axis=0) * 0.1
    u -= u.mean(axis=0)
    x, y = np.zeros(8), np.empty((n, 3))
    for k in range(n):
        y[k] = C @ x + [0.1, 0.2, 0.3]
        x = A @ x + B @ u[k]
    return u, y + noise * rng.standard_normal((n, 3))


def test_the_companion_form_has_the_denominator_as_characteristic_polynomial() -> None:
    np.testing.assert_allclose(np.poly(companion(DEN)[0]), DEN)


def test_the_state_space_has_the_paper_s_dc_gains() -> None:
    A, B, C = state_space(eq17(), T)
    dc = np.rad2deg(C @ np.linalg.solve(np.eye(8) - A, B))
    np.testing.assert_allclose(dc[:, 0], [11.29, 0, 0], atol=0.005)
    np.testing.assert_allclose(dc[:, 1], [-10.91, -0.889, -2.963], atol=0.005)


def test_two_second_order_factors_make_the_denominator() -> None:
    # (s² + s + 2)(s² + 3s + 4) = s⁴ + 4s³ + 9s² + 10s + 8
    np.testing.assert_allclose(denominator(np.log([1, 2, 3, 4])), [1, 4, 9, 10, 8])


def test_eq_17_is_recovered_exactly_from_its_own_output() -> None:
    data = [simulate(1500, 1), simulate(800, 2)]
    transfer, offset, _ = fit_tf4(data, T)
    np.testing.assert_allclose(transfer.den, DEN, rtol=1e-4)
    np.testing.assert_allclose(transfer.num, eq17().num, atol=2e-5)
    np.testing.assert_allclose(offset, [0.1, 0.2, 0.3], atol=1e-5)


@pytest.mark.accuracy
def test_standard_deviations_cover_the_truth_in_open_loop() -> None:
    """Nominal 95 %; 20 records with white noise, four coefficients each. Seeds 0–19."""
    inside = 0
    for seed in range(20):
        fit, _, _ = fit_tf4([simulate(1500, seed, noise=2e-3)], T)
        _, std = fit.std
        inside += int((np.abs(fit.den - DEN)[1:] <= 1.96 * std[1:]).sum())
    assert 66 <= inside <= 80


def test_lines_are_printed_like_the_paper_s() -> None:
    first = eq17().lines()[0]
    assert first == (
        "T(s)_{1,1} = (2.52s^3 + 6.568s^2 + 7.539s + 3.989) / "
        "(s^4 + 1.379s^3 + 2.01s^2 + 1.072s + 0.3533)"
    )
    assert eq17().lines()[1].startswith("T(s)_{1,2} = (0.2395s^3 - 0.827s^2 + 1.139s) / ")
    assert eq17().lines()[3].startswith("T(s)_{2,1} = (-2.537s^3 - 6.706s^2 - 8.267s - 3.854)")


@pytest.mark.parametrize(
    ("coefficients", "text"),
    [
        ([1.0, 0.0, -1.0], "s^2 - 1"),
        ([0.0, 0.0, -2.5], "-2.5"),
        ([-1.0, 3.0], "-s + 3"),
        ([0.0], "0"),
        ([1e-14, 5.0, 2.0], "5s + 2"),
        ([12345.6, 1.0], "1.235e+04s + 1"),
    ],
)
def test_polynomials_are_formatted(coefficients: list[float], text: str) -> None:
    assert polynomial(np.array(coefficients)) == text


def test_a_zero_and_its_deviation_are_the_hand_computed_ones() -> None:
    # N = 2s + 4, var of the constant 0.04 (std 0.2): z = −2, std z = 0.2/2 = 0.1
    num = np.zeros((3, 2, 3))
    num[0, 0] = [0, 2, 4]
    q = 2 + num.size
    cov = np.zeros((q, q))
    cov[2 + 2, 2 + 2] = 0.04
    tf = TransferFunctions(num, np.array([1.0, 3.0, 2.0]), cov)
    ((z, std),) = tf.zeros(0, 0)
    assert z == pytest.approx(-2)
    assert std == pytest.approx(0.1)


def test_json_holds_every_entry_in_degrees_per_volt() -> None:
    document = eq17().to_json()
    entry = document["entries"][3]
    assert (entry["input"], entry["output"]) == ("v_back_V", "roll_deg")
    np.testing.assert_allclose(entry["numerator"][1:], NUM_DEG[1, 0])


def test_the_frequency_response_has_the_standard_deviation_of_its_coefficients() -> None:
    q = 4 + 3 * 2 * 5
    root = np.random.default_rng(1).standard_normal((q, q)) * 1e-4
    exact = replace(eq17(), covariance=root @ root.T)
    omega = np.array([0.5, 2.0])
    G, std = exact.response(omega)
    A, B, C = state_space(eq17(), T := 1e-4)
    z = np.exp(1j * omega * T)
    sampled = [C @ np.linalg.solve(w * np.eye(len(A)) - A, B) for w in z]
    np.testing.assert_allclose(G, sampled, atol=1e-3 * np.abs(G).max())
    drawn = []
    for change in np.random.default_rng(2).standard_normal((3000, q)) @ root.T:
        den = DEN + np.r_[0.0, change[:4]]
        num = exact.num + change[4:].reshape(3, 2, 5)
        drawn.append(TransferFunctions(num, den).response(omega)[0])
    np.testing.assert_allclose(std, np.std(drawn, axis=0), rtol=0.1)
    assert np.isnan(eq17().response(omega)[1]).all()
