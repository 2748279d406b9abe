"""One control period of a flight, as the loop hands it to whoever keeps it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from heli3dof.rig.interface import Sample

CLOSED_LOOP, RAMP_DOWN = 0, 1
"""The phases of a flight, as recorded."""


@dataclass(frozen=True, slots=True)
class Row:
    """One control period: the sample, what was computed from it, and what the device put out."""

    t: float
    """s since the first sample, on the device's clock."""
    sample: Sample
    angle: tuple[float, float, float]
    """rad"""
    reference: tuple[float, float, float]
    """rad, as asked for"""
    limited: tuple[float, float, float]
    """rad, after the reference rate limiter"""
    extra: tuple[float, float]
    """V"""
    command: tuple[float, float]
    """V, before the limiter"""
    voltage: tuple[float, float]
    """V, after it: what was sent"""
    command_sequence: int
    """The sequence it was sent with"""
    applied: tuple[float, float]
    """V, what the device says it put out until the next sample"""
    lateness: float
    """s that the sample came after its deadline"""
    phase: int


class RowSink(Protocol):
    """Whoever keeps the rows: a recorder, or a list in memory."""

    def append(self, row: Row) -> None: ...
