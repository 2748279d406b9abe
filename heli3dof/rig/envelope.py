"""The safety envelope: what may be, checked in every control period.

A flight ends (exit 4, motors ramped to zero) as soon as

    roll ∉ [roll_min, roll_max],  |pitch| > pitch_max,  |yaw| > yaw_max,
    |rate| > its limit,  a voltage is not a number or beyond v_max,
    |V[k] − V[k−1]| / (t[k] − t[k−1]) > slew_max,  or  t > duration_max

with the numbers of the profile's ``[limits]``. The envelope never changes a command: the
recorded voltage is always what the controller's law says, or the flight is over.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, isfinite, radians

from heli3dof.axes import AXES, MOTORS
from heli3dof.rig.profile import Profile


class Envelope:
    """Checks one control period after another; plain floats, a few microseconds a call."""

    def __init__(self, profile: Profile) -> None:
        limits = profile.limits
        self._dt = profile.dt
        self._v_max = profile.motor.v_max
        self._low = tuple(
            radians(a) for a in (limits.roll_min_deg, -limits.pitch_max_deg, -limits.yaw_max_deg)
        )
        self._high = tuple(
            radians(a) for a in (limits.roll_max_deg, limits.pitch_max_deg, limits.yaw_max_deg)
        )
        self._rate = tuple(
            radians(a)
            for a in (
                limits.roll_rate_max_deg_per_s,
                limits.pitch_rate_max_deg_per_s,
                limits.yaw_rate_max_deg_per_s,
            )
        )
        self._slew = limits.slew_max_V_per_s
        self._duration = limits.duration_max_s
        self._before: tuple[float, float] | None = None
        self._t = 0.0

    def check(
        self,
        t: float,
        angle: Sequence[float],
        rate: Sequence[float],
        command: Sequence[float],
        voltage: Sequence[float],
    ) -> str | None:
        """Why the flight must end now, or None.

        t in s; angle and rate (3,) in rad and rad/s; command and voltage (2,) in V, before and
        after the controller's limiter.
        """
        for i in range(3):
            if not self._low[i] <= angle[i] <= self._high[i]:
                side = self._low[i] if angle[i] < self._low[i] else self._high[i]
                return (
                    f"{AXES[i]} reached {degrees(angle[i]):.2f}°, beyond the envelope's "
                    f"{degrees(side):g}°"
                )
            if not abs(rate[i]) <= self._rate[i]:
                return (
                    f"{AXES[i]} turned at {degrees(rate[i]):.0f}°/s, faster than the envelope's "
                    f"{degrees(self._rate[i]):.0f}°/s"
                )
        # Where periods were skipped, the voltage has had that much longer to change.
        elapsed = max(self._dt, t - self._t)
        for i in range(2):
            if not isfinite(command[i]):
                return f"the controller asked for {command[i]} V on the {MOTORS[i]} motor"
            if not abs(voltage[i]) <= self._v_max * (1 + 1e-9):
                return (
                    f"the {MOTORS[i]} motor was asked for {voltage[i]:.2f} V, beyond the "
                    f"amplifier's {self._v_max:g} V"
                )
            if self._before is not None:
                slew = abs(voltage[i] - self._before[i]) / elapsed
                if slew > self._slew:
                    return (
                        f"the {MOTORS[i]} motor's voltage jumped at {slew:.0f} V/s, faster than "
                        f"the envelope's {self._slew:.0f} V/s"
                    )
        if t > self._duration:
            return f"the flight lasted longer than the envelope's {self._duration:g} s"
        self._before, self._t = (voltage[0], voltage[1]), t
        return None
