"""A step is distinguished from coloured noise by the likelihood ratio of the module's equations."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.conclusion import step_in_noise as module
from heli3dof.diagnosis.conclusion.step_in_noise import (
    INTERVAL_S,
    MOST_INTERVALS,
    Series,
    interval_means,
    step_margin,
    step_test,
)

K = 80


def series(mean: np.ndarray, source: np.ndarray | None = None) -> Series:
    source = np.zeros(len(mean), dtype=np.int64) if source is None else source
    return Series(source, (np.arange(len(mean)) + 0.5) * INTERVAL_S, mean, INTERVAL_S)


def coloured(rng: np.random.Generator, correlation_s: float, n: int = K) -> np.ndarray:
    """Noise of variance 1 whose correlation falls by e in ``correlation_s``: an AR(1) process."""
    e = np.exp(-INTERVAL_S / correlation_s)
    x = rng.standard_normal(n)
    for k in range(1, n):
        x[k] = e * x[k - 1] + np.sqrt(1 - e**2) * x[k]
    return x


def is_step(s: Series) -> bool:
    ratio, threshold = step_test(s, np.random.default_rng(0))
    return ratio > threshold


def test_the_likelihood_ratio_of_a_step_in_white_noise_is_that_of_a_regression() -> None:
    """Noise of ± 1 around a step of 10: the sum of squares falls from 80 · (1 + 5²) to 80."""
    x = np.tile([1.0, -1.0], K // 2) + 10.0 * (np.arange(K) >= K // 2)
    ratio, _ = step_test(series(x), np.random.default_rng(0))
    # K ln 26 = 261 with white noise in both models; noise that alternates is even less likely to
    # be coloured, and the model without the step may choose coloured noise: at most 261.
    assert 0.3 * K * np.log(26) < ratio <= K * np.log(26)


@pytest.mark.parametrize("correlation_s", [0.05, 1.0, 10.0])
def test_coloured_noise_is_no_step(correlation_s: float) -> None:
    rng = np.random.default_rng(1)
    found = sum(is_step(series(coloured(rng, correlation_s))) for _ in range(40))
    assert found <= 2  # FALSE_ALARMS · 40 = 0.12 are expected


@pytest.mark.parametrize("correlation_s", [0.05, 1.0])
def test_a_large_step_in_coloured_noise_is_found(correlation_s: float) -> None:
    rng = np.random.default_rng(2)
    step = 6.0 * (np.arange(K) > 50)
    assert all(is_step(series(coloured(rng, correlation_s) + step)) for _ in range(10))


def test_a_ramp_is_no_step() -> None:
    rng = np.random.default_rng(3)
    ramp = np.linspace(0.0, 6.0, K)
    assert not any(is_step(series(0.3 * coloured(rng, 1.0) + ramp)) for _ in range(10))


def test_a_step_at_the_same_instant_of_two_recordings_is_one_step() -> None:
    rng = np.random.default_rng(4)
    half = np.arange(40) >= 20
    x = np.concatenate([coloured(rng, 0.1, 40) + 5.0 * half for _ in range(2)])
    s = series(x, np.repeat([0, 1], 40))
    both = s._replace(t=np.tile(s.t[:40], 2))
    one = Series(s.source[:40], s.t[:40], x[:40], INTERVAL_S)
    assert step_test(both, rng)[0] > 1.5 * step_test(one, rng)[0]


def test_intervals_have_half_a_second_and_their_number_is_limited() -> None:
    t = np.arange(0.0, 10.0, 0.01)
    short = interval_means(np.zeros(len(t), dtype=np.int64), t, 2.0 * t)
    assert short.width_s == INTERVAL_S
    np.testing.assert_allclose(short.t, np.arange(0.25, 10.0, 0.5))
    np.testing.assert_allclose(short.mean, 2.0 * (short.t - 0.005), atol=1e-9)
    t = np.arange(0.0, 600.0, 0.1)
    long = interval_means(np.zeros(len(t), dtype=np.int64), t, t)
    assert len(long.mean) <= MOST_INTERVALS + 1


@pytest.mark.filterwarnings("error")
def test_many_hours_of_recordings_can_be_tested() -> None:
    rng = np.random.default_rng(5)
    t, noise = np.arange(0.5, 40.5) * 200.0, rng.standard_normal(40)
    ratio, threshold = step_test(Series(np.zeros(40, dtype=np.int64), t, noise, 200.0), rng)
    assert 0 <= ratio < threshold


def test_an_interval_with_few_samples_is_omitted() -> None:
    t = np.arange(0.0, 10.0, 0.01)
    t = t[(t < 4.0) | (t > 5.4)]
    assert not np.any(np.abs(interval_means(np.zeros(len(t), dtype=np.int64), t, t).t - 5.25) < 0.2)


@pytest.mark.parametrize(("seconds", "is_tested"), [(2.4, False), (5.0, True)])
def test_a_recording_of_five_intervals_is_too_short(
    monkeypatch: pytest.MonkeyPatch, seconds: float, is_tested: bool
) -> None:
    t = np.arange(0.0, seconds, 0.01)
    data = SimpleNamespace(t=t, runs=[SimpleNamespace(source=0)], blocks=[(0, 0, len(t))])
    torque = np.random.default_rng(6).standard_normal((len(t), 3))
    run = SimpleNamespace(data=data, torque=torque)
    monkeypatch.setattr(module, "linearised_run", lambda fit: run)
    assert (step_margin(cast(Any, None), 0, seed=0) > 0) == is_tested
