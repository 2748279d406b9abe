"""Detects samples that come too late because of a busy host, a slow link or a slow device.

A sample is late if it came more than ``late_max_s`` after its deadline. The monitor ends the flight
if more than the fraction ``late_max_share`` of the last second's samples is late. Control periods
that the host skipped just before a late sample also count as late samples. Periods that the device
skipped do not count.

The command-to-echo latency is the time from sending a command to the first sample that echoes it. A
busy host delays some commands; a slow link or device delays all of them. So the report blames the
link or the device if the 10 % quantile of the latencies exceeds `SLOW_PERIODS` control periods.

The monitor tolerates n late samples per second, where n is the fraction ``late_max_share`` of all
samples in a second. It computes the quantile from n latencies, one for each of the last n control
periods, skipped periods included. For each period, it uses the latency of the newest command that
has been echoed. If a link becomes slow, the flight ends only after more than n late samples. By
then the slow link has caused all n latencies.
"""

from __future__ import annotations

from array import array

from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.safety_monitors import SafetyMonitor
from heli3dof.rig.profile import Profile
from heli3dof.rig.trip import Trip

WINDOW_S = 1.0
"""s of flight over which late periods are counted"""
QUICKEST = 0.1
"""Quantile of the command-to-echo latency that shows whether the link is slow. A busy host is on
time in more than this share of the periods; else the device's watchdog expires first"""
SLOW_PERIODS = 1.5
"""Periods: half-way between a command echoed by the next sample (1) and by the one after (2)"""


class Lateness(SafetyMonitor):
    """Safety monitor that counts the late control periods within the last second."""

    order = 40

    def __init__(self, profile: Profile) -> None:
        limits = profile.limits
        self._late_s = limits.late_max_s
        self._ring = bytearray(max(2, round(WINDOW_S / profile.dt)))
        self._most = limits.late_max_share * len(self._ring)
        self._at = self._late = 0
        self._dt = profile.dt
        self._echo_s = array("d", bytes(8 * max(1, int(self._most))))
        self._echoes = 0
        self._latest_s = 0.0
        """s: latency of the newest command that was echoed; 0 before the first echo"""

    def __call__(self, now: Period) -> str | None:
        self._latest_s = now.echo_s or self._latest_s
        if self._latest_s:
            for _ in range(1 + min(now.skipped, len(self._echo_s))):
                self._echo_s[self._echoes % len(self._echo_s)] = self._latest_s
                self._echoes += 1
        late = now.lateness > self._late_s
        if not late and not self._late:
            return None
        for _ in range(1 + (min(now.skipped - now.device_skipped, len(self._ring)) if late else 0)):
            self._late += late - self._ring[self._at]
            self._ring[self._at] = late
            self._at = (self._at + 1) % len(self._ring)
        return self._report() if self._late > self._most else None

    def _report(self) -> Trip:
        what = (
            f"samples came too late: {self._late} of the last {len(self._ring)} came more than "
            f"{1e3 * self._late_s:g} ms after their time or not at all"
        )
        echoes = sorted(self._echo_s[: min(self._echoes, len(self._echo_s))])
        quickest_s = echoes[int(QUICKEST * len(echoes))] if echoes else 0.0
        if quickest_s > SLOW_PERIODS * self._dt:
            return Trip(
                f"{what}; every command took {1e3 * quickest_s:.1f} ms or more "
                f"({quickest_s / self._dt:.0f} periods) to be echoed",
                "the line or the device is slow: an adapter that collects bytes (FTDI latency "
                "timer), a USB hub, a network link, or a device below this rate.",
                "heli3dof doctor: see the latency timer; plug the rig in directly; a lower "
                "loop.rate_hz in the profile",
            )
        return Trip(
            what,
            "another program takes the processor, and the system does not let this one go first.",
            "heli3dof doctor: see scheduling",
        )
