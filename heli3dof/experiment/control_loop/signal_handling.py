"""Ctrl-C, SIGTERM and a closed terminal ask the loop to end; they never cut a period in two.

Windows has Ctrl-C and Ctrl-Break; there a terminal that is closed ends the program within seconds,
and the device's watchdog ends the flight.

once       the flight ends, the motors are ramped to zero
again      emergency stop: zero volts in the period that comes
later      nothing more: the recording is still being closed
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from heli3dof.rig.trip import Trip

ASKED = {
    "SIGINT": ("stopped with Ctrl-C", "a second Ctrl-C"),
    "SIGTERM": ("stopped by a request to terminate (SIGTERM)", "a second SIGTERM"),
    "SIGBREAK": ("stopped with Ctrl-Break", "a Ctrl-Break on top"),
    "SIGHUP": ("stopped since the terminal was closed (SIGHUP)", "a SIGHUP on top"),
}
"""Signal (where the system has it): what it says at first, and after another."""


class Asked:
    """What was asked for so far."""

    def __init__(self) -> None:
        self._asked: list[str] = []

    def why(self) -> str | None:
        """Why to end the flight, once a signal came; None before."""
        return ASKED[self._asked[0]][0] if self._asked else None

    def at_once(self) -> str | None:
        """Why to stop without a ramp, once a second signal came; None before."""
        if len(self._asked) < 2:
            return None
        return Trip(
            f"emergency stop, by {ASKED[self._asked[1]][1]}",
            "that is what a second one asks for; the first one lands.",
            "start again: arming clears the stop",
        )

    def catch(self, number: int, frame: FrameType | None) -> None:
        """The signals' handler."""
        self._asked.append(signal.Signals(number).name)


@contextmanager
def asked_to_stop() -> Iterator[Asked]:
    """Catch the signals; tells what was asked for.

    Signals may only be caught in the main thread; elsewhere nothing is ever asked for. One that
    the program was started to ignore (SIGHUP, under nohup) stays ignored.
    """
    asked = Asked()
    before = {}
    if threading.current_thread() is threading.main_thread():
        for name in ASKED:
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, asked.catch)
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
