"""The envelope ends a flight at each of its limits, and names the limit."""

from __future__ import annotations

from math import inf, nan, radians

import pytest

from heli3dof.rig.envelope import Envelope
from heli3dof.rig.profile import default_profile

LEVEL = (0.0, 0.0, 0.0)
HOVER = (7.456, 7.456)


def check(t=0.0, angle=LEVEL, rate=LEVEL, command=HOVER, voltage=HOVER):
    envelope = Envelope(default_profile())
    assert envelope.check(0.0, LEVEL, LEVEL, HOVER, HOVER) is None
    return envelope.check(t, angle, rate, command, voltage)


def test_hovering_is_inside() -> None:
    assert check() is None


def test_rest_on_the_table_is_inside() -> None:
    assert check(angle=(radians(-27.5), 0.0, 0.0)) is None


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"angle": (radians(34.1), 0, 0)}, "roll reached 34.10°"),
        ({"angle": (radians(-33), 0, 0)}, "roll reached -33.00°"),
        ({"angle": (0, radians(-61), 0)}, "pitch reached -61.00°"),
        ({"angle": (0, 0, radians(721))}, "yaw reached 721.00°"),
        ({"angle": (nan, 0, 0)}, "roll reached nan"),
        ({"rate": (0, radians(401), 0)}, "pitch turned at 401°/s"),
        ({"rate": (0, nan, 0)}, "pitch turned at nan"),
        ({"command": (nan, 0)}, "nan V on the front motor"),
        ({"command": (0, inf)}, "inf V on the back motor"),
        ({"voltage": (nan, 0)}, "front motor's command is nan V"),
        ({"voltage": (0, -24.1)}, "back motor's command is -24.10 V"),
        ({"t": 600.1}, "longer than the envelope's 600 s"),
    ],
)
def test_each_limit_ends_the_flight_and_is_named(change: dict, words: str) -> None:
    trip = check(**change)
    assert trip is not None
    assert words in trip


def test_a_flight_that_begins_beyond_the_envelope_needs_zero_first() -> None:
    low = (radians(-60.81), 0.0, 0.0)
    trip = Envelope(default_profile()).check(0.0, low, LEVEL, (0.0, 0.0), (0.0, 0.0))
    assert trip.startswith("roll began at -60.81°, beyond the envelope's -32°")
    assert "restart of the device in the air" in trip.cause
    assert trip.fix.startswith("let the rig rest, then heli3dof zero")


def test_a_voltage_that_jumps_faster_than_the_slew_limit_ends_the_flight() -> None:
    envelope = Envelope(default_profile())  # 5000 V/s at 500 Hz: 10 V a period
    assert envelope.check(0.0, LEVEL, LEVEL, HOVER, (0.0, 0.0)) is None
    assert envelope.check(0.002, LEVEL, LEVEL, HOVER, (9.9, 0.0)) is None
    assert "jumped at 5050 V/s" in (envelope.check(0.004, LEVEL, LEVEL, HOVER, (9.9, -10.1)) or "")


def test_after_skipped_periods_the_voltage_has_had_longer_to_change() -> None:
    envelope = Envelope(default_profile())
    assert envelope.check(1.0, LEVEL, LEVEL, HOVER, (0.0, 0.0)) is None
    assert envelope.check(1.010, LEVEL, LEVEL, HOVER, (20.0, 0.0)) is None  # five periods
    assert "jumped at" in (envelope.check(1.012, LEVEL, LEVEL, HOVER, (9.9, 0.0)) or "")
    # Clock jitter does not raise the slew rate.
    assert envelope.check(1.0101, LEVEL, LEVEL, HOVER, (20.0, 9.9)) is None
