"""States that a safety trip or an emergency stop ended a flight."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from heli3dof.recording.recording import Recording
from heli3dof.recording.row import CLOSED_LOOP


def trip_sentence(recording: Recording) -> str | None:
    """Return a sentence with the time (s) and reason of a safety trip; None without a trip."""
    if recording.meta.get("outcome") != "tripped":
        return None
    phase = recording.channels.get("phase", np.full(len(recording), CLOSED_LOOP))
    flown = recording.t[phase == CLOSED_LOOP]
    detail = outcome_details(recording).get("detail")
    return (
        f"{recording.name}: the flight was ended for safety after "
        f"{flown[-1] - flown[0] if len(flown) else 0.0:.3g} s" + (f": {detail}." if detail else ".")
    )


def outcome_details(recording: Recording) -> Mapping[str, Any]:
    """Return the details that a flight's recording stores on how the flight ended; {} without."""
    details = recording.meta.get("outcome_details")
    return details if isinstance(details, dict) else {}


def why_short(recordings: Iterable[Recording], cause: str, fix: str) -> tuple[str, str]:
    """Return the cause and the remedy of too little motion in the ``recordings``.

    If a safety trip ended one of the flights, these are the trip and its remedy. Otherwise they are
    ``cause`` and ``fix``.
    """
    for recording in recordings:
        if (sentence := trip_sentence(recording)) is not None:
            return sentence, outcome_details(recording).get("fix") or fix
    return cause, fix


def trip_warning(recording: Recording) -> list[str]:
    """Return a warning on the use of a recording that a safety trip ended; [] without a trip."""
    sentence = trip_sentence(recording)
    if sentence is None:
        return []
    return [
        f"{sentence} The rows before its ramp to zero are used; the last ones may show the fault."
    ]
