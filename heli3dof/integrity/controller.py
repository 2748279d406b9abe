"""Check that a known controller reproduces the recorded voltages.

`heli3dof.model.control.voltage_replay` compares the profile's controller with the log. The
diagnosis simulates flights with this controller. It needs another one if the profile has no
controller, or if a different controller flew the recording. In these cases,
`heli3dof.model.control.controller_identification` identifies a linear controller from the log.
"""

from __future__ import annotations

from collections.abc import Iterable

from heli3dof.integrity.base import Check, Fault, Kind, Stage
from heli3dof.integrity.view import View
from heli3dof.model.control.voltage_replay import Match, voltage_replay, with_known_controller

KIND = {Match.LATE: Kind.NOTE, Match.EXCITED: Kind.NOTE, Match.OTHER: Kind.FINDING}
CONSEQUENCE = {
    Match.LATE: "The simulated flights have the same delay.",
    Match.EXCITED: "The simulated flights get this difference as an extra voltage.",
    Match.OTHER: "The diagnosis does not use this controller.",
}
CAUSE = {
    Match.LATE: "it is that of the previous sample: the controller is one period late, or the log "
    "pairs a sample with the voltage held until then.",
    Match.EXCITED: "an excitation was added to the controller's output and not logged.",
    Match.OTHER: "the controller has other gains or another filter, or the logged angles or "
    "references are not those that it had.",
}
FIX = {
    Match.LATE: "",
    Match.EXCITED: "log the excitation as v_front_extra_V, v_back_extra_V",
    Match.OTHER: "correct [controller] in the profile, or remove it from the profile",
}


def controller(view: View) -> Iterable[Fault]:
    """Yield a fault if the profile's controller does not reproduce the logged voltages.

    `voltage_replay` computes the controller's voltages from the logged angles and references. The
    fault is of the mildest kind, `Kind.NOTE`, if the controller is one period late, or if an
    excitation was not logged. In all other cases, it is of the more severe kind `Kind.FINDING`.
    """
    r = view.recording
    result = voltage_replay(view.corrected)
    if result is None or result.match is Match.REPRODUCED:
        return
    m = result.match
    yield Fault(
        "controller.voltage", KIND[m], r.name,
        f"{r.name}: the profile's controller, computed on the logged angles, differs from the "
        f"logged voltage by ±{result.std_V:.2g} V (standard deviation), "
        f"{100 * result.share:.3g} % of the voltage's own. {CONSEQUENCE[m]}",
        CAUSE[m], FIX[m],
    )  # fmt: skip


def identified(view: View) -> Iterable[Fault]:
    """Yield a note if simulated flights use a linear controller identified from the log."""
    law = with_known_controller(view.corrected).identified_controller
    if law is not None:
        name = view.recording.name
        reason = (
            "another controller than the profile's flew the log"
            if view.recording.profile.controller_is_known
            else "the profile has no [controller]"
        )
        yield Fault(
            "controller.identified", Kind.NOTE, name,
            f"{name}: {reason}. So a linear controller of order {len(law.A)} was identified from "
            f"the log. It explains {100 * (1 - law.share):.4g} % of the voltages' changes, and "
            "simulated flights use it.",
            "", "",
        )  # fmt: skip


CHECKS = (
    Check(
        "controller.voltage", Stage.CONTROLLER, "voltages that the controller did not compute",
        controller,
    ),
    Check(
        "controller.identified", Stage.CONTROLLER,
        "a controller that replaces the profile's in simulated flights", identified,
    ),
)  # fmt: skip
