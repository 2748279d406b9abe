"""What a flight on a Quanser board can run into, each with its cause and what to do."""

from __future__ import annotations

from heli3dof.errors import DeviceError, UsageError

from .error_codes import explain


def closed(name: str) -> DeviceError:
    return DeviceError(
        f"{name} is closed.",
        cause="close() was called before this.",
        fix="open it again with heli3dof.open_rig",
    )


def not_armed(name: str) -> DeviceError:
    return DeviceError(
        f"{name} is not armed, so no volt gets out.",
        cause="arm() was not called since it was opened.",
        fix="arm() first; it returns the first sample",
    )


def not_a_voltage(sequence: int, v_front: float, v_back: float) -> DeviceError:
    return DeviceError(
        f"The command {sequence} is not a voltage: {v_front}, {v_back}.",
        cause="the controller's output is not finite; the motors were stopped.",
        fix="check the gains and references of this flight",
    )


def task_ended(name: str) -> DeviceError:
    return DeviceError(
        f"{name}: the board's encoder task has ended.",
        cause="another program stopped it or took the board; the motors were stopped.",
        fix="end that program, then open the board again",
    )


def not_stopped(
    name: str, problem: BaseException, watchdog_s: float, watching: bool
) -> DeviceError:
    """An emergency stop that the board did not take."""
    said = explain(problem, name, "being stopped").what
    return DeviceError(
        f"{name} did not take the stop. {said}",
        cause=f"the board is gone or refuses; its watchdog, no longer reloaded, puts the outputs "
        f"to rest within {watchdog_s:g} s."
        if watching
        else "the board is gone or refuses; it was not armed by this program.",
        fix="press the amplifier's red button or cut its power",
    )


def no_enable_line(name: str) -> DeviceError:
    """An emergency stop beside a flight that goes on writing its volts."""
    return DeviceError(
        f"{name}: zero volts were written, and whether they stay nobody can tell.",
        cause="the URL says enable=none: a program that still flies writes its volts again.",
        fix="press the amplifier's red button or cut its power",
    )


def too_slow_a_watchdog(name: str, watchdog_s: float, dt: float) -> UsageError:
    return UsageError(
        f"{name}: watchdog_s={watchdog_s:g} is shorter than two control periods of {dt:g} s.",
        cause="the watchdog would latch between any two commands.",
        fix=f"watchdog_s={3 * dt:g} or more",
    )
