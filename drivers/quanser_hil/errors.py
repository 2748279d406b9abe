"""The errors of a rig on a Quanser board, each with its cause and what to do."""

from __future__ import annotations

from heli3dof.errors import DeviceError

from .error_codes import explain


def task_ended(name: str) -> DeviceError:
    return DeviceError(
        f"{name}: the board's encoder task has ended.",
        cause="another program stopped it or took the board; the motors were stopped.",
        fix="end that program, then open the board again",
    )


def not_stopped(
    name: str, problem: BaseException, watchdog_s: float, watching: bool
) -> DeviceError:
    """Return the DeviceError for a board that did not accept an emergency stop.

    ``name``: the rig's URL; ``problem``: the board's error; ``watchdog_s``: the board's watchdog
    timeout, s; ``watching``: True if this watchdog is running.
    """
    message = explain(problem, name, "being stopped").what
    return DeviceError(
        f"{name} did not accept the stop. {message}",
        cause=f"the board is gone or refuses; its watchdog is no longer reloaded and switches "
        f"the outputs off within {watchdog_s:g} s."
        if watching
        else "the board is gone or refuses; it was not armed by this program.",
        fix="press the amplifier's red button or cut its power",
    )


def no_enable_line(name: str) -> DeviceError:
    """Return the DeviceError for a stop of the board ``name`` whose URL says ``enable=none``.

    Such a stop only writes zero volts: a program that still runs may write its volts again.
    """
    return DeviceError(
        f"{name}: zero volts were written, but may not stay.",
        cause="the URL says enable=none: a program that still runs writes its volts again.",
        fix="press the amplifier's red button or cut its power",
    )
