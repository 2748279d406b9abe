"""The emulated electronics: amplifier limit, enable line, watchdog, emergency stop.

The watchdog counts the device's own time. After ``watchdog_s`` seconds without a command it
expires: the output ramps to zero in `RAMP_S` seconds and stays there (latched) until the next
arming.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from heli3dof.rig.interface import Flags

from ..link.frames import Cause
from .faults import FaultyPlant

if TYPE_CHECKING:
    from .plant import Plant

WATCHDOG_S = 0.1
RAMP_S = 0.2
FULL_CURRENT_A = 4.0
"""A, a motor's current at the amplifier's limit ``v_max``"""


class Device:
    """The emulated electronics, which turn commands into motor voltages and run the plant."""

    def __init__(
        self,
        plant: Plant | FaultyPlant,
        *,
        v_max: float,
        watchdog_s: float = WATCHDOG_S,
        held: bool = False,
    ) -> None:
        self.plant = plant
        self.v_max = v_max
        self.watchdog_s = watchdog_s
        self.held = held
        """True while the rig is held level: until the first command after arming"""
        self.sequence = 0
        self.enabled = self.latched = self.stopped = self.saturated = False
        self.fault = Flags(0)
        """Flag FAULT or STALL, while the amplifier reports it; else 0"""
        self.cause = Cause.NONE
        """Why the output is held at zero"""
        self.v = (0.0, 0.0)
        """V, the amplifier's output (front, back)"""
        self._command = (0.0, 0.0)
        self._silent_s = 0.0

    def arm(self) -> None:
        """Enable the output at zero volts, and end all states that hold the output at zero.

        These states follow an expired watchdog (``latched``), an emergency stop (``stopped``) and a
        fault of the amplifier (``fault``).
        """
        self.enabled, self.latched, self.stopped, self.saturated = True, False, False, False
        self.fault = Flags(0)
        self.cause = Cause.NONE
        self.v = self._command = (0.0, 0.0)
        self._silent_s = 0.0

    def stop(self) -> None:
        """Set the output to zero volts until the next `arm`."""
        self.stopped, self.saturated = True, False
        self.cause = Cause.HOST_ESTOP
        self.v = self._command = (0.0, 0.0)

    def disable(self) -> None:
        self.enabled, self.saturated = False, False
        self.v = self._command = (0.0, 0.0)

    def command(self, sequence: int, v_front: float, v_back: float) -> None:
        """Apply these voltages in V, clipped to ± ``v_max``. NaN or infinity stops the motors.

        The method only stores the command's number ``sequence`` in these cases: the device is not
        armed, it was stopped, its watchdog has expired, or its amplifier reports a fault.
        """
        self.sequence = sequence
        if not self.enabled or self.stopped or self.latched or self.fault:
            return
        if not (math.isfinite(v_front) and math.isfinite(v_back)):
            self.stop()  # min and max would turn a NaN into the limit
            return
        limit = self.v_max
        self.saturated = not (-limit <= v_front <= limit and -limit <= v_back <= limit)
        if self.saturated:
            v_front, v_back = max(-limit, min(limit, v_front)), max(-limit, min(limit, v_back))
        self.v = self._command = (v_front, v_back)
        self._silent_s = 0.0
        self.held = False

    def period(self) -> bool:
        """Simulate one control period at the present output; return False if its sample is lost."""
        silent = self._silent_s > self.watchdog_s
        if silent and self.enabled and not self.stopped and not self.fault:
            self.latched, self.saturated = True, False
            self.cause = Cause.WATCHDOG
            left = max(0.0, 1 - (self._silent_s - self.watchdog_s) / RAMP_S)
            self.v = (self._command[0] * left, self._command[1] * left)
        self._silent_s += self.plant.dt
        if self.held:
            return True
        arrived = self.plant.step(*self.v)
        trip = self.plant.trip() if isinstance(self.plant, FaultyPlant) else None
        if trip is not None:
            flag, self.cause = trip
            self.saturated = False
            self.v = self._command = (0.0, 0.0)
            if flag == Flags.ESTOP:
                self.stopped = True
            else:
                self.fault |= flag
        return arrived

    @property
    def current(self) -> tuple[float, float]:
        """Return the simulated motor currents (front, back) in A.

        The current of a motor is proportional to V |V|, V its voltage.
        """
        k = FULL_CURRENT_A / self.v_max**2
        return k * self.v[0] * abs(self.v[0]), k * self.v[1] * abs(self.v[1])

    @property
    def flags(self) -> Flags:
        value = 0
        if self.enabled and not self.latched and not self.stopped and not self.fault:
            value |= 1
        if self.fault:
            value |= self.fault
        if self.latched:
            value |= 8
        if self.stopped:
            value |= 16
        if self.saturated:
            value |= 32
        return _FLAGS[value]


_FLAGS = [Flags(value) for value in range(64)]
