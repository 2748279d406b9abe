"""A log that is thinner than its loop names nothing where nothing is hidden. Seeds from 1140."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.diagnose import diagnose
from heli3dof.diagnosis.noisy_flight import noisy_flight
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan
from heli3dof.model.greybox.model import nominal
from heli3dof.recording.recording import Recording


def thin(hide: str, every: int) -> Recording:
    """The rich plan flown at 500 Hz, of which every so manieth row is logged."""
    device = f"mock:?speed=max&hide={hide}&seed=1140&spread=0.07"
    flown = fly_plan(load_plan("rich"), device=device, seed=1140).recording
    return replace(flown.rows(slice(None, None, every)), channels={})


def test_at_100_hz_nothing_is_accused_and_the_rate_is_said() -> None:
    found = diagnose(thin("", 5), quick=True)
    assert found.verdict == "nothing_found"
    assert not found.findings
    assert found.about["nulls"] == "simulated"
    (note,) = found.integrity
    assert note.check == "clock.rate"
    assert "on the line between" in note.sentence


def test_at_100_hz_a_delay_of_15_ms_is_one() -> None:
    found = diagnose(thin("motor.delay:0.015", 5), quick=True)
    assert [f.choice.term.name for f in found.findings] == ["motor.delay"]
    value, std = found.findings[0].values["delay_s"]
    assert abs(value - 0.015) < max(4 * std, 0.001)


def test_a_null_of_a_thin_log_is_flown_by_the_loop_and_logged_as_thinly() -> None:
    log = thin("", 10)
    flown = noisy_flight(nominal(log.profile), log, np.random.default_rng(3))
    assert np.array_equal(flown.t, log.t)
    # At 50 Hz this controller would not hold the rig.
    assert np.abs(flown.angle[:, :2]).max() < np.radians(40)
