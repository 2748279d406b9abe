"""What a device says when it has stopped by itself, or on somebody else's word."""

from __future__ import annotations

from heli3dof.rig.port import Flags
from heli3dof.rig.trip import Trip

SAID = {
    Flags.ESTOP: Trip(
        "an emergency stop is in force",
        "somebody pressed the rig's button, or another program stopped it.",
        "find out who and why; release the button; then start again",
    ),
    Flags.LATCHED: Trip(
        "the device's watchdog expired: no command reached it in time",
        "this program was held up or suspended, or the line was cut for longer than the "
        "watchdog's time.",
        "heli3dof doctor, and what it says of scheduling and loss",
    ),
    Flags.FAULT: Trip(
        "the amplifier reports a fault",
        "overcurrent, over-temperature or its supply.",
        "let it cool, look for a blocked rotor or a short; heli3dof doctor says when it is gone",
    ),
    Flags.STALL: Trip(
        "a motor is stalled",
        "something blocks a rotor, or a motor's lead is off.",
        "switch the amplifier off and turn both rotors by hand",
    ),
}
STOPPED = sum(int(flag) for flag in SAID)
"""Any of these flags, as a number: the output is zero, or on the device's own ramp to zero"""


def explain(flags: int) -> Trip | None:
    """The flags in words; None for none of these."""
    return Trip.first(*(trip for flag, trip in SAID.items() if flags & flag))
