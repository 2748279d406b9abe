"""`Period`: data of one control period, from which safety monitors judge the flight.

The loop calls each monitor with every `Period`, before the command is sent. The monitor returns why
the flight must end now, or None. A monitor may keep state from period to period, so each flight
needs new monitors. A monitor runs inside the control period, so it may take only a few
microseconds, and must not read or write files.
"""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

from heli3dof.rig.interface import Sample


class Period(NamedTuple):
    """Data of one control period: the sample, and the controller's output computed from it."""

    k: int
    """Index in the plan, 0 first; skipped periods leave a gap. In the ramp: the plan's length"""
    t: float
    """s since the first sample, on the device's clock."""
    sample: Sample
    angle: tuple[float, float, float]
    """rad: roll, pitch, yaw"""
    rate: tuple[float, float, float]
    """rad/s, the controller's filtered derivatives"""
    command: tuple[float, float]
    """V (front, back): the controller's output before the voltage limiter"""
    voltage: tuple[float, float]
    """V (front, back) after the voltage limiter, to be sent next"""
    sent: tuple[float, float]
    """V (front, back) sent in the previous period"""
    command_sequence: int
    """Sequence number of the command that carried ``sent``, which this sample should echo"""
    lateness: float
    """s from the deadline to the sample's arrival; 0 on a virtual clock"""
    skipped: int
    """Periods skipped just before this one, by the host, the line or the device"""
    device_skipped: int = 0
    """How many of the ``skipped`` periods have no sample because the device made none"""
    echo_s: float = 0.0
    """s from sending a command to this sample, the first to echo it; 0 without a new echo"""
    ramping_down: bool = False
    """True in the ramp to zero that ends a flight; ``k`` and ``rate`` then do not change, and
    ``command`` and ``voltage`` equal ``sent``"""

    @property
    def motor_V(self) -> tuple[float, float]:
        """Return the voltages (front, back) in V at the motors in the period before this sample."""
        return motor_voltage(self.sample, self.sent)


def motor_voltage(sample: Sample, sent: tuple[float, float]) -> tuple[float, float]:
    """Return the voltages (front, back) at the motors in V: reported by the device, or ``sent``.

    ``sent`` (V) is the last command. It replaces values of ``sample.v_applied`` that are NaN
    because the amplifier does not report its output voltages.
    """
    front, back = sample.v_applied
    return (front if isfinite(front) else sent[0], back if isfinite(back) else sent[1])
