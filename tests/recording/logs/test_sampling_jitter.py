"""Samples that were not taken when the log says are found from the motion, and only then."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t as student

import heli3dof as h3
from heli3dof.recording.logs.sampling_jitter import motion_jitter
from heli3dof.rig.profile import default_profile
from tests.flown import flown
from tests.paths import REAL_DATA, needs_real_data

STEP = default_profile().encoder.rad_per_count


def motion(t: np.ndarray) -> np.ndarray:
    """Three angles that move at up to 40°/s, (N, 3) rad."""
    return np.column_stack([0.4 * np.sin(1.5 * t), 0.3 * np.sin(2.3 * t), 0.8 * np.sin(0.9 * t)])


def sampled(sigma: float, *, seed: int = 0, dt: float = 0.002) -> tuple[np.ndarray, np.ndarray]:
    """An even clock and what encoders read at t + δ."""
    t = np.arange(20_000) * dt
    late = sigma * np.random.default_rng(seed).standard_normal(len(t))
    return t, np.round(motion(t + late) / STEP) * STEP


@pytest.mark.parametrize("sigma", [0.0005, 0.001, 0.002])
@pytest.mark.parametrize("dt", [0.002, 0.005])
def test_the_size_of_the_jitter_is_right(sigma: float, dt: float) -> None:
    t, angle = sampled(sigma, dt=dt)
    result = motion_jitter(t, angle, STEP)
    assert result.is_significant
    assert result.sigma_s == pytest.approx(sigma, rel=0.1)


@pytest.mark.parametrize("seed", range(5))
def test_an_even_clock_gives_no_jitter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t, _ = sampled(0.0)
    noise = np.cumsum(rng.standard_normal((len(t), 3)), axis=0) * 2e-5
    angle = np.round((motion(t) + noise) / STEP) * STEP
    assert not motion_jitter(t, angle, STEP).is_significant


def test_the_standard_deviation_holds_for_axes_that_briefly_move_together() -> None:
    """Of punctual logs one in twenty is beyond Student's t of one in twenty, and none is named."""
    surest = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        t = np.arange(10_000) * 0.002
        together = np.exp(-(((t - 10) / 1.0) ** 2))
        waves = np.sin(np.outer(t, rng.uniform(1.5, 6, 3)) + rng.uniform(0, 6, 3))
        alone = 0.2 * np.sin(np.outer(t, [0.3, 0.0, 0.0]))  # the other axes are at rest
        angle = alone + 0.3 * together[:, None] * waves * [1.0, 1.0, 0.0]
        result = motion_jitter(t, np.round(angle / STEP) * STEP, STEP)
        assert not result.is_significant
        assert result.freedom < 20
        surest.append(student.sf(result.sigma_s**2 / result.variance_std_s2, result.freedom))
    assert np.mean(np.array(surest) < 0.05) == pytest.approx(0.05, abs=0.05)
    assert min(surest) > 5e-4


def test_true_time_stamps_give_no_hidden_jitter() -> None:
    t = np.arange(20_000) * 0.002 + 0.0005 * np.random.default_rng(1).standard_normal(20_000)
    angle = np.round(motion(t) / STEP) * STEP
    assert not motion_jitter(t, angle, STEP).is_significant


def test_one_angle_is_enough() -> None:
    t, angle = sampled(0.002)
    angle[:, 1:] = np.nan
    result = motion_jitter(t, angle, STEP)
    assert result.is_significant
    assert result.sigma_s == pytest.approx(0.002, rel=0.2)


def test_a_rig_at_rest_gives_no_jitter() -> None:
    t = np.arange(20_000) * 0.002
    assert not motion_jitter(t, np.zeros((20_000, 3)), STEP).is_significant


@pytest.mark.accuracy
@pytest.mark.parametrize(
    "hide", ["", "motor.lag:0.1", "friction.coulomb.yaw:0.05", "motor.delay:0.02"]
)
def test_no_emulated_effect_looks_like_jitter(hide: str) -> None:
    device = f"mock:?speed=max&hide={hide}"
    r = flown("rich", device=device, seed=1)
    assert not motion_jitter(r.t, r.angle, r.profile.encoder.rad_per_count).is_significant


@needs_real_data
def test_rig_a_has_hidden_jitter_and_rig_b_has_none() -> None:
    for rig, names, expected in (
        ("rig-a", ("closed-1a", "closed-1b", "closed-2a"), True),
        ("rig-b", ("closed-03", "closed-05", "closed-09", "closed-13"), False),
    ):
        profile = h3.load_profile(REAL_DATA / rig / "profile.toml")
        for name in names:
            r = h3.load(REAL_DATA / rig / f"{name}.csv", profile)
            assert np.ptp(np.diff(r.t)) < 1e-6  # the clock itself looks perfect
            result = motion_jitter(r.t, r.angle, profile.encoder.rad_per_count)
            assert result.is_significant is expected, (name, result)
