"""Counters of a link and the distribution of its round trip, for recordings, doctor and benches."""

from __future__ import annotations

from dataclasses import dataclass, field

from heli3dof.rig.histogram import Histogram


@dataclass
class LinkStatistics:
    """Counts since the link was opened."""

    sent: int = 0
    """Frames to the device"""
    received: int = 0
    """Valid frames from the device"""
    malformed: int = 0
    """Pieces between delimiters that were not a valid frame"""
    lost: int = 0
    """Samples that the device took and that never arrived: their numbers are missing"""
    device_skipped: int = 0
    """Samples that the device never took because it was held up: its time jumped, no number is
    missing"""
    samples_stale: int = 0
    """Samples that arrived too late to be used: with a newer one, or after the next command"""
    rejected: int = 0
    """Valid frames with an impossible sample: a repeated number, or the echo of a command that was
    never sent"""
    commands: int = 0
    commands_unacknowledged: int = 0
    """Commands that the next sample did not echo: lost, refused, or still on their way"""
    retries: int = 0
    """Requests sent again because no reply arrived"""
    round_trip: Histogram = field(default_factory=Histogram)
    """From a request to its reply"""
    delay: Histogram = field(default_factory=Histogram)
    """From a sample to the arrival of the next command, by the device's clock: the latency modulo
    the period"""
