"""Detects that the computer slept: CLOCK_BOOTTIME went on, CLOCK_MONOTONIC did not.

    asleep = (boottime − monotonic) − (boottime − monotonic at the flight's start)

In that time the rig's watchdog has ramped the motors to zero, or the rig has held one voltage. The
controller's rates, integrals and last voltage are out of date, so the loop stops the device
without a ramp. On a system without CLOCK_BOOTTIME only the device's watchdog ends the flight.
"""

from __future__ import annotations

import time

from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.safety_monitors import SafetyMonitor
from heli3dof.rig.profile import Profile
from heli3dof.rig.trip import Trip

SHORTEST_S = 0.1
"""s: a shorter time is ignored: no computer sleeps for less, and the clocks are read in sequence"""


def ahead_s() -> float:
    """Return CLOCK_BOOTTIME minus CLOCK_MONOTONIC in s; 0 on a system without CLOCK_BOOTTIME."""
    boottime = getattr(time, "CLOCK_BOOTTIME", None)
    if boottime is None:
        return 0.0
    return time.clock_gettime(boottime) - time.monotonic()


class HostSuspend(SafetyMonitor):
    """Safety monitor that detects that the computer slept during a flight.

    While the computer sleeps, CLOCK_BOOTTIME goes on and CLOCK_MONOTONIC stands still. The monitor
    is also active while the voltages ramp to zero at the end of the flight.
    """

    order = 10

    def __init__(self, profile: Profile) -> None:
        self._ahead_s = max(ahead_s() for _ in range(5))

    def asleep_s(self) -> float:
        """Return how many seconds the computer slept during this flight; 0 below `SHORTEST_S`."""
        asleep = ahead_s() - self._ahead_s
        return asleep if asleep > SHORTEST_S else 0.0

    def __call__(self, now: Period) -> str | None:
        asleep = self.asleep_s()
        if not asleep:
            return None
        return Trip(
            f"the computer slept for {asleep:.2g} s in mid-flight",
            "its lid was closed, its battery is empty, or it suspends when idle.",
            "systemd-inhibit --what=sleep:idle:handle-lid-switch heli3dof …",
        )

    def stop_without_ramp(self) -> str | None:
        return "stopped at once, since the computer slept" if self.asleep_s() else None
