"""The emulated device's side of the link: the state machine of docs/reference/protocol.md.

    IDLE ── ARM ──▶ ARMED ── no command for the watchdog's time ──▶ LATCHED
    every state ── ESTOP, fault ──▶ STOPPED

`amplifier` gives the voltage in each state. The caller passes the time in whole microseconds on
the device's clock; no method waits. The plant is simulated in whole control periods, counted
from the last arming, or from the device's start before the first arming. The motors' voltage in a
period is the mean of the amplifier's output over this period, so a late command acts late.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..link.frames import (
    NOT_MEASURED,
    VERSION,
    Ack,
    Arm,
    Cause,
    Code,
    CommandFrame,
    Disarm,
    Estop,
    Frame,
    Hello,
    IdentityFrame,
    Poll,
    Report,
    SampleFrame,
    Splitter,
    Status,
    Type,
    decoded,
    parse,
    wire,
)
from .amplifier import RAMP_US, STOPPED, Amplifier
from .device import Device
from .faults import FaultyPlant

if TYPE_CHECKING:
    from .plant import Truth

SHORTEST_US = 500
"""µs, the shortest sample period that an ARM may request"""
QUIET_US = 2_000_000
"""µs without a valid frame from the host after which the stream of samples ends"""
NO_DELAY = 0xFFFF
"""Value of ``delay_us``, the time from the previous sample to the last command: no command has
arrived since that sample, or only after 65.5 ms"""


@dataclass(frozen=True, slots=True)
class Unknown:
    """A frame with a valid checksum, but of an unknown type; ``kind`` is the type's code."""

    number: int
    kind: int


class Endpoint:
    """One emulated device: takes bytes from the host and returns bytes for the host.

    The caller passes the time ``now_us``, µs on the device's clock, to every method.
    """

    def __init__(
        self,
        device: Device,
        *,
        counts_per_rev: Sequence[int] = (4096, 4096, 8192),
        model: str = "emulated 3-DOF",
        serial: str = "mock-0",
        firmware: str = "emulator 1",
        boot: int = 1,
        shortest_us: int = SHORTEST_US,
    ) -> None:
        self._device = device
        self.amplifier = Amplifier(round(device.v_max * 1e6), round(device.watchdog_s * 1e6))
        self._texts = tuple(_text(t) for t in (model, serial, firmware))
        self._counts = tuple(counts_per_rev)
        self._boot = boot
        self._shortest_us = shortest_us
        self._splitter = _Splitter()
        self._frames = self._refused = self._late_us = 0
        self._now = 0
        self._period_us = 0
        """Period of the stream; 0: no stream"""
        self._armed_us = 0
        self._number = 0
        """Number of the next sample; samples lost on purpose (``timing.gaps``) count"""
        self._streamed = 0
        """Sampling instants of the stream until now, including those without a sample"""
        self._sampled_us: int | None = None
        self._resumed_us = 0
        """End of the last pause in which the device did nothing"""
        self._heard_us = 0
        self._arrived_us: int | None = None
        """Arrival of the last accepted command; None: none since the last sample"""
        self._dt_us = device.plant.dt * 1e6
        self._grid_us, self._steps = 0, 0
        self._arrives = True
        self._jitter_us = 0

    def receive(self, now_us: int, data: bytes) -> bytes:
        """Process the host's bytes; return replies and samples due by ``now_us``, as bytes."""
        out = self.tick(now_us)
        for frame in self._splitter.feed(data):
            self._frames += 1
            self._heard_us = self._now
            out += self._reply(frame)
        return out

    def tick(self, now_us: int) -> bytes:
        """Return the samples due by ``now_us`` (device's clock, µs) as bytes for the host."""
        out = b""
        while (due := self.next_us()) is not None and due <= now_us:
            skipped = max(0, self._resumed_us - due) // self._period_us
            read_us = self._resumed_us if skipped else due
            self._advance(read_us)
            if read_us > self._heard_us + QUIET_US:
                break
            self._streamed += 1 + skipped
            self._late_us = max(self._late_us, (read_us if skipped else now_us) - due)
            if self._arrives:
                out += self._sample(read_us)
            else:
                self._number = _u32(self._number + 1)
        self._advance(now_us)
        if now_us > self._heard_us + QUIET_US:
            self._period_us = 0
        return out

    def held_up(self, now_us: int) -> None:
        """Declare that the device was suspended until ``now_us``.

        The next call of `tick` or `receive` skips the samples that are late by a period or more. It
        returns one sample in their place, taken at ``now_us``. Call this method if the process of
        the device was suspended, but not if only the host was late: a real device would have sent
        these samples on time.
        """
        self._resumed_us = now_us

    def stop(self, now_us: int, cause: Cause = Cause.HOST_ESTOP, flag: int = STOPPED) -> bytes:
        """Set zero volts at ``now_us``; return the samples up to then, as bytes.

        Call this method for a stop without ESTOP frame: stop button, fault (``flag`` 2), motor
        stall (``flag`` 4), USB control request. The next samples report ``cause`` and ``flag``.
        """
        out = self.tick(now_us)
        self.amplifier.stop(now_us, cause, flag)
        return out

    @property
    def truth(self) -> Truth:
        """Return the simulated rig's true state, for tests and benchmarks; no frame contains it."""
        return self._device.plant.truth

    def _reply(self, frame: Frame | Unknown) -> bytes:
        amplifier, now = self.amplifier, self._now
        match frame:
            case CommandFrame():
                if amplifier.command(now, frame.number, frame.front_uV, frame.back_uV):
                    self._arrived_us = now
                    self._device.held = False
                else:
                    self._refused += 1
                return b""
            case Poll():
                if self._period_us:
                    self._refused += 1
                    return b""
                return self._sample(now)
            case Arm():
                return self._arm(frame)
            case Disarm():
                self._period_us = 0
                amplifier.disarm(now)
                return self._ack(frame.number, Type.DISARM)
            case Estop():
                amplifier.stop(now, frame.reason)
                return self._ack(frame.number, Type.ESTOP)
            case Hello():
                if not frame.oldest <= VERSION <= frame.newest:
                    return self._ack(frame.number, Type.HELLO, Code.VERSION)
                return self._identity(frame.number)
            case Status():
                return self._report(frame.number)
            case _:
                self._refused += 1
                kind = frame.kind if isinstance(frame, Unknown) else frame.TYPE
                if kind & 0x80:  # a device's frame: the line echoes ours, do not reply
                    return b""
                return self._ack(frame.number, kind, Code.UNKNOWN_TYPE)

    def _arm(self, arm: Arm) -> bytes:
        amplifier = self.amplifier
        code = amplifier.arm_code(arm.ticket)
        watchdog_us = arm.watchdog_us or amplifier.own_watchdog_us
        if code == Code.OK and (
            0 < arm.period_us < self._shortest_us
            or watchdog_us < 2 * arm.period_us
            or watchdog_us > 1_000_000
        ):
            code = Code.BAD_PARAMETER
        if code != Code.OK:
            return self._ack(arm.number, Type.ARM, code)
        now = self._now
        amplifier.arm(now, arm.number, watchdog_us)
        self._device.arm()
        self._period_us, self._armed_us, self._streamed, self._number = arm.period_us, now, 0, 0
        self._arrived_us, self._sampled_us = None, None
        self._grid_us, self._steps = now, 0
        return self._ack(arm.number, Type.ARM) + self._sample(now)

    def next_us(self) -> int | None:
        """Return when the stream's next sample is due (device's clock, µs); None: no stream."""
        if not self._period_us:
            return None
        return self._armed_us + (self._streamed + 1) * self._period_us

    def _advance(self, now_us: int) -> None:
        """Simulate the control periods that end by ``now_us`` (µs), then check the watchdog."""
        while (end := self._grid_us + round((self._steps + 1) * self._dt_us)) <= now_us:
            volts = self.amplifier.mean_V(end)
            self._steps += 1
            if self._device.held:
                continue
            plant = self._device.plant
            self._arrives = plant.step(*volts)
            self._jitter_us = round((plant.t - plant.periods * plant.dt) * 1e6)
            trip = plant.trip() if isinstance(plant, FaultyPlant) else None
            if trip is not None:
                flag, cause = trip
                self.amplifier.stop(end, cause, flag)
        self.amplifier.advance(now_us)
        self._now = now_us

    def _sample(self, now_us: int) -> bytes:
        amplifier, device = self.amplifier, self._device
        front, back = amplifier.output_uV(now_us)
        device.v = (front / 1e6, back / 1e6)
        roll, pitch, yaw = device.plant.counts
        delay = NO_DELAY
        arrived, before = self._arrived_us, self._sampled_us
        if arrived is not None and before is not None:
            delay = min(arrived - before, NO_DELAY)
        front_mA, back_mA = (_milliampere(i) for i in device.current)
        time_us = _u32(now_us + self._jitter_us)
        frame = SampleFrame(
            self._number, amplifier.last, time_us, roll, pitch, yaw, front, back, front_mA, back_mA,
            delay, amplifier.flags, amplifier.cause,
        )  # fmt: skip
        self._number = _u32(self._number + 1)
        self._arrived_us, self._sampled_us = None, now_us
        return wire(frame)

    def _ack(self, number: int, request: int, code: Code = Code.OK) -> bytes:
        a = self.amplifier
        return wire(Ack(number, request, code, a.flags, a.cause, a.ticket))

    def _identity(self, number: int) -> bytes:
        a = self.amplifier
        roll, pitch, yaw = self._counts
        model, serial, firmware = self._texts
        return wire(
            IdentityFrame(
                number, VERSION, a.flags, self._boot, a.ticket, roll, pitch, yaw, a.v_max_uV,
                a.own_watchdog_us, RAMP_US, self._shortest_us, model, serial, firmware,
            )
        )  # fmt: skip

    def _report(self, number: int) -> bytes:
        a = self.amplifier
        return wire(
            Report(
                number, _u32(self._frames), _u32(self._splitter.malformed), _u32(self._refused),
                a.expiries, min(self._late_us, 0xFFFFFFFF), 0, _u32(self._now // 1000), a.flags,
                a.cause, a.ticket,
            )
        )  # fmt: skip


class _Splitter(Splitter):
    def frame(self, piece: bytes) -> Frame | Unknown | None:  # type: ignore[override]
        known = parse(piece)
        if known is not None:
            return known
        data = decoded(piece)
        if data is None or data[0] != VERSION or data[1] in set(Type):
            return None
        return Unknown(int.from_bytes(data[2:6], "little"), data[1])


def _text(text: str) -> bytes:
    return text.encode("ascii", "replace")[:16].ljust(16, b"\0")


def _milliampere(ampere: float) -> int:
    if math.isnan(ampere):
        return NOT_MEASURED
    return max(-0x7FFF, min(0x7FFF, round(1000 * ampere)))


def _u32(value: int) -> int:
    return value & 0xFFFFFFFF
