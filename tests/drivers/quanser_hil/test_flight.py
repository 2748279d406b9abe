"""A 10° step on a board, run by the loop that runs every rig."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import step_plan
from tests.profiles import PATIENT, profile

from .stand_in import install


@pytest.mark.usefixtures("own_clock")
def test_a_step_of_ten_degrees_runs(monkeypatch: pytest.MonkeyPatch):
    # The virtual clock ahead of the computer's must not count as the computer's sleep.
    monkeypatch.setattr("heli3dof.experiment.safety_monitors.host_suspend.ahead_s", lambda: 0.0)
    lab = install(monkeypatch)
    patient = profile(**PATIENT, landing_s=0.5)
    plan = step_plan((10.0, None, None), settle_s=2.0, duration_s=2.5)
    url = "quanser://q8_usb/0?watchdog_s=1&current=0,1"
    flight = fly_plan(plan, device=url, profile=patient)
    flight.raise_if_cut_short()
    t, roll = flight.recording.t, np.degrees(flight.recording.angle[:, 0])
    assert roll[0] == pytest.approx(-27.5, abs=0.5)  # on the table
    assert roll[np.searchsorted(t, 1.9)] == pytest.approx(4.4, abs=2.0)
    assert roll[np.searchsorted(t, 4.4)] == pytest.approx(13.0, abs=2.0)
    board = lab.boards["q8_usb", "0"]
    assert board.motor_volts() == (0.0, 0.0)
    assert board.holders == 0
