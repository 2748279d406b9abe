"""Detects a motor that was commanded beyond its limit for longer than ``saturated_max_s``.

While |command| > v_max the control loop is open and the integrators wind up: the rig does not
follow the plan. The time restarts at zero once the command has been below the limit for a tenth of
``saturated_max_s``. A sample with the device's flag SATURATED counts for both motors.
"""

from __future__ import annotations

from heli3dof.axes import MOTORS
from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.safety_monitors import SafetyMonitor
from heli3dof.rig.interface import Flags
from heli3dof.rig.profile import Profile
from heli3dof.rig.trip import Trip

BREAK = 0.1
"""Share of ``saturated_max_s`` below the limit after which the time restarts"""
_SATURATED = int(Flags.SATURATED)


class Saturation(SafetyMonitor):
    """Safety monitor that measures for how long each motor's command has been beyond the limit."""

    order = 70

    def __init__(self, profile: Profile) -> None:
        self._v_max = profile.motor.v_max
        self._longest_s = profile.limits.saturated_max_s
        self._since: list[float | None] = [None, None]
        self._last = [0.0, 0.0]

    def __call__(self, now: Period) -> str | None:
        t = now.t
        clipped = int(now.sample.flags) & _SATURATED
        for i in range(2):
            if clipped or abs(now.command[i]) > self._v_max:
                self._last[i] = t
                since = self._since[i]
                if since is None:
                    self._since[i] = t
                elif t - since > self._longest_s:
                    return Trip(
                        f"{self._which(now)} was at its limit of {self._v_max:g} V for "
                        f"{t - since:.2g} s",
                        "the plan asks for more than the rig has, or a rotor does not pull.",
                        "check both rotors; then a smaller or slower step: heli3dof simulate "
                        "PLAN --model M shows the volts that it needs",
                        may_be_wiring_fault=True,
                    )
            elif t - self._last[i] > BREAK * self._longest_s:
                self._since[i] = None
        return None

    def _which(self, now: Period) -> str:
        beyond = [m for m, v in zip(MOTORS, now.command, strict=True) if abs(v) > self._v_max]
        return f"the {beyond[0]} motor" if len(beyond) == 1 else "a motor"
