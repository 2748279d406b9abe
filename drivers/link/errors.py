"""The errors of a rig that uses the link protocol, each with its cause and what to do."""

from __future__ import annotations

from heli3dof.errors import DeviceError

from .frames import Cause, Code

MALFORMED = 10
"""Pieces that are no frame: more of them since the last sample than a cable makes as it is pulled
out"""


def gone_silent(name: str, seconds: float, malformed: int) -> DeviceError:
    """Return the DeviceError for a device that does not reply.

    ``seconds``: time since the last valid sample; ``malformed``: pieces since then that are no
    frame (`LinkStatistics`).
    """
    if malformed > MALFORMED:
        return DeviceError(
            f"{name}: no valid frame for {seconds:.1f} s, but {malformed} malformed ones.",
            cause="the device's program or the line damages every byte: another baud rate, "
            "electrical noise, or a defective adapter. The device's own watchdog has ramped the "
            "motors to zero.",
            fix="heli3dof doctor; check baud rate and shield; compare the firmware with "
            "docs/reference/protocol.md",
        )
    return DeviceError(
        f"{name}: the rig has gone silent.",
        cause="the cable is out, or the device has lost its supply; its own watchdog has ramped "
        "the motors to zero.",
        fix="check cable and supply, then heli3dof doctor",
    )


def restarted(name: str) -> DeviceError:
    return DeviceError(
        f"{name}: the device has restarted.",
        cause="its supply dipped or its firmware crashed; the motors are at zero, and its encoder "
        "counts restarted from zero at the position of that moment.",
        fix="let the rig rest, then heli3dof zero, then start again",
    )


def not_ours(name: str) -> DeviceError:
    return DeviceError(
        f"{name}: this program no longer controls the device.",
        cause="another program has armed or disarmed it.",
        fix="end the other program; heli3dof doctor names it",
    )


def no_valid_sample(name: str, seconds: float, malformed: int, rejected: int) -> DeviceError:
    """Return the DeviceError for a device whose watchdog expired while it sent no valid sample.

    ``seconds``: time since the last valid sample; ``malformed`` and ``rejected``: frames since then
    (`LinkStatistics`).
    """
    return DeviceError(
        f"{name}: no valid sample for {seconds:.1f} s ({malformed} malformed, {rejected} "
        "rejected); the watchdog stopped the motors.",
        cause="the device's program repeats old samples or damages frames, or the line does."
        if malformed or rejected
        else "the device answers requests but sends no samples, or the line was cut for a time.",
        fix="heli3dof doctor; compare the firmware with docs/reference/protocol.md",
    )


def not_stopped(name: str, tries: int, *, shared: bool = False) -> DeviceError:
    """Return the DeviceError for an emergency stop that the device did not confirm.

    ``name``: the rig's port or URL; ``tries``: ESTOP frames sent; ``shared``: another program had
    the same port open.
    """
    return DeviceError(
        f"{name}: the emergency stop was sent {tries} times and not acknowledged.",
        cause="the line is broken, or the program that holds the port has read the reply."
        if shared
        else "the line is broken; the device's own watchdog stops it.",
        fix="press the amplifier's button; then heli3dof doctor",
    )


def not_arming(name: str, code: int, cause: int, period_us: int, watchdog_us: int) -> DeviceError:
    """Return the DeviceError for an ARM request that the device refused.

    ``name``: the rig's port or URL. ``code`` and ``cause``: numbers in the device's reply, an ACK
    frame (`Code`, `Cause`). ``period_us`` and ``watchdog_us``: sample period and watchdog timeout
    in the request, in µs.
    """
    if code == Code.FAULT and cause == Cause.BUTTON:
        return DeviceError(
            f"{name}: the device does not arm: its button is pressed.",
            cause="somebody holds the button, or it latches.",
            fix="release the button, then start again",
        )
    if code == Code.FAULT:
        reason = Cause(cause).name.lower() if cause in set(Cause) else f"number {cause}"
        return DeviceError(
            f"{name}: the device does not arm: its amplifier reports a fault ({reason}).",
            cause="overload, heat or a stalled motor.",
            fix="let the amplifier cool, switch it off and on",
        )
    if code == Code.BAD_PARAMETER:
        return DeviceError(
            f"{name}: the device refuses a period of {period_us} µs with a watchdog of "
            f"{watchdog_us} µs.",
            cause="a watchdog must last at least two periods and at most one second.",
            fix="change watchdog_s in the device URL, or loop.rate_hz in the profile",
        )
    if code in set(Code):
        return not_ours(name)
    return DeviceError(
        f"{name}: the device refuses to arm with code {code}, which the protocol does not define.",
        cause="its firmware is newer than this heli3dof, or wrong.",
        fix="pip install --upgrade heli3dof; compare the firmware with docs/reference/protocol.md",
    )
