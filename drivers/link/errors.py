"""What can go wrong with a rig on the link, each with its cause and what to do."""

from __future__ import annotations

from heli3dof.errors import DeviceError

from .frames import Cause, Code


def gone_silent(name: str) -> DeviceError:
    return DeviceError(
        f"{name}: the rig has gone silent.",
        cause="the cable is out, or the device has lost its supply; its own watchdog has taken "
        "the motors to zero.",
        fix="check cable and supply, then heli3dof doctor",
    )


def restarted(name: str) -> DeviceError:
    return DeviceError(
        f"{name}: the device has restarted.",
        cause="its supply dipped or its firmware crashed; the motors are at zero, and its encoder "
        "counts began at zero where the rig stood then.",
        fix="let the rig rest, then heli3dof zero, then start again",
    )


def not_ours(name: str) -> DeviceError:
    return DeviceError(
        f"{name}: the device is there, and is no longer armed by this program.",
        cause="another program speaks with it.",
        fix="end the other program; heli3dof doctor names it",
    )


def not_stopped(name: str, tries: int, *, beside: bool = False) -> DeviceError:
    """``beside``: another program held the line meanwhile."""
    return DeviceError(
        f"{name}: the emergency stop was sent {tries} times and not acknowledged.",
        cause="the line is broken, or the program that holds the port has read the answer."
        if beside
        else "the line is broken; the device's own watchdog stops it.",
        fix="press the amplifier's button; then heli3dof doctor",
    )


def not_a_voltage(sequence: int, v_front: float, v_back: float) -> DeviceError:
    return DeviceError(
        f"The command {sequence} is not a voltage: {v_front}, {v_back}.",
        cause="the controller's output is not finite; the motors were stopped.",
        fix="check the gains and references of this flight",
    )


def not_armed(name: str) -> DeviceError:
    return DeviceError(
        f"{name} is not armed.", cause="exchange() was called before arm().", fix="arm() first"
    )


def closed(name: str) -> DeviceError:
    return DeviceError(
        f"{name} is closed.",
        cause="close() was called before this.",
        fix="open it again with heli3dof.open_rig",
    )


def not_arming(name: str, code: int, cause: int, period_us: int, watchdog_us: int) -> DeviceError:
    """Why an ARM was refused."""
    if code == Code.FAULT:
        why = Cause(cause).name.lower() if cause in set(Cause) else f"number {cause}"
        return DeviceError(
            f"{name}: the device does not arm: its amplifier reports a fault ({why}).",
            cause="overload, heat, a stalled motor or a pressed button.",
            fix="release the button, let it cool, switch the amplifier off and on",
        )
    if code == Code.BAD_PARAMETER:
        return DeviceError(
            f"{name}: the device refuses a period of {period_us} µs with a watchdog of "
            f"{watchdog_us} µs.",
            cause="a watchdog must last two periods at least and one second at most.",
            fix="another watchdog_s in the device URL, or another loop.rate_hz",
        )
    if code in set(Code):
        return not_ours(name)
    return DeviceError(
        f"{name}: the device refuses to arm with code {code}, which the protocol does not have.",
        cause="its firmware is newer than this heli3dof, or wrong.",
        fix="pip install --upgrade heli3dof; compare the firmware with docs/reference/protocol.md",
    )
