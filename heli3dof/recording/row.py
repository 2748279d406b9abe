"""`Row`: the data of one control period, which the control loop passes to a recorder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from heli3dof.rig.interface import Sample

CLOSED_LOOP, RAMP_DOWN = 0, 1
"""Values of `Row.phase`: the loop is closed, or the voltages ramp to zero at the flight's end."""


@dataclass(frozen=True, slots=True)
class Row:
    """Data of one control period: sample, command computed from it, and the device's output."""

    t: float
    """s since the first sample, on the device's clock."""
    sample: Sample
    angle: tuple[float, float, float]
    """rad, roll, pitch, yaw"""
    reference: tuple[float, float, float]
    """rad, before the reference rate limiter"""
    limited: tuple[float, float, float]
    """rad, after the reference rate limiter"""
    extra: tuple[float, float]
    """V, front and back, added by the plan to the controller's output"""
    command: tuple[float, float]
    """V, the controller's output before the limiter"""
    voltage: tuple[float, float]
    """V, after the limiter, as sent"""
    command_sequence: int
    """Number of the command; a later sample echoes it"""
    applied: tuple[float, float]
    """V, the output until the next sample, as the device reports it"""
    lateness: float
    """s from the sample's deadline to its arrival"""
    phase: int
    """`CLOSED_LOOP` or `RAMP_DOWN`"""


class RowSink(Protocol):
    """Interface of a recorder: the control loop passes each period's row to `append`."""

    def append(self, row: Row) -> None: ...
