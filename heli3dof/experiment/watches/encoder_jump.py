"""A count that changed by more than the rig can turn, and time that runs backwards.

Within Δt an axis turns by no more than its rate allows, and a count more or less:

    |Δcounts| · q  >  2 · rate_max · Δt + 2 q      q: rad per count

rate_max is the profile's ``[limits]``; twice that, because the envelope judges a filtered rate. A
smaller jump that stays cannot be distinguished from motion by these means.
"""

from __future__ import annotations

from math import radians

from heli3dof.axes import AXES
from heli3dof.experiment.period import Period
from heli3dof.rig.profile import Profile
from heli3dof.rig.trip import Trip

COUNTER_BITS = (16, 24)
"""Widths of counters in common use that wrap within a flight (the port's counts are not limited)"""


class Jump:
    """A count that changed by more than the rig can turn."""

    def __init__(self, profile: Profile) -> None:
        limits, q = profile.limits, profile.encoder.rad_per_count.tolist()
        rates = (
            limits.roll_rate_max_deg_per_s,
            limits.pitch_rate_max_deg_per_s,
            limits.yaw_rate_max_deg_per_s,
        )
        self._per_s = tuple(2 * radians(rate) / abs(q[i]) for i, rate in enumerate(rates))
        self._before: tuple[int, int, int] | None = None
        self._t = 0.0

    def __call__(self, now: Period) -> str | None:
        counts, t = now.sample.counts, now.t
        before, dt = self._before, t - self._t
        self._before, self._t = counts, t
        if before is None:
            return None
        for i in range(3):
            moved = counts[i] - before[i]
            if abs(moved) > self._per_s[i] * dt + 2:
                return Trip(
                    f"the {AXES[i]} encoder jumped by {moved} counts within {1e3 * dt:.1f} ms",
                    "its cable or connector is loose, or the device lost counts.",
                    "heli3dof monitor while its cable is moved; then heli3dof zero",
                )
        return None
