"""`Period`, what the loop knows in one control period before it sends the command.

A *monitor* is called with every `Period` and returns why the flight must end now, or None. It may
keep state from period to period, so each flight needs new monitors. It runs inside the control
period: a few microseconds, no input or output.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import NamedTuple

from heli3dof.rig.interface import Sample


class Period(NamedTuple):
    """One control period: its sample, and what the loop computed from it."""

    k: int
    """Index in the plan, 0 first; skipped periods leave a gap."""
    t: float
    """s since the first sample, on the device's clock."""
    sample: Sample
    angle: tuple[float, float, float]
    """rad: roll, pitch, yaw"""
    rate: tuple[float, float, float]
    """rad/s, the controller's filtered derivatives"""
    command: tuple[float, float]
    """V: the controller's output before the limiter: front, back"""
    voltage: tuple[float, float]
    """V after the limiter, to be sent next"""
    sent: tuple[float, float]
    """V sent in the period before"""
    command_sequence: int
    """Sequence number of that command, which this sample should echo"""
    lateness: float
    """s from the deadline to the sample's arrival; 0 on a virtual clock"""
    missed: int
    """Periods skipped just before this one: missed by the host, lost on the line or left out"""
    left_out: int = 0
    """Those for which the device made no sample"""
    echo_s: float = 0.0
    """s from sending a command to this sample, the first to echo it; 0 if it echoes no new one"""
    ramping_down: bool = False
    """True in the ramp to zero that ends a flight"""

    @property
    def motor_V(self) -> tuple[float, float]:
        """V at the motors before this sample: front, back."""
        return motor_voltage(self.sample, self.sent)


def motor_voltage(sample: Sample, sent: tuple[float, float]) -> tuple[float, float]:
    """V at the motors (front, back): as reported by the device, else as sent.

    A driver whose amplifier does not report its output gives NaN.
    """
    front, back = sample.v_applied
    return (front if isfinite(front) else sent[0], back if isfinite(back) else sent[1])


Monitor = Callable[[Period], str | None]
"""Returns why the flight must end now, or None."""
