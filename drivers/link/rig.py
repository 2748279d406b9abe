"""A rig at the other end of the link, whatever carries it; protocol.md, the host's side.

Streaming (the device keeps time)::

    exchange:  COMMAND at once ──▶ ... the device's next sample ──▶ the port's sample

Samples that were waiting when the command went out say nothing of it: they are passed over, and
of several that came together the newest counts. So a host that was late loses periods, and never
flies two of them in one. A command that the line lost or delayed costs no period: the sample is
taken when it comes, and its echo says so. Polled (the host keeps time)::

    exchange:  COMMAND at once, wait until due_s, POLL ──▶ SAMPLE
"""

from __future__ import annotations

import time
from collections.abc import Callable
from math import isfinite
from typing import TYPE_CHECKING

from heli3dof.errors import DeviceError
from heli3dof.rig.clock import wait_until
from heli3dof.rig.interface import Command, Flags, Identity, Sample
from heli3dof.rig.uptime import CLOCK_TOLERANCE, wrapped_difference_s

from .emergency_stop import BESIDE_TRIES, STOP_TRIES, ack_of, stop, stop_over
from .errors import (
    closed,
    gone_silent,
    not_a_voltage,
    not_armed,
    not_arming,
    not_ours,
    not_stopped,
    restarted,
)
from .frames import (
    Ack,
    Arm,
    Code,
    Disarm,
    Estop,
    Frame,
    Hello,
    IdentityFrame,
    Report,
    Status,
    Type,
    command,
    wire,
)
from .handshake import check_profile, greet, period_of
from .request_reply import TRIES, Dialogue
from .sample_validation import Intake, cause_name
from .sampling import Sampling

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile

    from .link_statistics import LinkStatistics
    from .transport import Transport

LARGEST_uV = 2_000_000_000
"""What fits into a command; any device clips long before."""
RESTART_S = 0.7
"""s by which the uptime must fall short of what it should be: a STATUS is asked `TRIES` times at
most, 0.6 s in all, before it is answered"""
EMULATED = "emulated"
"""How the model of a device without motors begins"""


class LinkRig:
    """An open rig; see `heli3dof.rig.interface.Rig`. ``statistics`` says how the link has been."""

    def __init__(
        self,
        transport: Transport,
        profile: Profile,
        *,
        driver: str,
        stream: bool = True,
        watchdog_s: float | None = None,
        signs: str = "device",
    ) -> None:
        """Greet the device and compare it with the profile; nothing moves.

        ``stream=False``: the host keeps time. ``watchdog_s``: another time than the device's own.
        ``signs="profile"``: which way the encoders count is believed to the profile. Raises
        DeviceError, and closes the transport then.
        """
        self._transport = transport
        self._dialogue = Dialogue(transport)
        self._intake = Intake(self._dialogue.statistics)
        self._stream = stream
        self._samples = Sampling(self._dialogue, self._intake)
        self._streaming = False
        self._gone = self._ours = False
        self._open = True
        self.check_permission: Callable[[], None] = lambda: None
        """See `heli3dof.rig.interface.ArmsWithPermission`; called once the ticket is known."""
        try:
            said = greet(self._dialogue)
            check_profile(said, profile, transport.name, signs=signs)
        except BaseException:
            transport.close()
            raise
        self._boot = said.boot
        uptime_s = self._uptime_s() or None  # 0: a device that does not keep it
        self._started_s = None if uptime_s is None else time.monotonic() - uptime_s
        self._period_us = period_of(profile)
        own_us = said.watchdog_us
        asked_us = own_us if watchdog_s is None else round(watchdog_s * 1e6)
        self._watchdog_us = max(asked_us, 3 * self._period_us)
        started_s = None if uptime_s is None else time.time() - uptime_s
        self._identity = _identity(said, driver, stream, self._watchdog_us, started_s)

    @property
    def identity(self) -> Identity:
        return self._identity

    @property
    def statistics(self) -> LinkStatistics:
        """How the link has been since it was opened."""
        return self._dialogue.statistics

    @property
    def device_cause(self) -> str | None:
        """Why the device holds its output at zero, by its last sample."""
        return cause_name(self._intake.cause)

    def arm(self) -> Sample:
        """Zero volts, latches cleared, enabled; the first sample."""
        self._check_open()
        self._samples.armed = self._streaming = False
        self._ours = True
        # Counts that began anew since the rig was opened would be taken for angles of before.
        if (problem := self._why_silent()) is not None:
            raise problem
        for _ in range(TRIES):
            disarmed = self._request(Disarm)
            # A stop later than this changes the ticket: the device then refuses to arm.
            self.check_permission()
            self._samples.pass_over()
            said = self._ask_to_arm(disarmed.ticket)
            if said is None:
                continue
            code = said.code
            if code == Code.OK:
                self._samples.armed, self._streaming = True, self._stream
                self._samples.took(self._dialogue.trip_s)
                return self._next_of_stream() if self._stream else self._first()
            if code not in (Code.STALE_TICKET, Code.ALREADY_ARMED):
                raise not_arming(
                    self._transport.name, code, said.cause, self._period_us, self._watchdog_us
                )
        raise self._silence()

    def read(self) -> Sample:
        """A sample now, armed or not."""
        self._check_open()
        if self._streaming:
            self._samples.pass_over()
            return self._next_of_stream()
        return self._poll()

    def exchange(self, command_: Command, due_s: float) -> Sample:
        """One control period under the command; see `heli3dof.rig.interface`."""
        self._check_open()
        v_front, v_back = command_.v_front, command_.v_back
        if not (isfinite(v_front) and isfinite(v_back)):
            self.estop("a voltage that is not a number")
            raise not_a_voltage(command_.sequence, v_front, v_back)
        if not self._samples.armed:
            raise not_armed(self._transport.name)
        self._samples.pass_over()
        number = self._intake.command(command_.sequence, time.monotonic())
        self._dialogue.send(command(number, _microvolts(v_front), _microvolts(v_back)))
        self.statistics.commands += 1
        if self._streaming:
            return self._next_of_stream()
        wait_until(due_s)
        return self._poll()

    def estop(self, reason: str) -> None:
        """Zero volts now. Raises DeviceError where the device does not say that it obeyed."""
        if not self._open:
            return
        tries = BESIDE_TRIES if self._gone else STOP_TRIES
        if not stop(self._dialogue, tries):
            raise not_stopped(self._transport.name, tries)
        self._samples.pass_over()

    def report(self) -> Report | None:
        """The link as the device saw it; None when it does not say."""
        self._check_open()
        return self._dialogue.ask(Status, _report)

    def close(self) -> None:
        """Zero volts, disabled, released. Idempotent; a line that is gone is no error.

        One that was never armed from here is let go as it is: another door may fly it.
        """
        if not self._open:
            return
        self._open = False
        try:
            if not self._ours:
                return
            tries = 1 if self._gone else TRIES
            if self._dialogue.ask(Disarm, ack_of(Type.DISARM), tries=tries) is None:
                self._dialogue.send(wire(Estop(0)))
        except DeviceError:
            pass  # unplugged: the device's watchdog has seen to it
        finally:
            self._transport.close()

    def _ask_to_arm(self, ticket: int) -> Ack | None:
        # An Ack of ours is known by the ARM's number; a second try is a new ARM, after a DISARM.
        period_us = self._period_us if self._stream else 0
        number = self._intake.arm(period_us)
        is_ack = ack_of(Type.ARM)
        return self._dialogue.ask(
            lambda _: Arm(number, ticket, period_us, self._watchdog_us),
            lambda frame, _: is_ack(frame, {number}),
            tries=1,
        )

    def _first(self) -> Sample:
        return self._own(self._samples.first())

    def _next_of_stream(self) -> Sample:
        """Of a stream that has ended: why. A stopped device says so by POLL; else DeviceError."""
        sample = self._samples.next_of_stream()
        if sample is not None:
            return sample
        problem = self._why_silent()
        if problem is not None:
            raise problem
        self._streaming = False
        return self._poll()

    def _poll(self) -> Sample:
        return self._own(self._samples.poll())

    def _own(self, sample: Sample | None) -> Sample:
        """One that came, and of a device that is still ours; DeviceError else."""
        if sample is None or (self._samples.armed and not sample.flags & _HELD):
            raise self._silence()
        return sample

    def _request(self, question: type[Disarm]) -> Ack:
        ack = self._dialogue.ask(question, ack_of(question.TYPE))
        if ack is None:
            raise self._silence()
        return ack

    def _silence(self) -> DeviceError:
        """Why no sample came: gone, restarted, or no longer ours."""
        return self._why_silent() or not_ours(self._transport.name)

    def _why_silent(self) -> DeviceError | None:
        """None when the device is there, and is the one that was opened."""
        said = self._dialogue.ask(
            Hello, lambda f, n: f if isinstance(f, IdentityFrame) and f.number in n else None
        )
        self._gone = said is None
        if said is None:
            return gone_silent(self._transport.name)
        same = said.boot == self._boot and not self._uptime_fell_back()
        return None if same else restarted(self._transport.name)

    def _uptime_s(self) -> float | None:
        """s since the device started, modulo 2³² ms; None where it does not state it."""
        report = self._dialogue.ask(Status, _report)
        return None if report is None else report.uptime_ms / 1e3

    def _uptime_fell_back(self) -> bool:
        """True where the device has restarted since it was opened: a boot number may repeat."""
        uptime_s = self._uptime_s()
        if uptime_s is None or self._started_s is None:
            return False
        expected_s = time.monotonic() - self._started_s
        short_s = wrapped_difference_s(expected_s, uptime_s)
        return short_s > RESTART_S + CLOCK_TOLERANCE * expected_s

    def _check_open(self) -> None:
        if not self._open:
            raise closed(self._transport.name)


_HELD = Flags.ENABLED | Flags.FAULT | Flags.STALL | Flags.LATCHED | Flags.ESTOP


def _report(frame: Frame, numbers: set[int]) -> Report | None:
    return frame if isinstance(frame, Report) and frame.number in numbers else None


def _microvolts(volts: float) -> int:
    return max(-LARGEST_uV, min(LARGEST_uV, round(volts * 1e6)))


def _identity(
    said: IdentityFrame, driver: str, stream: bool, watchdog_us: int, started_s: float | None
) -> Identity:
    model, serial, firmware = (
        t.rstrip(b"\0").decode("ascii", "replace") for t in (said.model, said.serial, said.firmware)
    )
    return Identity(
        driver=driver,
        model=model,
        serial=serial,
        firmware=firmware,
        protocol=f"link {said.version}",
        counts_per_rev=(said.counts_roll, said.counts_pitch, said.counts_yaw),
        v_max=said.v_max_uV / 1e6,
        watchdog_s=watchdog_us / 1e6,
        timebase="device" if stream else "host",
        emulated=model.startswith(EMULATED),
        boot=said.boot,
        started_s=started_s,
    )


__all__ = ["LinkRig", "stop_over"]
