"""A rig at the other end of the link, whatever carries it; docs/protocol.md, the host's side.

Streaming (the device keeps time)::

    exchange:  COMMAND at once ──▶ ... the device's next sample ──▶ the port's sample

Samples that were waiting when the command went out say nothing of it: they are passed over, and
of several that came together the newest counts. So a host that was late loses periods, and never
flies two of them in one. Polled (the host keeps time)::

    exchange:  COMMAND at once, wait until due_s, POLL ──▶ SAMPLE
"""

from __future__ import annotations

import time
from collections.abc import Callable
from math import isfinite
from typing import TYPE_CHECKING

from heli3dof.errors import DeviceError
from heli3dof.rig.clock import wait_until
from heli3dof.rig.port import Command, Flags, Identity, Sample

from .dialogue import Dialogue
from .frames import (
    Ack,
    Arm,
    Cause,
    Code,
    Disarm,
    Estop,
    Frame,
    Hello,
    IdentityFrame,
    Poll,
    Report,
    Status,
    Type,
    command,
    wire,
)
from .greeting import check_profile, greet, period_of
from .intake import Intake

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile

    from .statistics import LinkStatistics
    from .transport import Transport

SILENCE_S = 0.5
"""s without the sample that was due until the rig counts as gone; its watchdog is quicker"""
POLL_AGAIN_S = 5e-3
"""s until a POLL that stays without an answer is repeated"""
STOP_EVERY_S = 20e-3
STOP_TRIES = 25
LARGEST_uV = 2_000_000_000
"""What fits into a command; any device clips long before."""
EMULATED = "emulated"
"""How the model of a device without motors begins"""


class LinkRig:
    """An open rig; see `heli3dof.rig.port.Rig`. ``statistics`` says how the link has been."""

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
        self._streaming = self._armed = False
        self._open = True
        try:
            said = greet(self._dialogue)
            check_profile(said, profile, transport.name, signs=signs)
        except BaseException:
            transport.close()
            raise
        self._boot = said.boot
        self._period_us = period_of(profile)
        own_us = said.watchdog_us
        asked_us = own_us if watchdog_s is None else round(watchdog_s * 1e6)
        self._watchdog_us = max(asked_us, 3 * self._period_us)
        self._identity = _identity(said, driver, stream, self._watchdog_us)

    @property
    def identity(self) -> Identity:
        return self._identity

    @property
    def statistics(self) -> LinkStatistics:
        """How the link has been since it was opened."""
        return self._dialogue.statistics

    def arm(self) -> Sample:
        """Zero volts, latches cleared, enabled; the first sample."""
        self._check_open()
        self._armed = self._streaming = False
        code = Code.STALE_TICKET
        for _ in range(3):
            disarmed = self._request(Disarm)
            self._pass_over()
            said = self._ask_to_arm(disarmed.ticket)
            if said is None:
                continue
            code = Code(said.code)
            if code == Code.OK:
                self._armed, self._streaming = True, self._stream
                return self._next_of_stream() if self._stream else self._first()
            if code not in (Code.STALE_TICKET, Code.ALREADY_ARMED):
                raise self._refused(code, said.cause)
        raise self._refused(code, 0)

    def read(self) -> Sample:
        """A sample now, armed or not."""
        self._check_open()
        if self._streaming:
            self._pass_over()
            return self._next_of_stream()
        return self._poll()

    def exchange(self, command_: Command, due_s: float) -> Sample:
        """One control period under the command; see `heli3dof.rig.port`."""
        self._check_open()
        v_front, v_back = command_.v_front, command_.v_back
        if not (isfinite(v_front) and isfinite(v_back)):
            self.estop("a voltage that is not a number")
            raise DeviceError(
                f"The command {command_.sequence} is not a voltage: {v_front}, {v_back}.",
                cause="the controller's output is not finite; the motors were stopped.",
                fix="check the gains and references of this flight",
            )
        if not self._armed:
            raise DeviceError(
                f"{self._transport.name} is not armed.",
                cause="exchange() was called before arm().",
                fix="arm() first",
            )
        self._pass_over()
        number = self._intake.command(command_.sequence)
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
        if not _stop(self._dialogue):
            raise DeviceError(
                f"{self._transport.name}: the emergency stop was sent {STOP_TRIES} times and not "
                "acknowledged.",
                cause="the line is broken; the device's own watchdog stops it.",
                fix="press the amplifier's button; then heli3dof doctor",
            )
        self._pass_over()

    def report(self) -> Report | None:
        """The link as the device saw it; None when it does not say."""
        self._check_open()
        return self._dialogue.ask(
            Status, lambda f, n: f if isinstance(f, Report) and f.number in n else None
        )

    def close(self) -> None:
        """Zero volts, disabled, released. Idempotent; a line that is gone is no error."""
        if not self._open:
            return
        self._open = False
        try:
            if self._dialogue.ask(Disarm, _ack_of(Type.DISARM)) is None:
                self._dialogue.send(wire(Estop(0)))
        except DeviceError:
            pass  # unplugged: the device's watchdog has seen to it
        finally:
            self._transport.close()

    def _ask_to_arm(self, ticket: int) -> Ack | None:
        number = self._intake.arm()
        # An Ack of ours is known by the ARM's number; a second try is a new ARM, after a DISARM.
        period_us = self._period_us if self._stream else 0
        is_ack = _ack_of(Type.ARM)
        return self._dialogue.ask(
            lambda _: Arm(number, ticket, period_us, self._watchdog_us),
            lambda frame, _: is_ack(frame, {number}),
            tries=1,
        )

    def _first(self) -> Sample:
        """The sample that follows the ARM of a polled device."""
        until = time.monotonic() + SILENCE_S
        while time.monotonic() < until:
            sample = self._newest()
            if sample is not None:
                return sample
            self._dialogue.receive(POLL_AGAIN_S * 4)
            if not self._dialogue.samples:
                return self._poll()
        raise self._silence() or self._disarmed()

    def _next_of_stream(self) -> Sample:
        dialogue, statistics = self._dialogue, self.statistics
        until = time.monotonic() + SILENCE_S
        in_flight = True
        while True:
            sample = self._newest()
            if sample is not None:
                if self._intake.heard or not sample.flags & Flags.ENABLED:
                    return sample
                if not in_flight:  # the second sample since: the command was lost
                    statistics.unheard += 1
                    return sample
                in_flight = False
                statistics.passed_over += 1
                continue
            left = until - time.monotonic()
            if left <= 0:
                return self._after_the_stream()
            dialogue.receive(left)

    def _after_the_stream(self) -> Sample:
        """The stream has ended; ask why. A stopped device says so by POLL; else DeviceError."""
        problem = self._silence()
        if problem is not None:
            raise problem
        self._streaming = False
        return self._poll()

    def _poll(self) -> Sample:
        dialogue, statistics = self._dialogue, self.statistics
        self._pass_over()
        until = time.monotonic() + SILENCE_S
        while (asked := time.monotonic()) < until:
            dialogue.send(wire(Poll(dialogue.next_number())))
            while (left := asked + POLL_AGAIN_S - time.monotonic()) > 0:
                dialogue.receive(left)
                sample = self._newest()
                if sample is None:
                    continue
                statistics.round_trip.add(sample.host_time_s - asked)
                if not self._armed:
                    return sample
                if not sample.flags & _HELD:
                    raise self._silence() or self._disarmed()
                statistics.unheard += not self._intake.heard
                return sample
            statistics.repeats += 1
        raise self._silence() or self._disarmed()

    def _newest(self) -> Sample | None:
        """The newest of the samples that have come and can be; the others are passed over."""
        samples, take = self._dialogue.samples, self._intake.take
        if not self._armed:
            take = self._intake.sample
        newest: Sample | None = None
        while samples:
            frame, came_s = samples.popleft()
            sample = take(frame, came_s)
            if sample is not None:
                self.statistics.passed_over += newest is not None
                newest = sample
        return newest

    def _pass_over(self) -> None:
        """What was sampled before now is of no use."""
        self._dialogue.drain()
        if self._newest() is not None:
            self.statistics.passed_over += 1

    def _request(self, question: type[Disarm]) -> Ack:
        ack = self._dialogue.ask(question, _ack_of(question.TYPE))
        if ack is None:
            raise self._silence() or self._disarmed()
        return ack

    def _silence(self) -> DeviceError | None:
        """Why no sample came: gone, or started anew; None when it is there as it was."""
        said = self._dialogue.ask(
            Hello, lambda f, n: f if isinstance(f, IdentityFrame) and f.number in n else None
        )
        name = self._transport.name
        if said is None:
            return DeviceError(
                f"{name}: the rig has gone silent.",
                cause="the cable is out, or the device has lost its supply; its own watchdog "
                "has taken the motors to zero.",
                fix="check cable and supply, then heli3dof doctor",
            )
        if said.boot != self._boot:
            return DeviceError(
                f"{name}: the device has started anew.",
                cause="its supply dipped or its firmware crashed; the motors are at zero, and its "
                "encoders have begun to count at zero where the rig stood then.",
                fix="let the rig rest, then open it again; heli3dof zero where it cannot rest",
            )
        return None

    def _disarmed(self) -> DeviceError:
        return DeviceError(
            f"{self._transport.name}: the device is there, and is no longer armed by this program.",
            cause="another program speaks with it.",
            fix="end the other program; heli3dof doctor names it",
        )

    def _refused(self, code: Code, cause: int) -> DeviceError:
        name = self._transport.name
        if code == Code.FAULT:
            why = Cause(cause).name.lower() if cause in set(Cause) else f"number {cause}"
            return DeviceError(
                f"{name}: the device does not arm: its amplifier reports a fault ({why}).",
                cause="overload, heat, a stalled motor or a pressed button.",
                fix="release the button, let it cool, switch the amplifier off and on",
            )
        if code == Code.BAD_PARAMETER:
            return DeviceError(
                f"{name}: the device refuses a period of {self._period_us} µs with a watchdog of "
                f"{self._watchdog_us} µs.",
                cause="a watchdog must last two periods at least and one second at most.",
                fix="another watchdog_s in the device URL, or another loop.rate_hz",
            )
        return self._disarmed()

    def _check_open(self) -> None:
        if not self._open:
            raise DeviceError(
                f"{self._transport.name} is closed.",
                cause="close() was called before this.",
                fix="open it again with heli3dof.rig.drivers.open_rig",
            )


_HELD = Flags.ENABLED | Flags.FAULT | Flags.STALL | Flags.LATCHED | Flags.ESTOP


def stop_over(transport: Transport) -> str:
    """Send ESTOP until it is acknowledged; what came of it. Raises DeviceError as the line does."""
    if _stop(Dialogue(transport)):
        return f"{transport.name}: stopped, and the rig says so"
    return (
        f"{transport.name}: the stop was sent {STOP_TRIES} times; no acknowledgement was seen "
        "(a program that holds the port may have read it)"
    )


def _stop(dialogue: Dialogue) -> bool:
    acked = dialogue.ask(Estop, _ack_of(Type.ESTOP), tries=STOP_TRIES, patience_s=STOP_EVERY_S)
    return acked is not None


def _ack_of(request: Type) -> Callable[[Frame, set[int]], Ack | None]:
    def answer(frame: Frame, numbers: set[int]) -> Ack | None:
        if isinstance(frame, Ack) and frame.request == request and frame.number in numbers:
            return frame
        return None

    return answer


def _microvolts(volts: float) -> int:
    return max(-LARGEST_uV, min(LARGEST_uV, round(volts * 1e6)))


def _identity(said: IdentityFrame, driver: str, stream: bool, watchdog_us: int) -> Identity:
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
    )
