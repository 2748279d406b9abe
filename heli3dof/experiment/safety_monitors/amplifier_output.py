"""Detects an amplifier that is off, or whose output does not follow the commands.

The monitor ends the flight at once, without a ramp to zero, in two cases:

- The flag ENABLED disappears, and no flag states a stop. A device that never set ENABLED is not
  judged.
- A motor's output voltage v (``Sample.v_applied``, V) is outside the band of its last commands in
  more than `SAMPLES` consecutive samples::

      v < min c − ¼ (V_h + |min c|)    or    v > max c + ¼ (V_h + |max c|)

min c, max c: smallest and largest of the motor's last `SAMPLES` commands (V), one per sample; V_h =
max(|V_o|, v_max/8), V_o: hover voltage (V). An output that only follows the commands late, over a
slow link, stays within the band.

The quarter covers a loaded supply and the error of a measured output. v is the amplifier's output:
what a motor makes of it (lag, saturation, dead zone) does not count. v is not judged if it is not
finite (not measured), or if the flag SATURATED or a stop's flag is set.
"""

from __future__ import annotations

from collections import deque

from heli3dof.axes import MOTORS
from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.control_loop.stop_reasons import STOPPED
from heli3dof.experiment.safety_monitors import SafetyMonitor
from heli3dof.rig.interface import Flags
from heli3dof.rig.profile import Profile
from heli3dof.rig.trip import Trip

SAMPLES = 50
"""Samples: 0.1 s at 500 Hz, longer than the latency of a usable link and an amplifier's slew"""
SHARE = 0.25
"""Share of V_h and of a command that the output may lack or exceed"""
_ENABLED = int(Flags.ENABLED)
_EXPLAINED = int(Flags.SATURATED) | STOPPED
"""Flags that explain an output which differs from the command"""


class AmplifierOutput(SafetyMonitor):
    """Safety monitor that compares a sample's flags and output voltages with the commands."""

    order = 25

    def __init__(self, profile: Profile) -> None:
        self._hover_V = profile.motor.hover_V
        self._was_enabled = self._tripped = False
        self._sent: tuple[deque[float], deque[float]] = deque(maxlen=SAMPLES), deque(maxlen=SAMPLES)
        self._wrong = [0, 0]
        """For each motor, the number of consecutive samples whose output is outside the band"""

    def __call__(self, now: Period) -> str | None:
        report = self._disabled(now) or self._not_following(now)
        self._tripped = report is not None
        return report

    def stop_without_ramp(self) -> str | None:
        return "stopped at once, since its output does not follow" if self._tripped else None

    def _disabled(self, now: Period) -> Trip | None:
        flags = int(now.sample.flags)
        if flags & _ENABLED:
            self._was_enabled = True
        elif self._was_enabled and not flags & STOPPED:
            return Trip(
                "the amplifier is off: the device does not report ENABLED any more",
                "another program or a switch disabled it, or its supply failed.",
                "check the amplifier's switch and supply; heli3dof doctor",
            )
        return None

    def _not_following(self, now: Period) -> Trip | None:
        explained = int(now.sample.flags) & _EXPLAINED
        output = now.motor_V
        for i, sent in enumerate(self._sent):
            sent.append(now.sent[i])
            v = output[i]
            # The first test is quick, and most samples need no other.
            far = abs(v - now.sent[i]) > SHARE * self._hover_V and not explained
            self._wrong[i] = self._wrong[i] + 1 if far and self._is_beyond(v, sent) else 0
            if self._wrong[i] > SAMPLES:
                return Trip(
                    f"the {MOTORS[i]} motor's output is {v:.1f} V at a command of "
                    f"{now.sent[i]:.1f} V, and has not followed the commands for {self._wrong[i]} "
                    "samples",
                    "the amplifier ignores the commands, a fuse is blown, or the driver reports a "
                    "voltage that it does not measure.",
                    "check the amplifier's fuses and supply; python -m heli3dof.rig.conformance "
                    "URL examines the driver",
                )
        return None

    def _is_beyond(self, v: float, sent: deque[float]) -> bool:
        low, high = min(sent), max(sent)
        hover_V = self._hover_V
        return v < low - SHARE * (hover_V + abs(low)) or v > high + SHARE * (hover_V + abs(high))
