"""Encoders as intervals: the probabilities, and that a resting encoder is not believed twice."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate
from scipy.stats import norm

from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import noise_step
from heli3dof.model.estimation.filter_data import Data
from heli3dof.model.estimation.quantised_measurement import interval, rate_event
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.model.physics.rotor import lagged
from heli3dof.rig.profile import default_profile

STEP = 2 * np.pi / 4096


@settings(max_examples=80, deadline=None)
@given(st.floats(-6, 6), st.floats(0.05, 5), st.floats(0.1, 3))
def test_the_intervals_probability_score_and_information_are_a_normals(lo, width, sd) -> None:  # type: ignore[no-untyped-def]
    logZ, g, w = interval(lo, lo + width, sd**2)
    a, b = lo / sd, (lo + width) / sd
    upper = norm.logcdf(b) if b < 0 else norm.logsf(a)
    lower = norm.logcdf(a) if b < 0 else norm.logsf(b)
    expected = upper + np.log(-np.expm1(lower - upper))
    if a <= 0 <= b:
        expected = np.log(norm.cdf(b) - norm.cdf(a))
    assert logZ == pytest.approx(expected, rel=1e-6, abs=1e-9)
    e = 1e-4 * sd
    # The interval is measured from the mean: m → m + e is lo → lo − e.
    up, down = (
        interval(lo - e, lo - e + width, sd**2)[0],
        interval(lo + e, lo + e + width, sd**2)[0],
    )
    assert g == pytest.approx((up - down) / (2 * e), rel=1e-4, abs=1e-4)
    assert -1e-9 <= w * sd**2 <= 1 + 1e-9


def test_far_out_nothing_overflows() -> None:
    logZ, g, w = interval(50.0, 51.0, 1.0)
    assert logZ == pytest.approx(-0.5 * 50**2 - np.log(50 * np.sqrt(2 * np.pi)), abs=1e-3)
    assert g == pytest.approx(50.0, abs=0.05)
    assert 0 < w <= 1


@pytest.mark.parametrize(("v", "sd"), [(0.3, 0.1), (0.0, 0.2), (-0.4, 0.1), (-1.0, 0.1)])
def test_the_flux_is_the_mean_of_the_positive_rates(v: float, sd: float) -> None:
    mean = integrate.quad(lambda x: x * norm.pdf(x, v, sd), 0, max(v, 0) + 12 * sd, points=[1e-3])[
        0
    ]
    log, g, _ = rate_event(v, sd**2)
    assert np.exp(log) == pytest.approx(mean, rel=1e-5)
    e = 1e-5
    assert g == pytest.approx(
        (rate_event(v + e, sd**2)[0] - rate_event(v - e, sd**2)[0]) / (2 * e), rel=1e-5
    )


def test_a_rotor_that_may_rise_only_so_fast_does_and_then_follows_its_lag() -> None:
    # 20 V away, at most 40 V/s, τ 0.1 s: 0.4 s in a straight line to 16 V, then the exponential.
    assert lagged(0.0, 20.0, 0.1, 40.0, 0.4) == pytest.approx(16.0)
    assert lagged(0.0, 20.0, 0.1, 40.0, 0.5) == pytest.approx(20 - 4 * np.exp(-1))
    assert lagged(20.0, 0.0, 0.1, 40.0, 0.1) == pytest.approx(20 * np.exp(-1))  # down it is free


def roll_alone(noise: float, amplitude: float, seed: int, seconds: float = 60.0) -> Data:
    """A double integrator under feedback of its true state, read by a perfect encoder."""
    rng = np.random.default_rng(seed)
    h, N = 0.002, round(seconds / 0.002)
    gain = 0.6604 * 0.1188 * 2 / 0.9145
    x = v = 0.0
    V, y = np.zeros(N), np.zeros(N)
    for k in range(N):
        y[k] = np.round(x / STEP) * STEP
        u = -4 * (x - amplitude * np.sign(np.sin(0.1 * np.pi * k * h))) - 3 * v
        V[k] = u / gain
        z = rng.standard_normal(2)
        dv = noise * np.sqrt(h) * z[0]
        x += h * v + h * h / 2 * u + h * dv / 2 + noise * h**1.5 / np.sqrt(12) * z[1]
        v += h * u + dv
    Y = np.full((N, 3), np.nan)
    Y[:, 0] = y
    return Data(
        np.arange(N) * h, np.full(N, h), np.column_stack([V, V]), Y,
        np.array([[0, 0, N]], dtype=np.int64), np.array([[True, False, False]]),
        np.array([[STEP, 0.0, 0.0]]), (), np.full(3, STEP),
    )  # fmt: skip


@pytest.mark.parametrize("amplitude", [0.0, 0.01, 0.1])
def test_the_noise_is_found_whether_the_encoder_moves_or_all_but_rests(amplitude: float) -> None:
    """White noise of Δ²/12 overrates it 5 to 30 times here."""
    problem = Likelihood(roll_alone(0.006, amplitude, 1), Structure(default_profile(), ()))
    theta = problem.structure.scaled(np.array([1e-9, 0.9145, 0.03635, 0.9508]))
    a = np.array([0.03, 0.03, 0.03, 0.0])
    for _ in range(8):
        a, _moved = noise_step(problem, theta, a, np.array([True, False, False]))
    assert 0.7 < a[0] / 0.006 < 1.5


def test_an_encoder_that_never_steps_is_looked_at_a_few_times_only() -> None:
    data = roll_alone(1e-6, 0.0, 1, seconds=4.0)
    assert len(np.unique(data.y[:, 0])) == 1
    problem = Likelihood(data, Structure(default_profile(), ()))
    theta = problem.structure.scaled(np.array([1e-9, 0.9145, 0.03635, 0.9508]))
    assert len(problem.run(theta, np.array([0.006, 1.0, 1.0, 0.0])).row) < 40  # of 2000 samples


def test_the_tangents_are_what_a_changed_parameter_does_to_the_predictions() -> None:
    data = roll_alone(0.006, 0.1, 2, seconds=10.0)
    problem = Likelihood(data, Structure(default_profile(), ()))
    theta = problem.structure.scaled(np.array([1e-9, 0.9145, 0.03635, 0.9508]))
    noise = np.array([0.006, 1.0, 1.0, 0.0])
    at = problem.run(theta, noise)
    D = problem.tangents(theta, at, np.array([1]))
    e = 1e-3
    moved = problem.tangents(theta + np.array([0, e, 0, 0]), at, np.array([1]))
    assert np.abs(D).max() > 0
    np.testing.assert_allclose(moved, D, atol=2e-2 * np.abs(D).max())
    assert not problem.tangents(theta, at, np.array([2, 3])).any()  # pitch and yaw are not there
