"""`StoppableRig`: wraps a rig so that other processes can stop it.

The wrapper also clips the commanded voltages to a limit. It subtracts the counts at the rest angles
from each sample's counts, so the counts are zero at rest.

If another process requests an emergency stop, the next calls do this::

    exchange(command), read():   stop the device and confirm the stop to the requester, once;
                                 exchange sends zero volts instead of the command
    arm():                       stop the device and raise SafetyTrip, since arming would clear
                                 the stop. arm() does this also if a stop came after the
                                 program started (`heli3dof.rig.session.stop_stamp`)

The samples then have the flag ESTOP, which ends the control loop.

The stop acts within one control period of the request, in every phase of a flight, also in the ramp
to zero. `StoppableRig.arm` checks before and after it arms. A rig with several attempts to arm
checks in each attempt (`heli3dof.rig.interface.ArmsWithPermission`).
"""

from __future__ import annotations

import math

from heli3dof.errors import SafetyTrip
from heli3dof.rig.calibration import COUNTS_AT_POWER_UP, RestCounts
from heli3dof.rig.drivers import driver_errors
from heli3dof.rig.interface import (
    ArmsWithPermission,
    Command,
    HasLinkStatistics,
    Identity,
    Rig,
    Sample,
    device_cause,
)
from heli3dof.rig.sample_check import check_sample
from heli3dof.rig.session.server import Session


class StoppableRig:
    """Wraps an open rig so that other processes can stop it.

    The wrapper clips each commanded voltage to ±``v_max``. It subtracts the counts at the rest
    angles from the counts in each sample, so the counts are zero at rest.
    """

    def __init__(
        self,
        rig: Rig,
        session: Session,
        rest: RestCounts = COUNTS_AT_POWER_UP,
        v_max: float = math.inf,
    ) -> None:
        """Wrap ``rig``, the driver's open rig.

        ``session``: contains requests to stop. ``rest``: encoder counts at the rest angles.
        ``v_max``: largest voltage in V; by default only the device limits the voltages.
        """
        self.inner, self.session = rig, session
        self.rest = rest
        self.v_max = v_max
        self.last: Sample | None = None
        """The last sample, for other processes"""
        if isinstance(rig, ArmsWithPermission):
            rig.check_permission = self._check_permission

    @property
    def identity(self) -> Identity:
        return self.inner.identity

    @property
    def statistics(self) -> object:
        """Return the counters of the rig's link; None for a rig without counters."""
        return self.inner.statistics if isinstance(self.inner, HasLinkStatistics) else None

    @property
    def device_cause(self) -> str | None:
        """Return why the device holds its output at zero; None if the device states no reason."""
        return device_cause(self.inner)

    def arm(self) -> Sample:
        """Arm the rig and return a sample. Raises SafetyTrip if an emergency stop forbids it."""
        self._check_permission()
        sample = self._from_rest(self.inner.arm())
        self._check_permission()
        self.last = sample
        return sample

    def read(self) -> Sample:
        if self.session.stop_reason is not None:
            self._stop(self.session.stop_reason)
        sample = self.inner.read()
        check_sample(sample)
        self.last = sample = self._from_rest(sample)
        return sample

    def exchange(self, command: Command, due_s: float) -> Sample:
        """Apply the command's voltages now; return the sample at the end of the control period.

        The voltages are clipped to the profile's ``motor.v_max``. The device stops its motors at a
        NaN, and if no command follows within `Identity.watchdog_s`. ``due_s``: the end of the
        period, s on the host's monotonic clock.
        """
        v = self.v_max
        if not (-v <= command.v_front <= v and -v <= command.v_back <= v):
            front, back = (
                x if math.isnan(x) else max(-v, min(v, x))
                for x in (command.v_front, command.v_back)
            )
            command = Command(command.sequence, front, back)
        if self.session.stop_reason is not None:
            self._stop(self.session.stop_reason)
            command = Command(command.sequence, 0.0, 0.0)
        self.last = sample = self._from_rest(self.inner.exchange(command, due_s))
        return sample

    def _from_rest(self, sample: Sample) -> Sample:
        zero = self.rest.counts_at_rest
        if zero == (0, 0, 0):
            return sample
        try:
            roll, pitch, yaw = sample.counts
            # Not dataclasses.replace: it takes ten times as long.
            return Sample(
                sample.sequence,
                sample.device_time_s,
                (roll - zero[0], pitch - zero[1], yaw - zero[2]),
                sample.v_applied,
                sample.current,
                sample.flags,
                sample.host_time_s,
            )
        except (AttributeError, TypeError, ValueError):
            return sample  # the loop reports an unusable sample

    def estop(self, reason: str) -> None:
        self.inner.estop(reason)

    def close(self) -> None:
        with driver_errors(self.inner):
            self.inner.close()

    def _check_permission(self) -> None:
        reason = self.session.begin_to_arm()
        if reason is not None:
            self._stop(reason)
            raise SafetyTrip(
                f"The rig was not armed: an emergency stop was requested ({reason}).",
                cause="heli3dof estop was run after this command began.",
                fix="find out who stopped it and why; then start again (a program of your own "
                "first calls heli3dof.rig.session.stop_stamp.start_command)",
            )

    def _stop(self, reason: str) -> None:
        if self.session.stopped is None:
            self.inner.estop(reason)
            self.session.confirm("through its own connection")
