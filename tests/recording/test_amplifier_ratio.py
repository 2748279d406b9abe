"""An output voltage that is not the commanded one gives a warning with the ratio."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from heli3dof.recording.amplifier_ratio import amplifier_warnings
from heli3dof.recording.recording import Recording
from tests.flown import flown


@cache
def flight() -> Recording:
    return flown("steps", 20.0, device="mock:?speed=max&seed=1")


def halved(share: float) -> Recording:
    """A flight whose device reports ``share`` of the front motor's voltage from its middle on."""
    made = flight()
    voltage = made.voltage.copy()
    voltage[len(made) // 2 :, 0] *= share
    return replace(made, voltage=voltage)


def test_half_the_commanded_voltage_gives_a_warning_for_its_motor() -> None:
    (message,) = amplifier_warnings(halved(0.5))
    assert message.startswith("The front motor's output was 0.50 times the commanded voltage")


def test_the_error_of_a_measured_voltage_gives_no_warning() -> None:
    assert amplifier_warnings(halved(0.95)) == []
    whole = halved(1.0)
    assert amplifier_warnings(replace(whole, voltage=np.full_like(whole.voltage, np.nan))) == []
    assert amplifier_warnings(replace(whole, channels={})) == []
