"""What a device says when it has stopped by itself, or on somebody else's word."""

from __future__ import annotations

from heli3dof.rig.interface import Flags
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


STATED = {
    "HOST_ESTOP": (
        "heli3dof estop or another program stopped it.",
        "find out who and why; then start again: arming clears the stop",
    ),
    "BUTTON": (
        "somebody pressed the rig's button.",
        "find out who and why; release the button; then start again",
    ),
    "OVERCURRENT": (
        "a blocked rotor, a short in a motor or its leads, or a saturated flight.",
        "switch the amplifier off, turn both rotors by hand, look at the leads; heli3dof doctor "
        "says when the fault is gone",
    ),
    "OVERTEMPERATURE": (
        "the amplifier or a motor is too hot.",
        "let it cool; a shorter plan or smaller voltages; heli3dof doctor says when it is gone",
    ),
    "ENCODER": (
        "an encoder gives edges that no motion makes: a lead is off, or the motors' noise gets in.",
        "look at the encoders' leads and shields; heli3dof monitor and turn the rig by hand",
    ),
    "SUPPLY": (
        "the supply dipped, or the USB bus was reset.",
        "look at the supply and the cable; heli3dof doctor says when it is gone",
    ),
    "SATURATED": (
        "the commands stood above the device's voltage limit for longer than it allows.",
        "a smaller step, or motor.v_max as the device has it",
    ),
}
"""Likely cause and fix by the device's own word, where that says more than the flag"""


def explain(flags: int, device_cause: str | None = None) -> Trip | None:
    """The flags in words, with the cause that the device states; None for none of these flags."""
    seen = Trip.first(*(trip for flag, trip in SAID.items() if flags & flag))
    if seen is None or device_cause is None:
        return seen
    cause, fix = STATED.get(device_cause, (seen.cause, seen.fix))
    return Trip(f"{seen} (the device states: {device_cause})", cause, fix)
