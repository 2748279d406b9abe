"""Counters and time distributions of a connection, for recordings, ``doctor`` and benchmarks."""

from __future__ import annotations

from dataclasses import dataclass, field

from heli3dof.rig.histogram import Histogram


@dataclass
class LinkStatistics:
    """Counts of frames and samples, and distributions of times, since the connection was opened."""

    sent: int = 0
    """Frames to the device"""
    received: int = 0
    """Valid frames from the device"""
    malformed: int = 0
    """Pieces between delimiters that were not a valid frame"""
    lost: int = 0
    """Samples that the device took and that never arrived: their numbers are missing"""
    device_skipped: int = 0
    """Samples that a busy device did not take: its time jumped, but no number is missing"""
    samples_stale: int = 0
    """Samples that arrived too late to be used: with a newer one, or after the next command"""
    rejected: int = 0
    """Valid frames with an impossible sample: a repeated number, or an echo of no sent command"""
    commands: int = 0
    commands_unacknowledged: int = 0
    """Commands that the next sample did not echo: lost, refused, or still on their way"""
    retries: int = 0
    """Requests sent again because no reply arrived"""
    round_trip: Histogram = field(default_factory=Histogram)
    """s from a request to its reply"""
    delay: Histogram = field(default_factory=Histogram)
    """s on the device's clock from a sample to the arrival of the next command at the device.

    This delay is the loop's latency modulo the sample period.
    """
