"""States that a safety trip or an emergency stop ended a flight."""

from __future__ import annotations

import numpy as np

from heli3dof.recording.recording import Recording
from heli3dof.recording.row import CLOSED_LOOP


def trip_sentence(recording: Recording) -> str | None:
    """Return a sentence with the time (s) and reason of a safety trip; None without a trip."""
    if recording.meta.get("outcome") != "tripped":
        return None
    phase = recording.channels.get("phase", np.full(len(recording), CLOSED_LOOP))
    flown = recording.t[phase == CLOSED_LOOP]
    details = recording.meta.get("outcome_details")
    detail = details.get("detail") if isinstance(details, dict) else None
    return (
        f"{recording.name}: the flight was ended for safety after "
        f"{flown[-1] - flown[0] if len(flown) else 0.0:.3g} s" + (f": {detail}." if detail else ".")
    )


def trip_warning(recording: Recording) -> list[str]:
    """Return a warning on the use of a recording that a safety trip ended; [] without a trip."""
    sentence = trip_sentence(recording)
    if sentence is None:
        return []
    return [
        f"{sentence} The rows before its ramp to zero are used; the last ones may show the fault."
    ]
