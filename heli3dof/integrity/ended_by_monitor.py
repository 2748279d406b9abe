"""Report that a safety trip or an emergency stop ended the flight. The recording stays usable."""

from __future__ import annotations

from collections.abc import Iterable

from heli3dof.integrity.base import Check, Fault, Kind, Stage
from heli3dof.integrity.view import View
from heli3dof.recording.safety_trip import outcome_details, trip_sentence

CAUSE = (
    "the rig differs from its profile: an encoder's sign, front and back swapped, the amplifier's "
    "gain; or the envelope is too tight."
)
FIX = (
    "switch the amplifier off; heli3dof monitor, and turn each axis by hand: do angle and sign "
    "agree?"
)


def ended(view: View) -> Iterable[Fault]:
    """Yield a note if a safety trip or an emergency stop ended the flight.

    The note's cause and remedy are those stored in the recording, or else `CAUSE` and `FIX`.
    """
    r = view.recording
    sentence = trip_sentence(r)
    if sentence is None:
        return
    details = outcome_details(r)
    yield Fault(
        "flight.tripped", Kind.NOTE, r.name, sentence,
        details.get("likely_cause") or CAUSE,
        details.get("fix") or FIX,
        confidence=0.5,
    )  # fmt: skip


CHECKS = (Check("flight.tripped", Stage.MOTION, "a safety trip or emergency stop", ended),)
