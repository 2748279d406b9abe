"""A flight that a safety trip ended is named, with the trip's time and reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.recording.row import RAMP_DOWN
from heli3dof.recording.safety_trip import trip_sentence, trip_warning
from tests.recording.make import flight


def test_the_time_of_the_trip_excludes_the_ramp() -> None:
    r = flight(1001)
    phase = np.where(r.t > 1.5, RAMP_DOWN, 0)
    meta = {**r.meta, "outcome": "tripped", "outcome_details": {"detail": "pitch reached 61°"}}
    tripped = replace(r, meta=meta, channels={**r.channels, "phase": phase})
    sentence = f"{r.name}: the flight was ended for safety after 1.5 s: pitch reached 61°."
    assert trip_sentence(tripped) == sentence
    (warning,) = trip_warning(tripped)
    assert warning.startswith(f"{sentence} The rows before its ramp to zero are used;")


def test_a_completed_flight_has_no_trip() -> None:
    assert trip_sentence(flight(100)) is None
    assert trip_warning(flight(100)) == []
