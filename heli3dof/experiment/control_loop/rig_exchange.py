"""One exchange with the rig after another, each with its number, its deadline and its judgement."""

from __future__ import annotations

from dataclasses import replace
from time import monotonic

from heli3dof.experiment.control_loop.echo_latency import EchoMeter
from heli3dof.experiment.control_loop.outcome import Tally
from heli3dof.experiment.control_loop.timekeeping import timekeeper
from heli3dof.rig.interface import Command, Rig, Sample, device_cause
from heli3dof.rig.sample_check import check_sample, unusable_sample
from heli3dof.rig.trip import Trip


class Pacer:
    """Sends a voltage, waits for the period's end, and says how punctual its sample was."""

    def __init__(self, rig: Rig, dt: float, tally: Tally) -> None:
        self._rig = rig
        self.dt = dt
        """s, the control period"""
        self._time = timekeeper(rig, dt)
        self._tally = tally
        self.echo = EchoMeter(dt, clocked=rig.identity.timebase != "virtual")
        self.sequence = 0
        """The number of the last command"""
        self.sent = (0.0, 0.0)
        """V, what it said"""
        self.lateness = 0.0
        """s by which the sample that followed it was late"""
        self.skipped = 0
        """Periods that passed unused before that sample: missed, lost or left out"""
        self.left_out = 0
        """Those of them that the device left out"""
        self.unreadable: Trip | None = None
        """Why the last sample could not be used; the one before stands in for it"""

    def start(self) -> Sample:
        """Arm the rig; its first sample begins the flight."""
        sample = self._rig.arm()
        check_sample(sample)
        self._time.start(sample)
        return sample

    def exchange(self, since: Sample, voltage: tuple[float, float]) -> Sample:
        """Put out a voltage (V) computed from the sample ``since``; the sample that follows."""
        time = self._time
        self.sequence = (self.sequence + 1) & 0xFFFFFFFF
        self.sent = voltage
        due = time.next()
        command = Command(self.sequence, voltage[0], voltage[1])
        asked = monotonic()
        sample = self._rig.exchange(command, due)
        self.unreadable = unusable_sample(sample)
        if self.unreadable is not None:
            sample = replace(
                since, device_time_s=since.device_time_s + self.dt, host_time_s=monotonic()
            )
        time.arrived(sample, asked)
        self.echo.exchanged(self.sequence, asked, sample)
        self.lateness = time.lateness
        missed, lost, self.left_out = time.missed, time.lost, time.left_out
        self.skipped = missed + lost + self.left_out
        self._tally.count(time.lateness, asked - since.host_time_s, missed, lost, self.left_out)
        return sample

    @property
    def device_cause(self) -> str | None:
        """Why the device holds its output at zero, in its own word; None where it does not say."""
        return device_cause(self._rig)

    def stop(self, why: str) -> None:
        """Emergency stop. Where even that fails, the device's own watchdog is what remains."""
        try:
            self._rig.estop(why)
        except Exception:
            return
