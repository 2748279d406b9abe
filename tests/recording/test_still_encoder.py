"""A completed flight whose encoder did not change at the end says so."""

from __future__ import annotations

import numpy as np

from heli3dof.recording.recording import Recording
from heli3dof.recording.row import CLOSED_LOOP, RAMP_DOWN
from heli3dof.recording.still_encoder import still_encoder_warnings
from heli3dof.rig.profile import default_profile


def flight(still_s: float, outcome: str = "completed") -> Recording:
    """10 s in closed loop at 100 Hz and 2 s of ramp; yaw stands still for the last ``still_s``."""
    t = np.arange(1200) / 100
    moving = np.arange(1200)
    still = np.minimum(moving, round(100 * (10 - still_s)) - 1)
    return Recording(
        t=t,
        angle=np.zeros((1200, 3)),
        reference=np.zeros((1200, 3)),
        voltage_cmd=np.zeros((1200, 2)),
        voltage_extra=np.zeros((1200, 2)),
        voltage=np.zeros((1200, 2)),
        profile=default_profile(),
        channels={
            "phase": np.where(t < 10, CLOSED_LOOP, RAMP_DOWN),
            "roll_count": moving,
            "pitch_count": moving,
            "yaw_count": np.where(t < 10, still, moving),
        },
        meta={"outcome": outcome},
    )


def test_an_encoder_that_stood_still_at_the_end_is_named_with_its_time() -> None:
    (warning,) = still_encoder_warnings(flight(7.0))
    assert warning.startswith("The yaw encoder's count did not change in the last 7 s")
    assert "heli3dof monitor" in warning


def test_a_shorter_standstill_is_no_warning() -> None:
    assert still_encoder_warnings(flight(4.0)) == []


def test_an_encoder_that_never_changed_is_named() -> None:
    (warning,) = still_encoder_warnings(flight(10.0))
    assert "yaw" in warning


def test_a_flight_that_was_cut_short_has_a_cause_of_its_own() -> None:
    assert still_encoder_warnings(flight(7.0, "tripped")) == []
