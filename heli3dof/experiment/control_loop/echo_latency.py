"""Command-to-echo latency: from sending a command to the first sample that echoes it.

Command c is sent at s_c. Sample k arrives at h_k and echoes command e_k (``Sample.sequence``). Both
times are on the host's monotonic clock::

    latency(c) = h_k − s_c,   k the first sample with e_k = c

The latency is the dead time of the control loop: transmission, the wait for the next sampling
instant, and transmission back. On a rig without delay the latency is one control period minus the
controller's computing time.

A command is **unacknowledged** if the sample at the end of its control period does not echo it.
Such a command was lost, was refused, or has not arrived yet. A command was **never echoed** if a
later command was echoed first. Both kinds of command are counted only while the device is enabled,
since a stopped device refuses every command.

When an echo arrives, newer commands may still be on their way. Let m be the largest number of such
commands at any echo in the flight. At the end of the flight, n commands are still without an echo.
If n > m, the device has stopped echoing, so these n commands count as never echoed, too.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass

from heli3dof.rig.histogram import Histogram
from heli3dof.rig.interface import Flags, Sample

PENDING = 4096
"""Commands whose sending time is kept: 8 s at 500 Hz, longer than any watchdog (at most 1 s)"""
_MASK = 0xFFFFFFFF
_ENABLED = int(Flags.ENABLED)  # `&` of two Flags takes 2 µs


@dataclass(frozen=True, slots=True)
class EchoLatency:
    """Statistics of one flight's command-to-echo latency, in s and in control periods.

    A time is None if it was never measured.
    """

    commands: int
    commands_unacknowledged: int
    commands_never_echoed: int
    median_s: float | None
    p999_s: float | None
    worst_s: float | None
    median_periods: int | None
    """``median_s`` in whole control periods, rounded, at least 1"""
    p999_periods: int | None
    worst_periods: int | None


class EchoMeter:
    """Measures the command-to-echo latency of one flight, in constant memory.

    ``dt``: the control period in s. ``clocked``: False for a virtual clock; the meter then counts
    commands without measuring times.
    """

    def __init__(self, dt: float, *, clocked: bool = True) -> None:
        self._dt = dt
        self._clocked = clocked
        self._sent_s = array("d", bytes(8 * PENDING))
        self._echo = 0
        """Sequence of the newest command that was echoed"""
        self.latency = Histogram()
        self.commands = self.unacknowledged = self.never_echoed = 0
        self._pending = self._most_pending = 0
        """Number of commands without an echo: the present one (`_pending`), and its largest value
        just after a new echo (`_most_pending`)"""
        self.last_s = 0.0
        """s: latency of the newest command that the last sample echoes; 0 without a new echo"""

    def exchanged(self, sequence: int, sent_s: float, sample: Sample) -> None:
        """Update the statistics with a sent command and the ``sample`` that followed.

        ``sequence``: the command's number; ``sent_s``: when it was sent (s, monotonic clock).
        """
        self._sent_s[sequence % PENDING] = sent_s
        self.last_s = 0.0
        if not int(sample.flags) & _ENABLED:
            return
        self.commands += 1
        self._pending += 1
        echo = sample.sequence
        self.unacknowledged += echo != sequence
        ahead = (echo - self._echo) & _MASK
        if not 0 < ahead <= (sequence - self._echo) & _MASK:
            return  # nothing new
        if ahead < PENDING and self._clocked:
            self.last_s = sample.host_time_s - self._sent_s[echo % PENDING]
            self.latency.add(self.last_s)
        self.never_echoed += ahead - 1
        self._pending = (sequence - echo) & _MASK
        self._most_pending = max(self._most_pending, self._pending)
        self._echo = echo

    def measured(self) -> EchoLatency | None:
        """Return the latency's statistics; None if no command was sent to an enabled device."""
        if not self.commands:
            return None
        lost = self._pending if self._pending > self._most_pending else 0
        counts = (self.commands, self.unacknowledged, self.never_echoed + lost)
        latency = self.latency
        if not latency.n:
            return EchoLatency(*counts, None, None, None, None, None, None)
        times = (latency.quantile_s(0.5), latency.quantile_s(0.999), latency.worst_s)
        median, p999, worst = (max(1, round(t / self._dt)) for t in times)
        return EchoLatency(*counts, *times, median, p999, worst)
