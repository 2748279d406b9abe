"""`link_warnings`: warns of a poor link between this computer and the rig.

After a flight, ``heli3dof run`` prints these warnings. The recording contains the link's counters
and latency, so ``heli3dof info`` can print the warnings again.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

SLOW_PERIODS = 1.05
"""Largest median command-to-echo latency without a warning, in control periods. A device without
delay stays below 1. The margin allows for bins of 1 % in the latency's histogram, and for the drift
between the device's clock and the host's."""
LOSS_SHARE = 0.01
"""Largest share of lost samples, or of unacknowledged commands, that gives no warning. A loss of
1 % changes each estimate of ``identify`` by less than 0.1 of its standard deviation (random losses
in a minute of the plan ``rich``)."""


def link_warnings(details: Mapping[str, Any], samples: int, dt: float) -> list[str]:
    """Return warnings of a poor link, each with likely cause and remedy; a good link has none.

    ``details`` is ``Recording.meta["outcome_details"]``, ``samples`` the recording's number of
    samples, in flight and ramp, and ``dt`` the control period in s.
    """
    found: list[str] = []
    latency = details.get("latency") or {}
    link = details.get("link") or {}
    commands = latency.get("commands") or 0
    median_s = latency.get("median_s")
    unacknowledged = latency.get("commands_unacknowledged", 0)
    if median_s is not None and median_s > SLOW_PERIODS * dt:
        found.append(
            f"Command-to-echo latency is {1e3 * median_s:.1f} ms (median), more than the control "
            f"period of {1e3 * dt:g} ms: the loop has this dead time. Likely cause: an "
            "adapter that buffers bytes (FTDI latency timer), a USB hub, a network link, or a "
            "slow device. Try: heli3dof doctor; a direct connection; a lower loop.rate_hz"
        )
    elif commands and unacknowledged > LOSS_SHARE * commands:
        skipped = details.get("device_skipped") or 0
        if 2 * skipped >= unacknowledged:
            cause = f"the device is overloaded (it skipped {skipped} samples)"
        elif unacknowledged == commands:
            cause = "a latency above the control period, or a device that ignores commands"
        else:
            cause = (
                "a line that loses frames, or a latency that sometimes exceeds the control period"
            )
        found.append(
            f"{unacknowledged} of {commands} commands ({unacknowledged / commands:.1%}) were not "
            f"echoed by the next sample; {latency.get('commands_never_echoed', 0)} were never "
            "echoed. "
            f"Likely cause: {cause}. Try: heli3dof doctor; a shorter, shielded cable away from the "
            "motors' leads; a lower loop.rate_hz"
        )
    lost = details.get("lost") or 0
    if lost > LOSS_SHARE * (samples + lost):
        found.append(
            f"{lost} of {samples + lost} samples ({lost / (samples + lost):.1%}) were lost on the "
            "line. Likely cause: a loose or long cable, a hub, or the motors' leads. Try: heli3dof "
            "doctor; a shorter, shielded cable away from the motors' leads"
        )
    rejected = link.get("rejected") or 0
    if rejected:
        found.append(
            f"{rejected} samples were rejected: repeated, out of order, or echoing a command that "
            "was never sent. Likely cause: a second program on the same port, a network path that "
            "repeats packets, or the device's firmware. Try: heli3dof doctor, which names a second "
            "program; then compare the firmware with docs/reference/protocol.md"
        )
    return found
