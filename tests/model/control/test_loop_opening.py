"""Opened loops: the share of an axis is frozen, and what flew obeys the recorded law exactly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heli3dof.model.control.controller import (
    CLOSED,
    LEARN,
    OPEN,
    Controller,
    open_loop_bounds,
)
from heli3dof.rig.profile import Limits, default_profile

PROFILE = default_profile()
STILL = (0.0, 0.0, 0.0)


def flown(modes: list[tuple[int, int, int]], angles: np.ndarray, reference=STILL):  # type: ignore[no-untyped-def]
    c = Controller.of(PROFILE)
    c.reset(angles[0])
    return [c.step_opened(m, a, reference, (0.0, 0.0)) for m, a in zip(modes, angles, strict=True)]


def test_the_free_range_is_seven_tenths_of_the_envelope() -> None:
    # Roll may be from −32° to 34°: its middle is 1°, seven tenths of its half width 23.1°.
    bounds = np.degrees(open_loop_bounds(Limits()))
    np.testing.assert_allclose(bounds[:4], [-22.1, 24.1, 42.0, 504.0])


def test_an_open_roll_loop_no_longer_answers_to_roll() -> None:
    angles = np.zeros((300, 3))
    angles[100:, 0] = np.radians(5.0) * np.linspace(0, 1, 200)  # 12.5°/s
    modes = [(LEARN, CLOSED, CLOSED)] * 100 + [(OPEN, CLOSED, CLOSED)] * 200
    steps = flown(modes, angles)
    # Learned at rest at level: roll asked for nothing, so hover's 7.456 V goes out, whatever roll.
    for _, _, _, v in steps[100:]:
        np.testing.assert_allclose(v, 7.456, atol=1e-9)
    # Closed, 5° below its reference costs 37.6 V/rad at the least.
    closed = flown([(CLOSED,) * 3] * 300, angles)
    assert abs(closed[-1][3][0] - 7.456) > 37.6 * np.radians(5.0)


def test_pitch_stays_under_control_while_roll_is_open() -> None:
    angles = np.zeros((100, 3))
    angles[50:, 1] = np.radians(2.0)
    steps = flown([(LEARN, CLOSED, CLOSED)] * 50 + [(OPEN, CLOSED, CLOSED)] * 50, angles)
    front, back = steps[-1][3]
    # K_mp = ±13.2 V/rad against 2°: −0.46 V in front, +0.46 V behind; the rate has died away.
    assert front - 7.456 == pytest.approx(-13.2 * np.radians(2.0), abs=1e-3)
    assert back - 7.456 == pytest.approx(13.2 * np.radians(2.0), abs=1e-3)


def test_what_was_learned_at_a_trim_is_held() -> None:
    angles = np.full((400, 3), 0.0)
    angles[:, 0] = np.radians(-1.0)
    modes = [(LEARN, CLOSED, CLOSED)] * 200 + [(OPEN, CLOSED, CLOSED)] * 200
    steps = flown(modes, angles)
    learned = np.mean([v[0] for _, _, _, v in steps[:200]])
    np.testing.assert_allclose([v[0] for _, _, _, v in steps[200:]], learned, atol=1e-9)


def test_beyond_the_free_range_the_controller_takes_over_until_the_segment_ends() -> None:
    angles = np.zeros((300, 3))
    angles[:100, 0] = np.radians(np.linspace(20.0, 24.0, 100))
    angles[100:200, 0] = np.radians(25.0)  # beyond 24.1°
    modes = [(OPEN, CLOSED, CLOSED)] * 300
    steps = flown(modes, angles)
    assert steps[99][0][0] == angles[99, 0]
    caught = steps[100:]
    # The reference comes back from where roll was at 10°/s; the frozen voltage fades, no jump.
    np.testing.assert_allclose(np.diff(np.degrees([r[0] for r, *_ in caught[:100]])), -0.02)
    added = np.array([e[0] for _, e, _, _ in caught])
    assert added[0] == pytest.approx(steps[99][1][0] * (1 - 0.002 / 0.03))
    assert (added[-50:] == 0.0).all()


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_recorded_law_gives_the_flown_voltage_to_the_last_bit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angles = np.cumsum(rng.normal(0, 0.002, (200, 3)), axis=0)
    modes = [tuple(int(m) for m in row) for row in np.repeat(rng.integers(0, 3, (10, 3)), 20, 0)]
    extra = rng.normal(0, 1, (200, 2))
    c = Controller.of(PROFILE)
    c.reset(angles[0])
    again = Controller.of(PROFILE)
    again.reset(angles[0])
    for m, a, e in zip(modes, angles, extra, strict=True):
        r, added, cmd, v = c.step_opened(m, a, (0.1, 0.0, -0.1), e)
        assert again.step(a, r, added) == (cmd, v)
