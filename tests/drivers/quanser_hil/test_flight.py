"""A 10° step on a board, flown by the loop that flies every rig."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import step_plan

from .stand_in import install


@pytest.mark.realtime
def test_a_step_of_ten_degrees_flies(monkeypatch: pytest.MonkeyPatch):
    lab = install(monkeypatch)
    plan = step_plan((10.0, None, None), settle_s=3.0, duration_s=4.0)
    flight = fly_plan(plan, device="quanser://q8_usb/0?watchdog_s=1&current=0,1")
    flight.raise_if_cut_short()
    t, roll = flight.recording.t, np.degrees(flight.recording.angle[:, 0])
    assert roll[0] == pytest.approx(-27.5, abs=0.5)  # on the table
    assert roll[np.searchsorted(t, 2.9)] == pytest.approx(3.0, abs=2.0)
    assert roll[np.searchsorted(t, 6.9)] == pytest.approx(11.8, abs=1.5)
    board = lab.boards["q8_usb", "0"]
    assert board.motor_volts() == (0.0, 0.0)
    assert board.holders == 0
