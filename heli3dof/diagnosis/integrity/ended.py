"""Did the flight end as planned? A trip is no fault of the recording, but it has a cause."""

from __future__ import annotations

from collections.abc import Iterable

from heli3dof.diagnosis.integrity.base import Check, Fault, Kind, Stage
from heli3dof.diagnosis.integrity.view import View


def ended(view: View) -> Iterable[Fault]:
    r = view.recording
    if r.meta.get("outcome") != "tripped":
        return
    details = r.meta.get("outcome_details")
    detail = details.get("detail", "") if isinstance(details, dict) else ""
    yield Fault(
        "flight.tripped", Kind.NOTE, r.name,
        f"{r.name}: the flight was ended for safety after {r.duration:.3g} s"
        + (f": {detail}." if detail else "."),
        "a loop that this rig does not close as the profile says: an encoder's sign, front and "
        "back swapped, the amplifier's gain; or an envelope too tight.",
        "amplifier off, turn each axis by hand during heli3dof run-step --roll 1, and look at the "
        "signs: heli3dof report REC",
        confidence=0.5,
    )  # fmt: skip


CHECKS = (Check("flight.tripped", Stage.MOTION, "the flight was ended for safety", ended),)
