"""The motion decides whether samples were taken at their time stamps or evenly."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.recording.logs.log_validation import timing
from heli3dof.recording.logs.sampling_clock import estimate_clock, sampling_times
from heli3dof.recording.recording import Recording, recording_of_arrays
from tests.recording.logs.test_sampling_jitter import STEP, motion
from tests.recording.make import open_profile

DT = 0.002


def log(stamps: np.ndarray, taken: np.ndarray) -> Recording:
    """Angles taken at one set of times (N,) s, logged with another."""
    angle = np.round(motion(taken) / STEP) * STEP
    return recording_of_arrays(stamps, np.zeros((len(stamps), 2)), angle, open_profile())


def arrivals(t: np.ndarray, burst: int) -> np.ndarray:
    """Stamps of a computer that receives ``burst`` samples at once."""
    return np.repeat(t[burst - 1 :: burst], burst) + 1e-5 * (np.arange(len(t)) % burst)


@pytest.mark.parametrize("dt", [DT, 0.01])
@pytest.mark.parametrize("burst", [2, 5])
def test_stamps_of_arrival_give_way_to_an_even_clock(burst: int, dt: float) -> None:
    t = dt * np.arange(10_000)
    recording = sampling_times(log(arrivals(t, burst), t))
    assert np.diff(recording.t) == pytest.approx(dt, rel=1e-6)
    assert recording.dt == pytest.approx(dt, rel=1e-6)


def test_late_stamps_without_bursts_give_way_to_an_even_clock_by_the_motion() -> None:
    rng = np.random.default_rng(5)
    t = DT * np.arange(10_000)
    recording = sampling_times(log(t + rng.uniform(0, 0.8 * DT, 10_000), t))
    assert np.diff(recording.t) == pytest.approx(DT, rel=1e-3)


def test_true_stamps_stay_however_uneven() -> None:
    rng = np.random.default_rng(3)
    t = DT * (np.arange(10_000) + rng.uniform(-0.45, 0.45, 10_000))
    recording = log(t, t)
    assert sampling_times(recording) is recording


def test_a_timer_of_an_ordinary_computer_is_taken_as_it_is() -> None:
    rng = np.random.default_rng(4)
    t = DT * np.arange(10_000)
    recording = log(t + rng.uniform(0, 0.1 * DT, 10_000), t)
    assert sampling_times(recording) is recording


def test_bursts_are_counted_as_samples_that_follow_each_other() -> None:
    clock = estimate_clock(arrivals(DT * np.arange(1000), 5))
    assert clock.period_s == pytest.approx(DT, rel=1e-4)
    assert clock.lost == 0


def test_a_sample_that_is_later_than_the_next_one_was_due_is_not_lost() -> None:
    rng = np.random.default_rng(6)
    k = np.delete(np.arange(2000), [500, 501, 1200])
    late = np.where(rng.random(len(k)) < 0.05, 0.7, 0.0)
    missing = estimate_clock(DT * (k + late)).missing
    assert np.flatnonzero(missing).tolist() == [499, 1197]
    assert missing.sum() == 3


def test_an_extra_time_stamp_is_no_negative_loss() -> None:
    t = DT * np.arange(2000)
    assert timing(np.insert(t, 1000, t[999] + 0.3 * DT)).lost_share == 0
