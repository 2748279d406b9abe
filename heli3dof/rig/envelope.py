"""Checks the safety envelope in every control period.

As soon as one of these is true, the flight ends: the control loop takes the motors to zero volts,
and the command's exit code is 4.

    roll ∉ [roll_min, roll_max],  |pitch| > pitch_max,  |yaw| > yaw_max,  |rate| > its limit,
    the controller's output is not finite,  |V[k]| > v_max,
    |V[k] − V[k−1]| / max(dt, t[k] − t[k−1]) > slew_max,  t[k] > duration_max

V[k], t[k]: a motor's voltage (V) in control period k, and the period's time (s) since the flight's
start; dt: the control period (s). v_max is the profile's ``motor.v_max``. The other limits are in
its ``[limits]``, in the units of their keys. The envelope never changes a command: the recorded
voltage follows the control law until the flight ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, isfinite, radians

from heli3dof.axes import AXES, MOTORS
from heli3dof.rig.profile import Profile
from heli3dof.rig.trip import Trip

_TOO_FAR = (
    "the reference goes further than the envelope, the gain does not fit this rig, or an encoder "
    "counts the wrong way."
)
_CHECK_SIGNS = "heli3dof monitor and turn it by hand: do angles and signs agree? If they do"
_NOT_FINITE = "the controller's gains, the references or an angle are not finite."


class Envelope:
    """Checks each control period's angles, rates and voltages against the profile's limits.

    One object for each flight; a call of `check` takes a few microseconds.
    """

    def __init__(self, profile: Profile) -> None:
        limits = profile.limits
        self._dt = profile.dt
        self._v_max = profile.motor.v_max
        self._low = tuple(radians(low) for low, _ in limits.ranges_deg)
        self._high = tuple(radians(high) for _, high in limits.ranges_deg)
        self._rate = tuple(map(radians, limits.rates_deg_per_s))
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
        """Return why the flight must end now; None if it may go on.

        ``t``: time in the flight (s); ``angle``, ``rate`` (3,): roll, pitch, yaw in rad and rad/s;
        ``command``, ``voltage`` (2,): V, before and after the controller's limiter.
        """
        for i in range(3):
            if not self._low[i] <= angle[i] <= self._high[i]:
                side = self._low[i] if angle[i] < self._low[i] else self._high[i]
                at, bound = f"{degrees(angle[i]):.2f}°", f"beyond the envelope's {degrees(side):g}°"
                if self._before is None:
                    return Trip(
                        f"{AXES[i]} began at {at}, {bound}",
                        "the counts were not zero at the rest angles, for example after a restart "
                        "of the device in the air.",
                        "let the rig rest, then heli3dof zero; if it is at rest, check "
                        f"encoder.{AXES[i]}_rest_deg in the profile",
                    )
                limit = "roll_min_deg or roll_max_deg" if i == 0 else f"{AXES[i]}_max_deg"
                return Trip(
                    f"{AXES[i]} reached {at}, {bound}",
                    _TOO_FAR,
                    f"{_CHECK_SIGNS}: a smaller reference, or limits.{limit} if the rig has "
                    "the room",
                    may_be_wiring_fault=True,
                )
            if not abs(rate[i]) <= self._rate[i]:
                return Trip(
                    f"{AXES[i]} turned at {degrees(rate[i]):.0f}°/s, faster than the envelope's "
                    f"{degrees(self._rate[i]):.0f}°/s",
                    "the loop is barely stable on this rig, someone pushed it, or the reference "
                    "is too fast.",
                    f"{_CHECK_SIGNS}: a smaller step, a slower reference, or "
                    f"limits.{AXES[i]}_rate_max_deg_per_s",
                    may_be_wiring_fault=True,
                )
        # After skipped periods the voltage has had longer to change.
        elapsed = max(self._dt, t - self._t)
        for i in range(2):
            if not isfinite(command[i]):
                return Trip(
                    f"the controller's output is {command[i]} V on the {MOTORS[i]} motor",
                    _NOT_FINITE,
                    "heli3dof run PLAN --dry-run with this profile; [controller] and the plan",
                )
            if not abs(voltage[i]) <= self._v_max * (1 + 1e-9):
                return Trip(
                    f"the {MOTORS[i]} motor's command is {voltage[i]:.2f} V, beyond the "
                    f"amplifier's {self._v_max:g} V",
                    "the controller has no limiter.",
                    "clip its voltages to motor.v_max",
                )
            if self._before is not None:
                slew = abs(voltage[i] - self._before[i]) / elapsed
                if slew > self._slew:
                    return Trip(
                        f"the {MOTORS[i]} motor's voltage jumped at {slew:.0f} V/s, faster than "
                        f"the envelope's {self._slew:.0f} V/s",
                        "the rate gains amplify encoder noise, or the plan adds a voltage step.",
                        "a lower derivative filter or gain in [controller], a smaller step in the "
                        "plan, or limits.slew_max_V_per_s",
                    )
        if t > self._duration:
            return Trip(
                f"the flight lasted longer than the envelope's {self._duration:g} s",
                "periods were skipped, or the plan is longer than it states.",
                "heli3dof doctor; or limits.duration_max_s in the profile",
            )
        self._before, self._t = (voltage[0], voltage[1]), t
        return None
