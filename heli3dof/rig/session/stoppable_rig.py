"""A rig as its session holds it: it heeds a stop asked for elsewhere, and counts from rest.

The loop goes on as before and ends by what the samples say (flag ESTOP)::

    exchange(command):   asked?  →  estop once, confirm, and zero volts from then on
    arm():               asked, or stopped since this was begun (`heli3dof.rig.session.stop_stamp`)?
                         →  refused: arming would clear the stop

In every phase of a flight, landing included; within one control period of the question. `arm`
looks before and after; a driver that makes several attempts to arm has an attribute ``permit``,
which it calls in each of them (see `heli3dof_drivers.link.rig`).

Every sample's counts are taken from where they stand at the rest angles
(`heli3dof.rig.calibration`).
"""

from __future__ import annotations

from heli3dof.errors import DeviceError, SafetyTrip
from heli3dof.rig.calibration import POWER_UP, Rest
from heli3dof.rig.interface import Command, Identity, Rig, Sample, device_cause
from heli3dof.rig.sample_check import unreadable
from heli3dof.rig.session.server import Session


class StoppableRig:
    """See `heli3dof.rig.interface.Rig`."""

    def __init__(self, rig: Rig, session: Session, rest: Rest = POWER_UP) -> None:
        self.inner, self.session = rig, session
        self.rest = rest
        self.last: Sample | None = None
        """The last sample, for onlookers."""
        if hasattr(rig, "permit"):
            rig.permit = self._permit

    @property
    def identity(self) -> Identity:
        return self.inner.identity

    @property
    def statistics(self) -> object:
        """What the rig's link has counted; None where it counts nothing."""
        return getattr(self.inner, "statistics", None)

    @property
    def device_cause(self) -> str | None:
        """Why the device holds its output at zero, in its own word."""
        return device_cause(self.inner)

    def arm(self) -> Sample:
        """Raises SafetyTrip where a stop forbids it."""
        self._permit()
        sample = self._from_rest(self.inner.arm())
        self._permit()
        self.last = sample
        return sample

    def read(self) -> Sample:
        if self.session.asked is not None:
            self._heed(self.session.asked)
        read = self.inner.read()
        if (what := unreadable(read)) is not None:
            raise DeviceError(
                f"The rig's driver gave a sample that cannot be used: {what}.",
                cause="a mistake in the driver, or a reading that failed and was passed on.",
                fix="python -m heli3dof.rig.conformance URL, which examines a driver",
            )
        self.last = sample = self._from_rest(read)
        return sample

    def exchange(self, command: Command, due_s: float) -> Sample:
        if self.session.asked is not None:
            self._heed(self.session.asked)
            command = Command(command.sequence, 0.0, 0.0)
        self.last = sample = self._from_rest(self.inner.exchange(command, due_s))
        return sample

    def _from_rest(self, sample: Sample) -> Sample:
        zero = self.rest.counts_at_rest
        if zero == (0, 0, 0) or unreadable(sample) is not None:  # the loop judges that
            return sample
        counts = sample.counts
        # Not dataclasses.replace: this is in the control period, and that takes ten times as long.
        return Sample(
            sample.sequence,
            sample.device_time_s,
            (counts[0] - zero[0], counts[1] - zero[1], counts[2] - zero[2]),
            sample.v_applied,
            sample.current,
            sample.flags,
            sample.host_time_s,
        )

    def estop(self, reason: str) -> None:
        self.inner.estop(reason)

    def close(self) -> None:
        self.inner.close()

    def _permit(self) -> None:
        why = self.session.begin_to_arm()
        if why is not None:
            self._heed(why)
            raise SafetyTrip(
                f"The rig was not armed: an emergency stop was asked for ({why}).",
                cause="heli3dof estop was run after this had been begun.",
                fix="find out who and why; then start again (a program that takes commands of its "
                "own says when one begins: heli3dof.rig.session.stop_stamp.start_command)",
            )

    def _heed(self, why: str) -> None:
        if self.session.stopped is None:
            self.inner.estop(why)
            self.session.confirm("through its own connection")
