"""Accepts the samples of the current arming that are new and echo a command that was sent.

Let n be a sample's number and e its echo, the number of the last command applied. n_last and e_last
are those of the last accepted sample (e_last is at first the ARM's number). c is the number of the
last command sent. The sample is accepted if

    0 < (n − n_last) mod 2³² < 2³¹    and    (e − e_last) mod 2³² ≤ (c − e_last) mod 2³²

So an accepted echo never decreases and never exceeds c. Repeated samples, overtaken samples and
samples of an earlier arming fail one of the two conditions. This module also unwraps the device's
clock (µs modulo 2³²) and its 32-bit encoder counts. Each accepted sample increases two counters:

    lost           += (n − n_last) − 1                 samples that never arrived
    device_skipped += (i − i_last) − (n − n_last)      not sampled: device was busy

i counts the stream's sampling instants up to the sample's time (`Instants`); i_last is this count
for the last accepted sample. The device uses the same clock for its sampling instants and for the
times of its samples. So the count is exact.
"""

from __future__ import annotations

from math import nan

from heli3dof.rig.clock import Instants
from heli3dof.rig.interface import Flags, Sample

from .frames import NOT_MEASURED, Cause, SampleFrame
from .request_reply import LinkStatistics

_MASK = 0xFFFFFFFF
_HALF = 0x80000000
_FLAGS = [Flags(value & 63) for value in range(256)]
BUSY = 0.9999
"""Largest delay of a sample, as a share of the period. A device that is a whole period late skips
the sample. Clock and period are whole µs: at periods up to 10 ms, no delay lies between 0.9999 and
1 period"""
REMEMBERED = 1024
"""Commands whose caller's sequence number is remembered: those of 1 s at 1 kHz"""


class SampleValidator:
    """Checks one connection's samples by their numbers and echoes; converts frames to `Sample`.

    A sample's echo is the number of the last command that the device had applied.
    """

    def __init__(self, statistics: LinkStatistics) -> None:
        self._statistics = statistics
        self.number = 0
        """Number of the last command sent, or of the ARM"""
        self.cause = 0
        """Cause in the last sample: why the device holds its output at zero"""
        self._sequences = [0] * REMEMBERED
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
        """Prepare for an arming, and return the number for the ARM frame that the caller will send.

        The number is one more (modulo 2³²) than that of the last command. From now on, `accept`
        rejects samples of earlier armings. ``period_us``: sampling period in µs of the stream that
        the ARM frame requests; 0: no stream.
        """
        self._period_s = period_us * 1e-6
        self._instants = None
        self.number = self._echo = (self.number + 1) & _MASK
        self._echoed = 0
        self._last = None
        return self.number

    def command(self, sequence: int) -> int:
        """Return the frame number for a new command, whose number for the caller is ``sequence``.

        A sample frame repeats the frame number of the last applied command. The `Sample` that
        `accept` returns has the caller's number instead.
        """
        self.number = number = (self.number + 1) & _MASK
        self._sequences[number % REMEMBERED] = sequence
        return number

    def accept(self, frame: SampleFrame, host_time_s: float) -> Sample | None:
        """Return the sample in ``frame``, or None if its number or its echo is not valid.

        A sample's echo is the number of the last command that the device had applied. This command
        must have been sent, and the echo must not be older than the last accepted sample's. The
        sample's number must be newer than the last accepted sample's. ``host_time_s``: time of
        arrival in s.
        """
        statistics = self._statistics
        ahead = (frame.echo - self._echo) & _MASK
        step = 1 if self._last is None else (frame.number - self._last) & _MASK
        if ahead > (self.number - self._echo) & _MASK or not 0 < step < _HALF:
            statistics.rejected += 1
            return None
        if ahead:
            self._echo = frame.echo
            self._echoed = self._sequences[frame.echo % REMEMBERED]
            if frame.delay_us != 0xFFFF:
                statistics.delay.add(frame.delay_us * 1e-6)
        sample = self.convert(frame, host_time_s)
        statistics.lost += step - 1
        self._last = frame.number
        if self._instants is not None:
            skipped = self._instants.skipped(sample.device_time_s)
            statistics.device_skipped += max(0, skipped - (step - 1))
        elif self._period_s:
            self._instants = Instants(self._period_s, sample.device_time_s, busy=BUSY, creep=0)
        return sample

    def convert(self, frame: SampleFrame, host_time_s: float) -> Sample:
        """Return the sample in ``frame`` without a check; ``host_time_s``: time of arrival in s."""
        r, p, y = self._counts
        # Signed 32-bit differences from the last counts; the first counts are near zero.
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
    def last_command_echoed(self) -> bool:
        return self._echo == self.number


def cause_name(cause: int) -> str | None:
    """Return the protocol's name of the number ``cause``; None for 0 (output not held at zero)."""
    if cause in set(Cause):
        return Cause(cause).name if cause else None
    return f"CAUSE_{cause}"


def _ampere(milliampere: int) -> float:
    return nan if milliampere == NOT_MEASURED else milliampere * 1e-3
