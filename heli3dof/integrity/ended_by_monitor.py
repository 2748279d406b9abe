"""Report that a safety monitor ended the flight. The recording stays usable."""

from __future__ import annotations

from collections.abc import Iterable

from heli3dof.integrity.base import Check, Fault, Kind, Stage
from heli3dof.integrity.view import View


def ended(view: View) -> Iterable[Fault]:
    r = view.recording
    if r.meta.get("outcome") != "tripped":
        return
    details = r.meta.get("outcome_details")
    detail = details.get("detail", "") if isinstance(details, dict) else ""
    yield Fault(
        "flight.tripped", Kind.NOTE, r.name,
        f"{r.name}: a safety monitor ended the flight after {r.duration:.3g} s"
        + (f": {detail}." if detail else "."),
        "the rig differs from its profile: an encoder's sign, front and back swapped, the "
        "amplifier's gain; or the envelope is too tight.",
        "switch the amplifier off, turn each axis by hand during heli3dof run-step --roll 1, and "
        "check the signs: heli3dof report REC",
        confidence=0.5,
    )  # fmt: skip


CHECKS = (Check("flight.tripped", Stage.MOTION, "a safety monitor ended the flight", ended),)
