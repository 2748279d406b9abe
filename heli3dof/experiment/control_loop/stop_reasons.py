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
        "the device or the line was too slow or cut, or this program was held up or suspended, for "
        "longer than the watchdog's time.",
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


def explain(
    flags: int, device_cause: str | None = None, longest_exchange_s: float | None = None
) -> Trip | None:
    """Return what stopped the device, with likely cause and fix; None if nothing did.

    ``flags``: the flags of a sample; ``device_cause``: the cause that the device states.
    ``longest_exchange_s``: the longest time in s from sending a command to receiving the next
    sample. If the device's watchdog expired, the result states this time, because a long time
    suggests a slow device or a slow line as the cause.
    """
    seen = Trip.first(*(trip for flag, trip in BY_FLAG.items() if flags & flag))
    if seen is not None and flags & Flags.LATCHED and longest_exchange_s is not None:
        exchange = f"the longest exchange with the device took {1e3 * longest_exchange_s:.0f} ms"
        seen = Trip(f"{seen} ({exchange})", seen.cause, seen.fix)
    if seen is None or device_cause is None:
        return seen
    cause, fix = BY_CAUSE.get(device_cause, (seen.cause, seen.fix))
    return Trip(f"{seen} (the device states: {device_cause})", cause, fix)
