"""`Row`: one control period of a flight, as the loop passes it to a recorder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from heli3dof.rig.interface import Sample

CLOSED_LOOP, RAMP_DOWN = 0, 1
"""The phases of a flight, as recorded."""


@dataclass(frozen=True, slots=True)
class Row:
    """One control period: the sample, the command computed from it, and the device's output."""

    t: float
    """s since the first sample, on the device's clock."""
    sample: Sample
    angle: tuple[float, float, float]
    """rad"""
    reference: tuple[float, float, float]
    """rad, before the reference rate limiter"""
    limited: tuple[float, float, float]
    """rad, after the reference rate limiter"""
    extra: tuple[float, float]
    """V"""
    command: tuple[float, float]
    """V, before the limiter"""
    voltage: tuple[float, float]
    """V, after the limiter, as sent"""
    command_sequence: int
    """The sequence number of the command"""
    applied: tuple[float, float]
    """V, the output until the next sample, as the device reports it"""
    lateness: float
    """s, delay of the sample after its deadline"""
    phase: int


class RowSink(Protocol):
    """Receives the rows: a recorder, or a list in memory."""

    def append(self, row: Row) -> None: ...
