"""Ctrl-C, SIGTERM and a closed terminal end a flight between two periods, never within one.

On Windows the signals are Ctrl-C and Ctrl-Break. If the terminal is closed there, the program ends
within seconds, and the device's watchdog ends the flight.

=============  ==============================================================
first signal   the flight ends, the motors are ramped to zero
second         emergency stop: zero volts in the next period
later          ignored: the recording is still being closed
=============  ==============================================================

In the command line, a signal without a flight raises KeyboardInterrupt (`end_on_signals`). After a
flight that a signal has ended, the process only prints the outcome, and ignores further signals.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from heli3dof.rig.trip import Trip

SIGNALS = {
    "SIGINT": ("stopped with Ctrl-C", "a second Ctrl-C"),
    "SIGTERM": ("stopped by a request to terminate (SIGTERM)", "a second SIGTERM"),
    "SIGQUIT": ("stopped with Ctrl-\\ (SIGQUIT)", "a second signal (SIGQUIT)"),
    "SIGUSR1": ("stopped by SIGUSR1", "a second signal (SIGUSR1)"),
    "SIGUSR2": ("stopped by SIGUSR2", "a second signal (SIGUSR2)"),
    "SIGBREAK": ("stopped with Ctrl-Break", "a second signal (Ctrl-Break)"),
    "SIGHUP": ("stopped because the terminal was closed (SIGHUP)", "a second signal (SIGHUP)"),
}
"""Signal → texts for messages: if it is the first signal received, and if it is the second.

Each of them would otherwise end the program at once, without the ramp to zero.
"""


class StopSignals:
    """The stop signals that this program has received, such as Ctrl-C and SIGTERM."""

    def __init__(self) -> None:
        self._received: list[str] = []

    def reason(self) -> str | None:
        """Return in words which signal ends the flight; None before the first stop signal."""
        return SIGNALS[self._received[0]][0] if self._received else None

    def stop_without_ramp(self) -> str | None:
        """Return the `Trip` for an emergency stop; None before the second stop signal."""
        if len(self._received) < 2:
            return None
        return Trip(
            f"emergency stop, by {SIGNALS[self._received[1]][1]}",
            "a second signal stops at once; the first one ramps the motors to zero.",
            "start again: arming clears the stop",
        )

    def handle(self, number: int, frame: FrameType | None) -> None:
        """Record the signal ``number``; ``frame`` is not used."""
        self._received.append(signal.Signals(number).name)


@contextmanager
def stop_signals() -> Iterator[StopSignals]:
    """Context manager: catch the signals of `SIGNALS` in its block; yields the signals received.

    Outside the main thread, Python permits no signal handlers, so nothing is caught. A signal that
    was ignored when the program started (SIGHUP under nohup) stays ignored.

    The end of the block restores the previous signal handlers, with one exception. If a signal was
    caught, the process ignores, from then on, each signal whose previous handler was `interrupt`
    (which raises KeyboardInterrupt).
    """
    received = StopSignals()
    before = {}
    if threading.current_thread() is threading.main_thread():
        for name in SIGNALS:
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, received.handle)
    try:
        yield received
    finally:
        for number, handler in before.items():
            is_over = handler is interrupt and received.reason() is not None
            signal.signal(number, signal.SIG_IGN if is_over else handler)


def interrupt(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt that names the signal ``number``; ``frame`` is not used."""
    raise KeyboardInterrupt(SIGNALS[signal.Signals(number).name][0])


def end_on_signals() -> None:
    """Let Ctrl-C and SIGTERM raise KeyboardInterrupt, for a process that runs one command.

    A signal that was ignored when the process started stays ignored.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, interrupt)


def ignore_signals() -> None:
    """Ignore the signals of `end_on_signals` from now on: the process's exit code is decided."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is interrupt:
            signal.signal(number, signal.SIG_IGN)
