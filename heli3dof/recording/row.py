"""`Row`: the data of one control period, which the control loop passes to a recorder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from heli3dof.rig.interface import Sample

CLOSED_LOOP, RAMP_DOWN = 0, 1
"""Values of `Row.phase`: the loop is closed, or the voltages ramp to zero at the flight's end."""


@dataclass(frozen=True, slots=True)
class Row:
    """The data of one control period, such as angles, references, voltages and lateness."""

    t: float
    """s since the first sample, on the device's clock."""
    sample: Sample
    angle: tuple[float, float, float]
    """rad, measured roll, pitch, yaw"""
    reference: tuple[float, float, float]
    """rad, references of roll, pitch, yaw before the rate limiter"""
    limited: tuple[float, float, float]
    """rad, references of roll, pitch, yaw after the rate limiter"""
    extra: tuple[float, float]
    """V, front and back, added by the plan to the controller's output"""
    command: tuple[float, float]
    """V, the controller's output (front, back) before the limiter"""
    voltage: tuple[float, float]
    """V, voltages (front, back) after the limiter, as sent to the device"""
    command_sequence: int
    """Sequence number of the command, which a later sample echoes"""
    applied: tuple[float, float]
    """V, output voltages (front, back) until the next sample, as the device reports them"""
    lateness: float
    """s, time from the sample's deadline to its arrival"""
    phase: int
    """`CLOSED_LOOP` or `RAMP_DOWN`"""


class RowSink(Protocol):
    """Interface of a recorder; the control loop calls its `append` with each period's row."""

    def append(self, row: Row) -> None: ...
