"""Exchanges commands for samples with the rig, once per control period of a flight."""

from __future__ import annotations

from dataclasses import replace
from time import monotonic

from heli3dof.experiment.control_loop.echo_latency import EchoMeter
from heli3dof.experiment.control_loop.outcome import Tally
from heli3dof.experiment.control_loop.stop_reasons import explain
from heli3dof.experiment.control_loop.timekeeping import timekeeper
from heli3dof.rig.interface import Command, Rig, Sample, device_cause
from heli3dof.rig.sample_check import check_sample, unusable_sample
from heli3dof.rig.trip import Trip


class RigExchange:
    """Sends a command and waits for the next sample in each period; measures samples' lateness."""

    def __init__(self, rig: Rig, dt: float, tally: Tally) -> None:
        self._rig = rig
        self.dt = dt
        """s, the control period"""
        self.time = timekeeper(rig, dt)
        """Lateness of the last sample, and the periods skipped before it"""
        self._tally = tally
        self.echo = EchoMeter(dt, clocked=rig.identity.timebase != "virtual")
        self.sequence = 0
        """Sequence number of the last command"""
        self.sent = (0.0, 0.0)
        """V (front, back) of the last command"""
        self._longest_s = 0.0
        """Longest time from sending a command to the return of a sample, in s"""
        self.unreadable: Trip | None = None
        """Why the last sample could not be used (`exchange` returned the previous one), or None"""

    def start(self) -> Sample:
        """Arm the rig and return the first sample of the flight."""
        sample = self._rig.arm()
        check_sample(sample)
        self.time.start(sample)
        return sample

    def exchange(self, measured: Sample, voltage: tuple[float, float]) -> Sample:
        """Send the voltages (V) computed from the sample ``measured``; return the next sample.

        If a field of the next sample is not a valid number, the method sets `unreadable`, and
        returns ``measured`` with the next period's time.
        """
        self.sequence = (self.sequence + 1) & 0xFFFFFFFF
        self.sent = voltage
        due = self.time.next()
        command = Command(self.sequence, voltage[0], voltage[1])
        sent_s = monotonic()
        sample = self._rig.exchange(command, due)
        self._longest_s = max(self._longest_s, monotonic() - sent_s)
        self.unreadable = unusable_sample(sample)
        if self.unreadable is not None:
            sample = replace(
                measured, device_time_s=measured.device_time_s + self.dt, host_time_s=monotonic()
            )
        self.time.arrived(sample, sent_s)
        self.echo.exchanged(self.sequence, sent_s, sample)
        self._tally.count(self.time, sent_s - measured.host_time_s)
        return sample

    def explain(self, flags: int) -> Trip | None:
        """Return what stopped the device, by the ``flags`` of its samples; None if nothing did."""
        return explain(flags, self.device_cause, self._longest_s)

    @property
    def device_cause(self) -> str | None:
        """Return the cause that the device states for holding its output at zero, or None."""
        return device_cause(self._rig)

    def stop(self, reason: str) -> None:
        """Request an emergency stop. If the request fails, the device's watchdog sets 0 V."""
        try:
            self._rig.estop(reason)
        except Exception:
            return
