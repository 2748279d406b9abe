"""What the loop knows in one control period, before its command goes out; and who may look at it.

A *watch* is anything that is called with every `Period` and returns why the flight must end now,
or None. It may keep what it needs from period to period; a flight gets watches of its own. It
runs inside the control period: a few microseconds, no input or output.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import NamedTuple

from heli3dof.rig.interface import Sample


class Period(NamedTuple):
    """One control period: the sample that opened it and what was computed from it."""

    k: int
    """The plan's period, 0 first; it jumps where periods were skipped."""
    t: float
    """s since the first sample, on the device's clock."""
    sample: Sample
    angle: tuple[float, float, float]
    """rad: roll, pitch, yaw"""
    rate: tuple[float, float, float]
    """rad/s, the controller's filtered derivatives"""
    command: tuple[float, float]
    """V asked for by the controller, before the limiter: front, back"""
    voltage: tuple[float, float]
    """V after it: what is about to be sent"""
    sent: tuple[float, float]
    """V sent in the period before"""
    command_sequence: int
    """The sequence that it was sent with: what this sample should echo"""
    lateness: float
    """s that the sample came after its deadline; 0 where the clock is virtual"""
    missed: int
    """Periods skipped just before this one: missed by the host, lost on the line, left out"""
    left_out: int = 0
    """Those of them that the device made no samples of"""
    echo_s: float = 0.0
    """s from sending the command that this sample is the first to echo; 0: it echoes no new one"""
    ramping_down: bool = False
    """True in the ramp to zero that ends a flight"""

    @property
    def motor_V(self) -> tuple[float, float]:
        """V at the motors before this sample: front, back."""
        return motor_voltage(self.sample, self.sent)


def motor_voltage(sample: Sample, sent: tuple[float, float]) -> tuple[float, float]:
    """V at the motors (front, back): what the device reports, or what was sent if it reports none.

    A driver whose amplifier does not report its output gives NaN.
    """
    front, back = sample.v_applied
    return (front if isfinite(front) else sent[0], back if isfinite(back) else sent[1])


Watch = Callable[[Period], str | None]
"""Why the flight must end now, or None."""
