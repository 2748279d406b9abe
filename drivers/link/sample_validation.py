"""Which samples are believed: an arming's own, newer than the last, echoing what was sent.

A sample with number n and echo e is taken while a_n = number of the last one, c_0 = the ARM's
number and c = the last command's

    0 < (n − a_n) mod 2³² < 2³¹    and    (e − e_last) mod 2³² ≤ (c − e_last) mod 2³²

e_last (c_0 at first) being the last echo: an echo never goes back, and never ahead of what was
sent. A repeated, overtaken or older arming's sample fails one of them. The device's clock, modulo
2³² µs, and its 32-bit counts are unwrapped here.

    lost     += (n − a_n) − 1                     made, and did not come
    left out += (i − i_last) − (n − a_n)          never made: the device was held up

i being the instant of the stream that the sample's time belongs to (`Instants`): by the device's
own clock in the period that it was armed with, so exactly.
"""

from __future__ import annotations

from array import array
from math import nan

from heli3dof.rig.interface import Flags, Sample
from heli3dof.rig.sample_instants import Instants

from .frames import NOT_MEASURED, Cause, SampleFrame
from .link_statistics import LinkStatistics

_MASK = 0xFFFFFFFF
_HALF = 0x80000000
_FLAGS = [Flags(value & 63) for value in range(256)]
BUSY = 0.9999
"""Of a period: by how much a device may take a sample too late; from one on, it leaves it out. Its
clock and its period are whole µs, so that nothing lies between."""
REMEMBERED = 1024
"""Commands whose sequence is known by their number; at least a second's worth"""


class Intake:
    """Numbers commands, judges samples, and turns those it takes into the port's."""

    def __init__(self, statistics: LinkStatistics) -> None:
        self._statistics = statistics
        self.number = 0
        """of the last command, or of the ARM"""
        self.cause = 0
        """Of the last sample: why the device holds its output at zero"""
        self._sequences = [0] * REMEMBERED
        self._sent_s = array("d", bytes(8 * REMEMBERED))
        self._echo = 0
        self._echoed = 0
        """The caller's sequence of the last command that was echoed"""
        self._last: int | None = None
        self._clock_us = 0
        self._wrapped: int | None = None
        self._counts = (0, 0, 0)
        self._period_s = 0.0
        self._instants: Instants | None = None

    def arm(self, period_us: int = 0) -> int:
        """A new arming, for a stream with this period (0: none): its number, greater than every
        command's before."""
        self._period_s = period_us * 1e-6
        self._instants = None
        self.number = self._echo = (self.number + 1) & _MASK
        self._echoed = 0
        self._last = None
        return self.number

    def command(self, sequence: int, now_s: float) -> int:
        """The number under which the caller's command ``sequence`` is sent now (monotonic, s)."""
        self.number = number = (self.number + 1) & _MASK
        self._sequences[number % REMEMBERED] = sequence
        self._sent_s[number % REMEMBERED] = now_s
        return number

    def take(self, frame: SampleFrame, host_time_s: float) -> Sample | None:
        """The port's sample, or None for one that cannot be."""
        statistics = self._statistics
        ahead = (frame.echo - self._echo) & _MASK
        step = 1 if self._last is None else (frame.number - self._last) & _MASK
        if ahead > (self.number - self._echo) & _MASK or not 0 < step < _HALF:
            statistics.rejected += 1
            return None
        if ahead:
            self._echo = frame.echo
            self._echoed = self._sequences[frame.echo % REMEMBERED]
            statistics.latency.add(host_time_s - self._sent_s[frame.echo % REMEMBERED])
            if frame.delay_us != 0xFFFF:
                statistics.delay.add(frame.delay_us * 1e-6)
        sample = self.sample(frame, host_time_s)
        statistics.lost += step - 1
        self._last = frame.number
        if self._instants is not None:
            skipped = self._instants.skipped(sample.device_time_s)
            statistics.left_out += max(0, skipped - (step - 1))
        elif self._period_s:
            self._instants = Instants(self._period_s, sample.device_time_s, busy=BUSY, creep=0)
        return sample

    def sample(self, frame: SampleFrame, host_time_s: float) -> Sample:
        """The port's sample of any frame, as ``read`` needs it of a rig that is not armed."""
        r, p, y = self._counts
        # The signed 32-bit difference to the last count; the first one is near zero.
        self._counts = counts = (
            r + ((frame.roll - r + _HALF) & _MASK) - _HALF,
            p + ((frame.pitch - p + _HALF) & _MASK) - _HALF,
            y + ((frame.yaw - y + _HALF) & _MASK) - _HALF,
        )
        if self._wrapped is not None:
            step = (frame.time_us - self._wrapped) & _MASK
            self._clock_us += step if step < _HALF else step - _MASK - 1
        else:
            self._clock_us = frame.time_us
        self._wrapped = frame.time_us
        self.cause = frame.cause
        return Sample(
            self._echoed,
            self._clock_us / 1e6,
            counts,
            (frame.front_uV / 1e6, frame.back_uV / 1e6),
            (_ampere(frame.front_mA), _ampere(frame.back_mA)),
            _FLAGS[frame.flags],
            host_time_s,
        )

    @property
    def heard(self) -> bool:
        """True when the last command has been echoed."""
        return self._echo == self.number


def cause_name(cause: int) -> str | None:
    """The protocol's name of a cause; None for none."""
    if cause in set(Cause):
        return Cause(cause).name if cause else None
    return f"CAUSE_{cause}"


def _ampere(milliampere: int) -> float:
    return nan if milliampere == NOT_MEASURED else milliampere * 1e-3
