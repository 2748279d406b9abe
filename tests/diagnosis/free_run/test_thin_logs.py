"""Diagnosis of decimated logs of the emulated rig. Seeds from 1140."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.diagnose import diagnose
from heli3dof.identification.bias_correction.simulated_flight import simulated_flight
from heli3dof.model.greybox.model import nominal
from heli3dof.recording.recording import Recording
from tests.flown import flown


def decimated(hide: str, every: int) -> Recording:
    """Return 40 s of the rich plan at 500 Hz with every ``every``-th row."""
    device = f"mock:?speed=max&hide={hide}&seed=1140&spread=0.07"
    flight = flown("rich", 40.0, device=device, seed=1140)
    return replace(flight.rows(slice(None, None, every)), channels={})


def test_at_100_hz_nothing_is_found_and_the_rate_is_reported() -> None:
    result = diagnose(decimated("", 5), quick=True)
    assert result.verdict == "off_calibration"  # the rig is up to 7 % off its profile
    assert not result.findings
    assert result.about["nulls"] == "simulated"
    (note,) = result.integrity
    assert note.check == "clock.rate"
    assert "are interpolated" in note.sentence


def test_at_100_hz_a_delay_of_15_ms_is_found() -> None:
    result = diagnose(decimated("motor.delay:0.015", 5), quick=True)
    assert [f.term.name for f in result.findings] == ["motor.delay"]
    value, std = result.findings[0].values["delay_s"]
    assert abs(value - 0.015) < max(4 * std, 0.001)


def test_a_null_of_a_decimated_log_is_simulated_at_the_loop_rate_and_decimated() -> None:
    log = decimated("", 10)
    again = simulated_flight(nominal(log.profile), log, np.random.default_rng(3))
    assert np.array_equal(again.t, log.t)
    # At 50 Hz this controller would not stabilise the rig.
    assert np.abs(again.angle[:, :2]).max() < np.radians(40)
