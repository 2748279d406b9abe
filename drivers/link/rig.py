"""A rig on the link, over any transport: the host's side of docs/reference/protocol.md.

`LinkRig.exchange` sends the voltages of one control period and returns the next sample. It works in
one of two modes.

**Streaming.** The device samples by its own clock and sends each sample without a request:

1. Discard the samples that have already arrived.
2. Send the voltages (a COMMAND frame).
3. Wait for the next sample (a SAMPLE frame). If several have arrived together, return the newest.

So a late host skips control periods, and does not make up for them. If the connection loses or
delays a command, the device still sends its next sample. Each sample contains the number of the
last command that the device applied (the *echo*), which shows that a command is missing.

**Polled.** The host's clock determines the sampling times:

1. Discard the samples that have already arrived.
2. Send the voltages (a COMMAND frame).
3. Wait until ``due_s``, the end of the control period.
4. Send a request for a sample (a POLL frame), and return the sample in the device's reply.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from math import isfinite
from typing import TYPE_CHECKING

from heli3dof.errors import DeviceError
from heli3dof.rig.clock import CLOCK_TOLERANCE, wait_until, wrapped_difference_s
from heli3dof.rig.interface import Command, Flags, Identity, Sample

from ..errors import closed, not_a_voltage, not_armed
from .emergency_stop import SHARED_TRIES, STOP_TRIES, stop
from .errors import (
    gone_silent,
    no_valid_sample,
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
    Hello,
    IdentityFrame,
    Report,
    Status,
    command,
    wire,
)
from .handshake import check_profile, identify, period_of
from .request_reply import TRIES, RequestClient, Transport
from .sample_validation import SampleValidator, cause_name
from .sampling import Sampling

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile

LARGEST_uV = 2_000_000_000
"""µV, below the largest number of a command frame (2³¹ − 1); every device clips far below it"""
RESTART_S = 0.7
"""s: a device has restarted if its uptime is shorter than expected by more than this time. The
reply to a STATUS request may already be 0.6 s old (`TRIES` attempts)"""
EMULATED = "emulated"
"""Prefix of the model name of an emulated device"""


class LinkRig:
    """An open rig that uses the link protocol; implements `heli3dof.rig.interface.Rig`."""

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
        """Identify the device and compare it with the profile; nothing moves.

        ``driver``: the driver's name, for recordings. ``stream=False``: the host requests each
        sample. ``watchdog_s``: timeout that replaces the device's own. The timeout used is at least
        three control periods. ``signs="profile"``: the profile's signs of the encoder counts apply,
        even if the device's differ. After an error the transport is closed.
        """
        self._transport = transport
        self._client = RequestClient(transport)
        self.statistics = self._client.statistics
        """The connection's counters since it was opened"""
        self._validator = SampleValidator(self.statistics)
        self._stream = stream
        self._samples = Sampling(self._client, self._validator)
        self._streaming = False
        self._gone = self._armed_here = False
        self._open = True
        self.check_permission: Callable[[], None] = lambda: None
        """Raises SafetyTrip if a stop forbids arming (`interface.ArmsWithPermission`)"""
        try:
            reply = identify(self._client)
            check_profile(reply, profile, transport.name, signs=signs)
        except BaseException:
            transport.close()
            raise
        self._boot = reply.boot
        uptime_s = self._uptime_s() or None  # 0: the device does not measure it
        self._started_s = None if uptime_s is None else time.monotonic() - uptime_s
        self._period_us = period_of(profile)
        wanted_us = reply.watchdog_us if watchdog_s is None else round(watchdog_s * 1e6)
        self._watchdog_us = max(wanted_us, 3 * self._period_us)
        started_s = None if uptime_s is None else time.time() - uptime_s
        self.identity = _identity(reply, driver, stream, self._watchdog_us, started_s)

    @property
    def device_cause(self) -> str | None:
        """Return why the device holds its output at zero; None if it does not hold it at zero.

        The last sample from the device states the reason.
        """
        return cause_name(self._validator.cause)

    def arm(self) -> Sample:
        """Clear latched stops, enable the output at zero volts, and return the first sample."""
        self._check_open()
        self._samples.armed = self._streaming = False
        self._armed_here = True
        # A restart zeroes the counts at the present angles: do not convert them as before.
        if (problem := self._connection_error()) is not None:
            raise problem
        for _ in range(TRIES):
            disarmed = self._client.request(Disarm, Ack)
            if disarmed is None:
                raise self._no_sample()
            # A later stop changes the ticket: the device then refuses to arm.
            self.check_permission()
            self._samples.discard_stale()
            reply = self._request_arm(disarmed.ticket)
            if reply is None:
                continue
            code = reply.code
            if code == Code.OK:
                self._samples.armed, self._streaming = True, self._stream
                self._samples.set_round_trip(self._client.round_trip_s)
                if self._stream:
                    return self._next_of_stream()
                return self._checked(self._samples.first())
            if code not in (Code.STALE_TICKET, Code.ALREADY_ARMED):
                raise not_arming(
                    self._transport.name, code, reply.cause, self._period_us, self._watchdog_us
                )
        raise self._no_sample()

    def read(self) -> Sample:
        """Return a new sample without sending a command; the rig need not be armed."""
        self._check_open()
        if self._streaming:
            self._samples.discard_stale()
            return self._next_of_stream()
        return self._poll()

    def exchange(self, command_: Command, due_s: float) -> Sample:
        """Send a command and return the sample at the end of this control period.

        ``due_s``: end of the period in s on the host's monotonic clock. The method uses it only if
        the host requests each sample. A streaming device sends a sample at each period's end.
        """
        self._check_open()
        v_front, v_back = command_.v_front, command_.v_back
        if not (isfinite(v_front) and isfinite(v_back)):
            self.estop("a command that is not a number")
            raise not_a_voltage(command_.sequence, v_front, v_back)
        if not self._samples.armed:
            raise not_armed(self._transport.name)
        self._samples.discard_stale()
        number = self._validator.command(command_.sequence)
        self._client.send(command(number, _microvolts(v_front), _microvolts(v_back)))
        self.statistics.commands += 1
        if self._streaming:
            return self._next_of_stream()
        wait_until(due_s)
        return self._poll()

    def estop(self, reason: str) -> None:
        """Set zero volts now; ``reason`` is not used.

        Raises DeviceError if the device does not confirm the stop.
        """
        if not self._open:
            return
        tries = SHARED_TRIES if self._gone else STOP_TRIES
        if not stop(self._client, tries):
            raise not_stopped(self._transport.name, tries)
        self._samples.discard_stale()

    def report(self) -> Report | None:
        """Return the device's own counters; None if it does not reply."""
        self._check_open()
        return self._client.request(Status, Report)

    def close(self) -> None:
        """Set zero volts, disable the amplifier and close the connection.

        A second call does nothing, and a broken connection raises no error. A device that this
        object never armed is left as it is, because another program may run it.
        """
        if not self._open:
            return
        self._open = False
        try:
            if not self._armed_here:
                return
            tries = 1 if self._gone else TRIES
            if self._client.request(Disarm, Ack, tries=tries) is None:
                self._client.send(wire(Estop(0)))
        except DeviceError:
            pass  # unplugged: the device's watchdog stops the motors
        finally:
            self._transport.close()

    def _request_arm(self, ticket: int) -> Ack | None:
        # One attempt: a second one is a new ARM, with a new ticket.
        period_us = self._period_us if self._stream else 0
        number = self._validator.arm(period_us)
        arm = Arm(number, ticket, period_us, self._watchdog_us)
        return self._client.request(lambda _: arm, Ack, tries=1)

    def _next_of_stream(self) -> Sample:
        """Return the next sample that the device streams; if it has stopped streaming, poll one."""
        sample = self._samples.next_of_stream()
        if sample is not None:
            return sample
        problem = self._connection_error()
        if problem is not None:
            raise problem
        self._streaming = False
        return self._poll()

    def _poll(self) -> Sample:
        return self._checked(self._samples.poll())

    def _checked(self, sample: Sample | None) -> Sample:
        if sample is None or (self._samples.armed and not sample.flags & _SINCE_ARMED):
            raise self._no_sample()
        return sample

    def _no_sample(self) -> DeviceError:
        problem = self._connection_error()
        if problem is not None:
            return problem
        report = self._client.request(Status, Report)
        if self._samples.armed and report is not None and report.flags & Flags.LATCHED:
            return no_valid_sample(self._transport.name, *self._samples.since_valid())
        return not_ours(self._transport.name)

    def _connection_error(self) -> DeviceError | None:
        """Return the DeviceError if the device is silent or has restarted since it was opened.

        The result is None if neither is the case.
        """
        reply = self._client.request(Hello, IdentityFrame)
        self._gone = reply is None
        if reply is None:
            seconds, malformed, _ = self._samples.since_valid()
            return gone_silent(self._transport.name, seconds, malformed)
        same = reply.boot == self._boot and not self._uptime_fell_back()
        return None if same else restarted(self._transport.name)

    def _uptime_s(self) -> float | None:
        """Return the seconds since the device started, modulo 2³² ms; None if it does not reply."""
        report = self._client.request(Status, Report)
        return None if report is None else report.uptime_ms / 1e3

    def _uptime_fell_back(self) -> bool:
        """Return True if the device has restarted: its uptime is shorter than expected."""
        uptime_s = self._uptime_s()
        if uptime_s is None or self._started_s is None:
            return False
        expected_s = time.monotonic() - self._started_s
        short_s = wrapped_difference_s(expected_s, uptime_s)
        return short_s > RESTART_S + CLOCK_TOLERANCE * expected_s

    def _check_open(self) -> None:
        if not self._open:
            raise closed(self._transport.name)


_SINCE_ARMED = Flags.ENABLED | Flags.FAULT | Flags.STALL | Flags.LATCHED | Flags.ESTOP


def _microvolts(volts: float) -> int:
    return max(-LARGEST_uV, min(LARGEST_uV, round(volts * 1e6)))


def _identity(
    reply: IdentityFrame, driver: str, stream: bool, watchdog_us: int, started_s: float | None
) -> Identity:
    model, serial, firmware = (
        t.rstrip(b"\0").decode("ascii", "replace")
        for t in (reply.model, reply.serial, reply.firmware)
    )
    return Identity(
        driver=driver,
        model=model,
        serial=serial,
        firmware=firmware,
        protocol=f"link {reply.version}",
        counts_per_rev=(reply.counts_roll, reply.counts_pitch, reply.counts_yaw),
        v_max=reply.v_max_uV / 1e6,
        watchdog_s=watchdog_us / 1e6,
        timebase="device" if stream else "host",
        emulated=model.startswith(EMULATED),
        boot=reply.boot,
        started_s=started_s,
    )
