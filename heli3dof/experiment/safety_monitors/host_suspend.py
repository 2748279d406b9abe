"""The computer slept: CLOCK_BOOTTIME went on, CLOCK_MONOTONIC did not.

    asleep = (boottime − monotonic) − (boottime − monotonic at the flight's start)

The rig went on, too: its watchdog has ramped it to zero, or it has held one voltage all that time.
Nothing that the loop remembers (rates, integrals, the last voltage) says anything of it, so there
is no ramp: the device is stopped at once. Where there is no CLOCK_BOOTTIME, nothing is noticed here
and the device's watchdog is what ends the flight.
"""

from __future__ import annotations

import time

from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.rig.trip import Trip

SHORTEST_S = 0.1
"""No computer sleeps for less; the clocks are read one after the other."""


def ahead_s() -> float:
    """boottime − monotonic, s. Whatever comes between the two readings makes it smaller only."""
    boottime = getattr(time, "CLOCK_BOOTTIME", None)
    if boottime is None:
        return 0.0
    return time.clock_gettime(boottime) - time.monotonic()


class Suspended:
    """Asked in every period, and in every period of the ramp."""

    def __init__(self) -> None:
        self._ahead_s = max(ahead_s() for _ in range(5))

    def asleep_s(self) -> float:
        """s that the computer slept since the flight began; 0 below `SHORTEST_S`."""
        asleep = ahead_s() - self._ahead_s
        return asleep if asleep > SHORTEST_S else 0.0

    def __call__(self, now: Period) -> str | None:
        asleep = self.asleep_s()
        if not asleep:
            return None
        return Trip(
            f"the computer slept for {asleep:.2g} s in mid-flight",
            "its lid was closed, its battery is empty, or it suspends when nobody types.",
            "systemd-inhibit --what=sleep:idle:handle-lid-switch heli3dof …",
        )

    def at_once(self) -> str | None:
        """Why there is no ramp."""
        return "stopped at once, since the computer slept" if self.asleep_s() else None
