"""What a device says when it has stopped by itself, or on somebody else's word."""

from __future__ import annotations

from heli3dof.rig.port import Flags

SAID = {
    Flags.ESTOP: "an emergency stop is in force",
    Flags.LATCHED: "the device's watchdog expired: no command reached it in time",
    Flags.FAULT: "the amplifier reports a fault",
    Flags.STALL: "a motor is stalled",
}
STOPPED = sum(int(flag) for flag in SAID)
"""Any of these flags, as a number: the output is zero, or on the device's own ramp to zero"""


def explain(flags: int) -> str:
    """The flags in words; nothing for none of these."""
    return "; ".join(text for flag, text in SAID.items() if flags & flag)
