"""A line that corrupts frames, and a trial that knows what was sent.

Host and device communicate over two such lines: COMMAND and POLL to the device, SAMPLE back, with
arming, disarming and stops between. The trial counts events that must never occur:

- the device accepts a command that was not sent so, was sent before the ARM of this arming, or is
  not newer than the last one;
- an ARM arms the device that was not sent with the current ticket;
- the host accepts a sample that the device did not send in this arming, or that is not newer than
  the last one;
- the second of two valid frames in a row is not received.
"""

from __future__ import annotations

import random
from collections import Counter
from dataclasses import dataclass, field

from heli3dof_drivers.emulator.endpoint import Endpoint
from heli3dof_drivers.link.frames import (
    Ack,
    Arm,
    CommandFrame,
    Disarm,
    Estop,
    Frame,
    Poll,
    SampleFrame,
    Splitter,
    wire,
)
from heli3dof_drivers.link.request_reply import LinkStatistics
from heli3dof_drivers.link.sample_validation import SampleValidator

from tests.drivers.emulator.still import still_endpoint

KINDS = ("bits", "burst", "cut", "noise", "lost", "doubled", "delayed")
STEP_US = 250
STOPS = 0.01
"""Share of the steps that begin with a DISARM, and of those with an ESTOP"""


@dataclass
class Tally:
    """Counts of a trial."""

    frames: int = 0
    harmed: Counter[str] = field(default_factory=Counter)
    commands: int = 0
    """Accepted by the device"""
    samples: int = 0
    """Accepted by the host"""
    armings: int = 0
    resyncs: int = 0
    """Times that two valid frames followed a corrupted one"""
    wrong_commands: int = 0
    wrong_armings: int = 0
    wrong_samples: int = 0
    unsynchronised: int = 0

    @property
    def faults(self) -> int:
        return sum(self.harmed.values())

    @property
    def wrong(self) -> int:
        return self.wrong_commands + self.wrong_armings + self.wrong_samples + self.unsynchronised


class HarmfulLine:
    """Passes frames on; a share of them changed, cut, doubled, late or not at all."""

    def __init__(self, rng: random.Random, share: float, tally: Tally) -> None:
        self._rng, self._share, self._tally = rng, share, tally
        self._late: list[tuple[int, bytes]] = []
        self._passed = 0

    def send(self, frame: bytes) -> list[tuple[bytes, bool]]:
        """What arrives for it now: pieces of bytes, and whether each is one whole frame."""
        self._passed += 1
        self._tally.frames += 1
        out: list[tuple[bytes, bool]] = []
        if self._rng.random() < self._share:
            kind = self._rng.choice(KINDS)
            self._tally.harmed[kind] += 1
            out = getattr(self, kind)(frame)
        else:
            out = [(frame, True)]
        while self._late and self._late[0][0] <= self._passed:
            out.append((self._late.pop(0)[1], True))
        return out

    def bits(self, frame: bytes) -> list[tuple[bytes, bool]]:
        data = bytearray(frame)
        for _ in range(self._rng.randint(1, 8)):
            data[self._rng.randrange(len(data))] ^= 1 << self._rng.randrange(8)
        return [(bytes(data), bytes(data) == frame)]

    def burst(self, frame: bytes) -> list[tuple[bytes, bool]]:
        start = self._rng.randrange(len(frame))
        n = self._rng.randint(1, 16)
        data = frame[:start] + self._rng.randbytes(min(n, len(frame) - start)) + frame[start + n :]
        return [(data, data == frame)]

    def cut(self, frame: bytes) -> list[tuple[bytes, bool]]:
        a, b = sorted(self._rng.sample(range(len(frame) + 1), 2))
        return [(frame[:a] + frame[b:], False)]

    def noise(self, frame: bytes) -> list[tuple[bytes, bool]]:
        at = self._rng.randrange(len(frame) + 1)
        return [(frame[:at] + self._rng.randbytes(self._rng.randint(1, 40)) + frame[at:], False)]

    def lost(self, frame: bytes) -> list[tuple[bytes, bool]]:
        return []

    def doubled(self, frame: bytes) -> list[tuple[bytes, bool]]:
        return [(frame, True)] * 2

    def delayed(self, frame: bytes) -> list[tuple[bytes, bool]]:
        self._late.append((self._passed + self._rng.randint(1, 6), frame))
        self._late.sort()
        return []


class Receiver:
    """A receiver that checks that it stays synchronised."""

    def __init__(self, tally: Tally) -> None:
        self._splitter = Splitter()
        self._tally = tally
        self._whole = 2
        """Valid frames in a row until now"""

    def feed(self, data: bytes, whole: bool) -> list[Frame]:
        frames = self._splitter.feed(data)
        if not whole:
            self._whole = 0
            return frames
        self._whole += 1
        if self._whole == 2:
            self._tally.resyncs += 1
        if self._whole >= 2 and (not frames or wire(frames[-1]) != data):
            self._tally.unsynchronised += 1
        return frames


class Trial:
    """A host and a device that communicate over corrupting lines."""

    def __init__(self, seed: int, share: float = 0.5) -> None:
        self.tally = Tally()
        self.script: list[tuple[int, bytes, bytes]] = []
        """Time (µs), bytes received by the device, and its reply; for other devices to repeat"""
        self._rng = random.Random(seed)
        self._there = HarmfulLine(self._rng, share, self.tally)
        self._back = HarmfulLine(self._rng, share, self.tally)
        self._endpoint = still_endpoint()
        self._device, self._host = Receiver(self.tally), Receiver(self.tally)
        self._statistics = LinkStatistics()
        self._validator = SampleValidator(self._statistics)
        self._now_us = 0
        self._sent: dict[int, tuple[int, int, int]] = {}
        """Command's number → number of its ARM, and its voltages in µV"""
        self._asked = 0
        """Number of the last ARM that was sent"""
        self._arming = self._newest = 0
        """Numbers of the last ARM and of the newest command (or ARM) that the device accepted"""
        self._tickets: set[int] = set()
        """Tickets for which an ARM was sent"""
        self._samples: set[SampleFrame] = set()
        """Samples that the device sent in this arming"""
        self._taken = -1
        watch(self._endpoint, self)

    def run(self, faults: int) -> Tally:
        """Run steps until this many frames have been corrupted."""
        while self.tally.faults < faults:
            self.step()
        return self.tally

    def step(self) -> None:
        """One command and one POLL; first armed where needed, sometimes stopped."""
        if not self._endpoint.amplifier.enabled:
            self._arm()
        draw = self._rng.random()
        if draw < STOPS:
            self._send(Disarm(0))
        elif draw < 2 * STOPS:
            self._send(Estop(0))
        front, back = (self._rng.randint(-24_000_000, 24_000_000) for _ in range(2))
        number = self._validator.command(0)
        self._sent[number] = (self._asked, front, back)
        self._send(CommandFrame(number, front, back))
        self._send(Poll(number))

    def _arm(self) -> None:
        ticket = self._endpoint.amplifier.ticket
        self._tickets.add(ticket)
        self._samples.clear()
        self._taken = -1
        self._asked = self._validator.arm()
        self._send(Arm(self._asked, ticket, 0, 1_000_000))

    def _send(self, frame: Frame) -> None:
        for data, whole in self._there.send(wire(frame)):
            self._now_us += STEP_US
            self._device.feed(data, whole)
            answer = self._endpoint.receive(self._now_us, data)
            self.script.append((self._now_us, data, answer))
            for reply in Splitter().feed(answer):
                self._to_host(reply)

    def _to_host(self, reply: Frame) -> None:
        if isinstance(reply, SampleFrame):
            self._samples.add(reply)
        for data, whole in self._back.send(wire(reply)):
            for frame in self._host.feed(data, whole):
                if isinstance(frame, SampleFrame):
                    if self._validator.accept(frame, 0.0) is not None:
                        self.tally.samples += 1
                        old = frame.number <= self._taken
                        self.tally.wrong_samples += old or frame not in self._samples
                        self._taken = frame.number
                elif not isinstance(frame, Ack):
                    self.tally.wrong_samples += 1

    def commanded(self, number: int, front_uV: int, back_uV: int) -> None:
        """The device accepted a command."""
        self.tally.commands += 1
        after, *volts = self._sent.get(number, (-1, 0, 0))
        true = volts == [front_uV, back_uV] and after >= self._arming
        self.tally.wrong_commands += not true or number <= self._newest
        self._newest = number

    def armed(self, ticket: int, number: int) -> None:
        """The device accepted an ARM."""
        self.tally.armings += 1
        self.tally.wrong_armings += ticket not in self._tickets
        self._tickets.discard(ticket)
        self._arming = self._newest = number


def watch(endpoint: Endpoint, trial: Trial) -> None:
    """Report to the trial what the device's amplifier accepts."""
    amplifier = endpoint.amplifier
    command, arm = amplifier.command, amplifier.arm

    def commanded(now_us: int, number: int, front_uV: int, back_uV: int) -> bool:
        taken = command(now_us, number, front_uV, back_uV)
        if taken:
            trial.commanded(number, front_uV, back_uV)
        return taken

    def armed(now_us: int, number: int, watchdog_us: int) -> None:
        trial.armed(amplifier.ticket, number)
        arm(now_us, number, watchdog_us)

    amplifier.command, amplifier.arm = commanded, armed  # type: ignore[method-assign]
