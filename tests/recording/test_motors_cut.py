"""A log that ends with the motors cut in flight says when, and where the rig came to rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.recording.motors_cut import motors_cut_warnings
from heli3dof.recording.recording import Recording
from tests.recording.make import flight, open_profile


def log(until_s: float = 20.0, roll_at_cut_deg: float = 8.0, off_V: float = 0.0) -> Recording:
    """A log at 100 Hz whose motors are cut at 10 s, and whose arm rests on the table from 11 s."""
    n = round(100 * until_s)
    t = np.arange(n) / 100
    roll = np.interp(t, [0, 5, 10, 11], np.radians([-27, 8, roll_at_cut_deg, -27]))
    voltage = np.where(t[:, None] < 10, 7.0, off_V) * np.ones(2)
    r = replace(flight(n), t=t, voltage=voltage, profile=open_profile(), meta={"name": "log"})
    return replace(r, angle=np.column_stack([roll, 0 * t, 0 * t]))


def test_the_cut_and_the_rest_are_stated() -> None:
    (warning,) = motors_cut_warnings(log())
    assert warning.startswith("The motors went to zero in flight at 10 s, at a roll of 8.0°. From ")
    assert warning.endswith(" s on, roll stays at −27.0° for 8.99 s.")


def test_a_log_that_ends_in_the_fall_states_its_end() -> None:
    (warning,) = motors_cut_warnings(log(until_s=10.5))
    assert "The log ends 0.49 s later, at −9" in warning


@pytest.mark.parametrize(
    "r",
    [
        log(roll_at_cut_deg=-27.0),
        log(off_V=5.0),
        replace(log(), meta={"outcome": "tripped"}),
        replace(log(), angle=np.full((2000, 3), np.nan)),
    ],
    ids=["landed", "powered", "outcome", "no roll"],
)
def test_other_ends_give_no_warning(r: Recording) -> None:
    assert motors_cut_warnings(r) == []
