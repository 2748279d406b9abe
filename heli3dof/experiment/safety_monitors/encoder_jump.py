"""Detects an encoder count that jumps further than the rig can turn, and a wrong device clock.

The monitor reports a change Δcounts between two samples Δt (s) apart if

    |Δcounts| · q  >  2 · rate_max · Δt + 2 q      q: rad per count

rate_max is the axis's rate limit (rad/s) in the profile's ``[limits]``. The safety envelope judges
a filtered rate, so the true rate may briefly be higher: hence the factor 2. This monitor cannot
distinguish a smaller jump from motion. It reports a jump of about 2¹⁶ or 2²⁴ counts as an overflow
of the counter. It reports a wrong clock if the device's time decreases, or stays constant for
longer than `CLOCK_S`.
"""

from __future__ import annotations

from math import radians

from heli3dof.axes import AXES
from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.safety_monitors import SafetyMonitor
from heli3dof.rig.profile import Profile
from heli3dof.rig.trip import Trip

CLOCK_S = 0.25
"""s for which a device's time may stay constant: many ticks of the coarsest host clock (16 ms)"""
COUNTER_BITS = (16, 24)
"""Widths of common counters; one of 32 bits does not wrap within a flight"""


class EncoderJump(SafetyMonitor):
    """Safety monitor that compares a sample's counts and device time with the previous sample's."""

    order = 20

    def __init__(self, profile: Profile) -> None:
        rates, q = profile.limits.rates_deg_per_s, profile.encoder.rad_per_count.tolist()
        self._per_s = tuple(2 * radians(rate) / abs(q[i]) for i, rate in enumerate(rates))
        self._before: tuple[int, int, int] | None = None
        self._t = 0.0
        self._dt = profile.dt
        self._still = 0
        """Periods in which the device's time has not changed"""

    def __call__(self, now: Period) -> str | None:
        counts, t = now.sample.counts, now.t
        before, dt = self._before, t - self._t
        self._before, self._t = counts, t
        if before is None:
            return None
        self._still = self._still + 1 + now.skipped if dt == 0 else 0
        if self._still * self._dt > CLOCK_S:
            return stopped_clock(t, self._still * self._dt)
        if dt < 0:
            return Trip(
                f"the device's time ran backwards: by {-1e3 * dt:.1f} ms from one sample to the "
                "next",
                "the device restarted, its clock was set, or its driver delivers samples out of "
                "order.",
                "heli3dof doctor; a driver must unwrap its clock and deliver samples in order",
            )
        for i in range(3):
            moved = counts[i] - before[i]
            limit = self._per_s[i] * dt + 2
            if abs(moved) > limit:
                return _jump(i, moved, limit, dt)
        return None


def stopped_clock(t: float, still_s: float) -> Trip:
    """Return the report on a device whose time stayed at ``t`` for ``still_s`` (both in s)."""
    return Trip(
        f"the device's time stayed at {t:.3f} s for {still_s:.2g} s",
        "its program hangs and repeats one sample, or its driver does not set device_time_s.",
        "python -m heli3dof.rig.conformance URL, which examines a driver",
    )


def _jump(axis: int, moved: int, limit: float, dt: float) -> Trip:
    what = f"the {AXES[axis]} encoder jumped by {moved} counts within {1e3 * dt:.1f} ms"
    for bits in COUNTER_BITS:
        if abs(abs(moved) - 2**bits) < limit:
            return Trip(
                f"{what}, about 2^{bits}",
                f"the device's counter has {bits} bits and wrapped.",
                "have the device's firmware or driver extend its counts to 32 bits",
            )
    return Trip(
        what,
        "its cable or connector is loose, or the device lost counts.",
        "heli3dof monitor while its cable is moved; then heli3dof zero",
    )
