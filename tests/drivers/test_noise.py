"""The random torques, and the fit that they limit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from heli3dof_drivers.emulator.noise import CORRELATION_S, SIGMA_NM, TorqueNoise, Vibration

from heli3dof.experiment.plan import load_plan
from heli3dof.rig.profile import default_profile
from tests.drivers.flying import fit_percent, fly


def draw(dt: float, n: int, *, seed: int = 1, scale: float = 1.0) -> np.ndarray:
    noise = TorqueNoise(np.random.default_rng(seed), dt, scale)
    return np.array([noise.draw() for _ in range(n)])


@pytest.mark.parametrize("rate_hz", [200, 500, 1000])
def test_its_size_and_correlation_time_do_not_depend_on_the_control_rate(rate_hz):
    w = draw(1 / rate_hz, 100_000)
    np.testing.assert_allclose(w.std(axis=0), SIGMA_NM, rtol=0.05)
    lag = round(CORRELATION_S * rate_hz)
    along = (w[lag:] * w[:-lag]).mean(axis=0) / w.var(axis=0)
    np.testing.assert_allclose(along, math.exp(-1), atol=0.03)
    assert abs(np.corrcoef(w.T) - np.eye(3)).max() < 0.03


def test_one_seed_is_one_stream_and_scale_scales_it():
    np.testing.assert_array_equal(draw(0.002, 1500), draw(0.002, 1500))
    np.testing.assert_allclose(draw(0.002, 1500, scale=2.0), 2 * draw(0.002, 1500))
    assert not np.allclose(draw(0.002, 1500), draw(0.002, 1500, seed=2))
    assert not draw(0.002, 1500, scale=0.0).any()


def test_a_longer_correlation_keeps_the_density_at_low_frequencies():
    noise = TorqueNoise(np.random.default_rng(1), 0.002, 1.0, correlation_s=0.2)
    w = np.array([noise.draw() for _ in range(200_000)])
    # σ² τ_c is the same, so σ falls with the root of τ_c: 0.035 N·m √(0.01/0.2) = 0.0078 N·m.
    np.testing.assert_allclose(w.std(axis=0)[0], 0.0078, rtol=0.1)
    along = (w[100:] * w[:-100]).mean(axis=0) / w.var(axis=0)
    np.testing.assert_allclose(along, math.exp(-1), atol=0.06)


def test_a_vibration_has_the_standard_deviation_of_the_noise_and_its_own_frequency():
    vibration = Vibration(np.random.default_rng(1), 0.002, 1.0, 9.0)
    w = np.array([vibration.draw() for _ in range(100_000)])
    np.testing.assert_allclose(w.std(axis=0), SIGMA_NM, rtol=0.15)
    spectrum = np.abs(np.fft.rfft(w[:, 0])) ** 2
    hertz = np.fft.rfftfreq(len(w), 0.002)
    near = np.abs(hertz - 9.0) < 1.0
    assert spectrum[near].sum() > 0.85 * spectrum.sum()


def test_the_true_plant_replays_a_noisy_flights_pitch_to_about_94_percent():
    # The upper bound for every model (93.6 % on multisine).
    profile = default_profile()
    signals = load_plan("multisine").render(profile.dt, 1)
    noisy = fly("mock:?speed=max&start=level&seed=1", signals.reference, signals.extra)
    clean = fly("mock:?speed=max&start=level&noise=0", signals.reference, signals.extra)
    roll, pitch, yaw = fit_percent(noisy.angle, clean.true)
    assert 98.8 < roll < 99.4
    assert 92.5 < pitch < 95.0
    assert 98.5 < yaw < 99.2
