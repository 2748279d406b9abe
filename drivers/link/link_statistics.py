"""How a link has been: counters and the round trip's distribution, for doctor and the benches."""

from __future__ import annotations

from dataclasses import dataclass, field

from heli3dof.rig.histogram import Histogram


@dataclass
class LinkStatistics:
    """Since the link was opened."""

    sent: int = 0
    """Frames to the device"""
    received: int = 0
    """Frames from it, whole and right"""
    damaged: int = 0
    """Pieces that were no frame"""
    lost: int = 0
    """Samples that the device made and that never came: numbers are missing"""
    left_out: int = 0
    """Samples that the device, held up itself, never made: time jumped, no number is missing"""
    passed_over: int = 0
    """Samples that came too late to be of use: with a newer one, or after the next command"""
    rejected: int = 0
    """Whole samples that cannot be: an echo of what was not sent, a number that was there before"""
    commands: int = 0
    commands_unacknowledged: int = 0
    """Commands that the sample after them did not echo: lost, refused, or still on their way"""
    repeats: int = 0
    """Questions asked again because no answer came"""
    round_trip: Histogram = field(default_factory=Histogram)
    """From a question to its answer"""
    delay: Histogram = field(default_factory=Histogram)
    """From a sample to the next command's arrival, by the device's clock: the latency modulo the
    period"""
    latency: Histogram = field(default_factory=Histogram)
    """From sending a command to the first sample that echoes it, by the host's clock"""
