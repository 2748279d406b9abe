"""Detects a device whose sampling rate is not the profile's ``loop.rate_hz``.

Let T be the time between two samples on the device's clock, divided by the number of control
periods between them (1 plus the skipped ones), and dt the profile's control period. The monitor
ends the flight if T > `FACTOR` dt, or 0 < T < dt / `FACTOR`, in all samples of ``lost_max_s``. The
controller's filters and the plan would otherwise run with a wrong time. Sampling jitter lengthens
one interval and shortens the next, and a lost sample lengthens one interval only.
"""

from __future__ import annotations

from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.safety_monitors import SafetyMonitor
from heli3dof.rig.profile import Profile
from heli3dof.rig.trip import Trip

FACTOR = 1.2
"""Ratio of the periods; far above any clock's error, and below the ratios of common rates"""


class SamplingRate(SafetyMonitor):
    """Safety monitor that compares the device's sampling period with the control period."""

    order = 15

    def __init__(self, profile: Profile) -> None:
        self._dt = profile.dt
        self._most = profile.limits.lost_max_s / profile.dt
        self._t = 0.0
        self._side = self._count = 0
        """1 if the last intervals were too long, −1 if too short, 0 if right; how many"""

    def __call__(self, now: Period) -> str | None:
        period_s = (now.t - self._t) / (1 + now.skipped)
        self._t = now.t
        side = (period_s > FACTOR * self._dt) - (0.0 < period_s < self._dt / FACTOR)
        self._count = self._count + 1 if side == self._side else 1
        self._side = side
        if not side or self._count <= self._most:
            return None
        return Trip(
            f"the device takes a sample every {1e3 * period_s:.3g} ms, the control period is "
            f"{1e3 * self._dt:.3g} ms (loop.rate_hz = {1 / self._dt:g})",
            "the profile is for another rig, or the device cannot sample at this rate.",
            f"loop.rate_hz = {1 / period_s:.4g} in the profile",
        )
