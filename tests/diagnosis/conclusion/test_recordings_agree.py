"""Frequencies in the commanded motion: the share of a signal's variance in a line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.diagnosis.conclusion.recordings_agree import is_in_motion, line_share
from heli3dof.recording.recording import make_recording
from heli3dof.rig.profile import default_profile

T = np.arange(0, 60, 0.002)
SQUARE = np.where(np.floor(T / 5) % 2 == 0, 10.0, -10.0)


@pytest.mark.parametrize(("harmonic", "share"), [(1, 0.811), (3, 0.0901), (5, 0.0324)])
def test_a_square_waves_lines_hold_8_over_pi_squared_k_squared(harmonic: int, share: float) -> None:
    assert line_share(T, SQUARE, harmonic * 0.1) == pytest.approx(share, rel=0.01)


def test_the_share_is_zero_between_lines_and_for_a_constant_signal() -> None:
    assert line_share(T, SQUARE, 0.25) < 0.001
    assert line_share(T, np.full(len(T), 3.0), 0.1) == 0.0
    assert line_share(T, np.full(len(T), np.nan), 0.1) == 0.0


def test_without_a_logged_reference_the_angles_give_the_commanded_motion() -> None:
    t = np.arange(15_000) * 0.002
    r = make_recording(t, np.zeros((len(t), 2)), np.zeros((len(t), 3)), default_profile())
    swings = np.stack([0.0 * t, 0.2 * np.sin(2 * np.pi * 0.2 * t), 0.0 * t], axis=1)
    nothing = np.full_like(swings, np.nan)
    assert is_in_motion(replace(r, reference=nothing, angle=swings), 0.2)
    assert not is_in_motion(replace(r, reference=nothing, angle=swings), 1.3)
    assert is_in_motion(replace(r, reference=swings, angle=np.zeros_like(swings)), 0.2)
    assert not is_in_motion(replace(r, reference=np.zeros_like(swings), angle=swings), 0.2)
