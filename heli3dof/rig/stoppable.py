"""A rig that heeds its session: an emergency stop asked for elsewhere, carried out here.

The loop goes on as before and ends by what the samples say (flag ESTOP)::

    exchange(command):   asked?  →  estop once, confirm, and zero volts from then on
    arm():               asked?  →  refused: arming would clear the stop

In every phase of a flight, landing included; within one control period of the question.
"""

from __future__ import annotations

from heli3dof.errors import SafetyTrip
from heli3dof.rig.port import Command, Identity, Rig, Sample
from heli3dof.rig.session import Session


class StoppableRig:
    """See `heli3dof.rig.port.Rig`."""

    def __init__(self, rig: Rig, session: Session) -> None:
        self._rig, self.session = rig, session
        self.last: Sample | None = None
        """The last sample, for whoever looks on."""
        self.lateness_s = 0.0
        """s that it came after its deadline; 0 where the host does not keep time"""
        self._host_timed = rig.identity.timebase == "host"

    @property
    def identity(self) -> Identity:
        return self._rig.identity

    def arm(self) -> Sample:
        if self.session.asked is not None:
            self._heed(self.session.asked)
            raise SafetyTrip(
                f"The rig was not armed: an emergency stop was asked for ({self.session.asked}).",
                cause="somebody ran heli3dof estop while the rig was being opened.",
                fix="find out who and why; then start again",
            )
        self.last = sample = self._rig.arm()
        return sample

    def read(self) -> Sample:
        if self.session.asked is not None:
            self._heed(self.session.asked)
        self.last = sample = self._rig.read()
        return sample

    def exchange(self, command: Command, due_s: float) -> Sample:
        if self.session.asked is not None:
            self._heed(self.session.asked)
            command = Command(command.sequence, 0.0, 0.0)
        self.last = sample = self._rig.exchange(command, due_s)
        if self._host_timed:
            self.lateness_s = sample.host_time_s - due_s
        return sample

    def estop(self, reason: str) -> None:
        self._rig.estop(reason)

    def close(self) -> None:
        self._rig.close()

    def _heed(self, why: str) -> None:
        if self.session.stopped is None:
            self._rig.estop(why)
            self.session.confirm("by the session that held the rig")
