"""Transfer functions are reduced to the factors that the fit determines."""

from __future__ import annotations

import numpy as np
import pytest

import heli3dof as h3
from heli3dof.identification.factored_transfer_function import FactoredTransferFunction
from heli3dof.identification.fit_result import Pole
from heli3dof.identification.reduction import factored
from heli3dof.identification.transfer_function import DEGREES, TransferFunctions
from heli3dof.model.discretisation import numerators


def transfer(num: list[float], den: list[float], std: float | None) -> TransferFunctions:
    """The same num/den from each motor to roll, and from front minus back to pitch.

    Every coefficient but the leading ones has the standard deviation ``std``.
    """
    k = len(den)
    full = np.zeros((3, 2, k))
    full[0, :, k - len(num) :] = num
    full[1, :, k - len(num) :] = np.outer([1, -1], num)
    cov = None if std is None else std**2 * np.eye(k - 1 + full.size)
    return TransferFunctions(full / 2, np.array(den), cov)


def roll_from_sum(tf: TransferFunctions) -> FactoredTransferFunction:
    return factored(tf)[0]


def test_the_hover_model_is_a_chain_of_integrators() -> None:
    hover = h3.hover_model(h3.default_profile())
    by_name = {
        (f.output, f.input): f for f in factored(TransferFunctions(*numerators(hover.continuous())))
    }
    assert str(by_name["roll", "sum"]).endswith(" / s²")
    assert str(by_name["yaw", "difference"]).endswith(" / s⁴")
    for crossed in (("roll", "difference"), ("pitch", "sum"), ("yaw", "sum")):
        assert str(by_name[crossed]) == "0"
    p = h3.default_profile()
    J_roll = p.mass.m_w * p.geometry.L_w**2 + (p.mass.m_f + p.mass.m_b) * p.geometry.L_a**2
    b = 2 * p.geometry.L_a * p.motor.K_f / J_roll
    assert by_name["roll", "sum"].gain == pytest.approx(b, rel=1e-6)


def test_a_pole_and_a_zero_within_the_uncertainty_cancel() -> None:
    pair = np.poly([-2.0, -3.0])
    tf = transfer([1.0, 2.01], list(pair), 0.05)
    found = roll_from_sum(tf)
    assert found.numerator == ()
    (pole,) = found.denominator
    assert pole.coefficients[0] == pytest.approx(3.0)
    exact = roll_from_sum(transfer([1.0, 2.01], list(pair), 1e-6))
    assert len(exact.numerator) == 1
    assert len(exact.denominator) == 2


def test_a_leading_coefficient_that_is_rounding_is_dropped() -> None:
    found = roll_from_sum(transfer([1e-15, 4.904], [1.0, 0.0, 0.0], None))
    assert str(found) == f"{4.904 * DEGREES:.4g} / s²"


def test_a_double_pole_is_real() -> None:
    found = roll_from_sum(transfer([1.0], list(np.poly([-9.21, -9.21, -1.0])), None))
    assert "(s+9.21)²" in str(found)


def test_the_standard_deviations_are_those_of_the_coefficients() -> None:
    # k/(s + a): the coefficients are the gain and the pole, each with its standard deviation.
    num = np.zeros((3, 2, 2))
    num[0, :, 1] = 2.0
    cov = np.zeros((13, 13))
    cov[0, 0], cov[2, 2] = 0.01**2, 0.03**2  # of a; of the front motor's constant coefficient
    found = roll_from_sum(TransferFunctions(num, np.array([1.0, 0.5]), cov))
    assert found.gain == pytest.approx(4.0)
    assert found.gain_std == pytest.approx(0.03, rel=1e-3)
    assert found.denominator[0].std[0] == pytest.approx(0.01, rel=1e-3)
    assert str(found) == f"{4 * DEGREES:.1f}±{0.03 * DEGREES:.1f} / (s+0.500±0.010)"


def test_a_pole_gets_the_standard_deviation_of_the_list_of_poles() -> None:
    tf = transfer([1.0], list(np.poly([-1 + 2j, -1 - 2j])), 1e-3)
    poles = [Pole(complex(-1, im), 0.1, 0.2) for im in (2, -2)]
    (factor,) = factored(tf, poles=poles)[0].denominator
    assert factor.coefficients == pytest.approx((2.0, 5.0))
    assert factor.std == pytest.approx((0.2, 2 * np.hypot(0.1, 0.4)))


def test_the_python_control_object_has_the_same_response() -> None:
    found = roll_from_sum(transfer([1.0, 1.0], list(np.poly([-2.0, -3 + 1j, -3 - 1j])), None))
    s = 1j * np.array([0.3, 1.0, 5.0])
    assert found.to_control()(s) == pytest.approx(found.at(s))


def uncertain(den: list[float], gain: float, gain_std: float, den_std: float) -> TransferFunctions:
    """``gain``/den from the sum of the motors to roll; standard deviations of both."""
    k = len(den)
    num = np.zeros((3, 2, k))
    num[0, :, -1] = gain / 2
    cov = np.zeros((k - 1 + num.size,) * 2)
    cov[: k - 1, : k - 1] = den_std**2 * np.eye(k - 1)
    for motor in range(2):
        constant = k - 1 + motor * k + k - 1
        cov[constant, constant] = gain_std**2 / 2
    return TransferFunctions(num, np.array(den), cov)


def test_a_lag_shorter_than_a_sample_is_no_factor() -> None:
    """Its pole of 1000 rad/s changes the response at 100 rad/s by 10 %, within 2 σ = 20 %."""
    den = [1.0, 1000.0, 0.0, 0.0]
    found = roll_from_sum(uncertain(den, 5000.0, 500.0, 0.0))
    assert str(found).endswith(" / s²")
    assert found.gain == pytest.approx(5.0, rel=0.05)
    exact = roll_from_sum(uncertain(den, 5000.0, 0.5, 0.0))
    assert exact.denominator[-1].coefficients == pytest.approx((1000.0,))


def test_a_pair_within_two_standard_deviations_of_the_origin_is_a_double_integrator() -> None:
    found = roll_from_sum(uncertain([1.0, 0.01, 0.002], 5.0, 0.5, 0.02))
    assert str(found).endswith(" / s²")
    exact = roll_from_sum(uncertain([1.0, 0.01, 0.002], 5.0, 0.5, 1e-6))
    assert [len(f.coefficients) for f in exact.denominator] == [2]


@pytest.mark.parametrize(
    ("k_std", "printed"),
    [(0.0066, "/ [s² (s+86.0±1.0)]"), (0.0020, "/ [(s+0.1080±0.0090) (s−0.1150±0.0090)")],
)
def test_a_mirrored_pair_of_real_poles_is_judged_by_the_stiffness(
    k_std: float, printed: str
) -> None:
    """Poles ±√−k: a stiffness k within two standard deviations of 0 leaves a double integrator."""
    stable, unstable, lag = -0.108, 0.115, -86.0
    std = k_std / (2 * np.sqrt(-stable * unstable))
    poles = [Pole(stable, std, 0.0), Pole(unstable, std, 0.0), Pole(lag, 1.0, 0.0)]
    tf = transfer([100.0], list(np.poly([stable, unstable, lag])), None)
    slopes = np.zeros((2, len(tf.den) - 1 + tf.num.size))
    slopes[:, :3] = [1.0, -lag, 0.0], [0.0, 1.0, -lag]  # of (s² + b s + k)(s + 86), by b and by k
    covariance = slopes.T @ np.diag([0.005**2, k_std**2]) @ slopes
    found = factored(TransferFunctions(tf.num, tf.den, covariance), poles=poles)[0]
    assert printed in str(found)


def test_a_reduced_transfer_function_stays_strictly_proper() -> None:
    """Both poles beyond the grid, 4000 and 5000 rad/s, could go; two zeros remain."""
    tf = transfer(list(2e7 * np.poly([-2.0, -3.0])), list(np.poly([-1.0, -4e3, -5e3])), None)
    spread = 0.05 * np.abs(np.concatenate([tf.den[1:], tf.num.ravel()]))
    found = roll_from_sum(TransferFunctions(tf.num, tf.den, np.diag(spread**2)))
    zeros, poles = (
        sum(len(f.coefficients) for f in factors)
        for factors in (found.numerator, found.denominator)
    )
    assert zeros < poles
