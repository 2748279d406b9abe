"""Explains why a device holds its output at zero: by its flags, and by the cause that it states."""

from __future__ import annotations

from heli3dof.rig.interface import Flags
from heli3dof.rig.trip import Trip

BY_FLAG = {
    Flags.ESTOP: Trip(
        "an emergency stop is in force",
        "somebody pressed the rig's button, or another program stopped it.",
        "find out who stopped it and why; release the button; then start again",
    ),
    Flags.LATCHED: Trip(
        "the device's watchdog expired: no command reached it in time",
        "this program was held up or suspended, or the line was cut for longer than the "
        "watchdog's time.",
        "heli3dof doctor: see scheduling and loss",
    ),
    Flags.FAULT: Trip(
        "the amplifier reports a fault",
        "overcurrent, over-temperature or its supply.",
        "let it cool, look for a blocked rotor or a short; heli3dof doctor shows when it is gone",
    ),
    Flags.STALL: Trip(
        "a motor is stalled",
        "something blocks a rotor, or a motor's lead is off.",
        "switch the amplifier off and turn both rotors by hand",
    ),
}
STOPPED = sum(int(flag) for flag in BY_FLAG)
"""The flags of `BY_FLAG`, as one number. With any of them set, the device's output is zero or ramps
to zero"""


BY_CAUSE = {
    "HOST_ESTOP": (
        "heli3dof estop or another program stopped it.",
        "find out who stopped it and why; then start again: arming clears the stop",
    ),
    "BUTTON": (
        "somebody pressed the rig's button.",
        "find out who stopped it and why; release the button; then start again",
    ),
    "OVERCURRENT": (
        "a blocked rotor, a short in a motor or its leads, or a saturated flight.",
        "switch the amplifier off, turn both rotors by hand, check the leads; heli3dof doctor "
        "shows when the fault is gone",
    ),
    "OVERTEMPERATURE": (
        "the amplifier or a motor is too hot.",
        "let it cool; a shorter plan or smaller voltages; heli3dof doctor shows when it is gone",
    ),
    "ENCODER": (
        "an encoder gives edges that no motion makes: a lead is off, or the motors disturb it.",
        "check the encoders' leads and shields; heli3dof monitor and turn the rig by hand",
    ),
    "SUPPLY": (
        "the supply dipped, or the USB bus was reset.",
        "check the supply and the cable; heli3dof doctor shows when it is gone",
    ),
    "SATURATED": (
        "the commands stayed above the device's voltage limit for longer than it allows.",
        "a smaller step, or set motor.v_max to the device's limit",
    ),
}
"""Cause that the device states → likely cause and fix, if more specific than those in `BY_FLAG`"""


def explain(flags: int, device_cause: str | None = None) -> Trip | None:
    """Return what stopped the device, with likely cause and fix; None if nothing did.

    ``flags``: the flags of a sample; ``device_cause``: the cause that the device states.
    """
    seen = Trip.first(*(trip for flag, trip in BY_FLAG.items() if flags & flag))
    if seen is None or device_cause is None:
        return seen
    cause, fix = BY_CAUSE.get(device_cause, (seen.cause, seen.fix))
    return Trip(f"{seen} (the device states: {device_cause})", cause, fix)
