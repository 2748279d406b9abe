"""A line that harms what passes, and a judge who knows what was sent.

Host and device talk over two such lines, COMMAND and POLL there, SAMPLE back, with arming,
disarming and stops between. The judge counts what must never happen:

- a command that the device takes though it was not sent, word by word, or was sent before the ARM
  that armed the device, or though a newer one was taken before;
- an ARM that arms though it was not sent for the present ticket;
- a sample that the host takes though the device did not say it in this arming, or though a newer
  one was taken before;
- the second of two whole frames in a row that is not read.
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
from heli3dof_drivers.link.link_statistics import LinkStatistics
from heli3dof_drivers.link.sample_validation import Intake

from tests.drivers.emulator.still import still_endpoint

KINDS = ("bits", "burst", "cut", "noise", "lost", "doubled", "delayed")
STEP_US = 250
STOPS = 0.01
"""share of the steps that begin with a DISARM, and of those that do with an ESTOP"""


@dataclass
class Tally:
    """What was done, and what came of it."""

    frames: int = 0
    harmed: Counter[str] = field(default_factory=Counter)
    commands: int = 0
    """taken by the device"""
    samples: int = 0
    """taken by the host"""
    armings: int = 0
    resyncs: int = 0
    """times that two whole frames followed on a harmed one"""
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


class Listener:
    """Reads a line as any receiver does, and judges that it stays in step."""

    def __init__(self, tally: Tally) -> None:
        self._splitter = Splitter()
        self._tally = tally
        self._whole = 2
        """whole frames in a row until now"""

    def hear(self, data: bytes, whole: bool) -> list[Frame]:
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
    """A host and a device that talk over harmful lines until enough has been harmed."""

    def __init__(self, seed: int, share: float = 0.5) -> None:
        self.tally = Tally()
        self.script: list[tuple[int, bytes, bytes]] = []
        """What came to the device, when (µs), and what it answered; for other devices to repeat"""
        self._rng = random.Random(seed)
        self._there = HarmfulLine(self._rng, share, self.tally)
        self._back = HarmfulLine(self._rng, share, self.tally)
        self._endpoint = still_endpoint()
        self._device_ear, self._host_ear = Listener(self.tally), Listener(self.tally)
        self._statistics = LinkStatistics()
        self._intake = Intake(self._statistics)
        self._now_us = 0
        self._sent: dict[int, tuple[int, int, int]] = {}
        """number → the ARM that it follows on, and what was asked for"""
        self._asked = 0
        """Number of the last ARM that was sent"""
        self._arming = self._newest = 0
        """Numbers of the ARM and of the newest command (or ARM) that the device has taken"""
        self._tickets: set[int] = set()
        """tickets for which an ARM was sent"""
        self._said: set[SampleFrame] = set()
        """this arming's samples"""
        self._taken = -1
        watch(self._endpoint, self)

    def run(self, faults: int) -> Tally:
        """Talk until this many frames have been harmed."""
        while self.tally.faults < faults:
            self.step()
        return self.tally

    def step(self) -> None:
        """One command and one reading; armed before where need be, sometimes stopped."""
        if not self._endpoint.amplifier.enabled:
            self._arm()
        draw = self._rng.random()
        if draw < STOPS:
            self._tell(Disarm(0))
        elif draw < 2 * STOPS:
            self._tell(Estop(0))
        front, back = (self._rng.randint(-24_000_000, 24_000_000) for _ in range(2))
        number = self._intake.command(0, 0.0)
        self._sent[number] = (self._asked, front, back)
        self._tell(CommandFrame(number, front, back))
        self._tell(Poll(number))

    def _arm(self) -> None:
        ticket = self._endpoint.amplifier.ticket
        self._tickets.add(ticket)
        self._said.clear()
        self._taken = -1
        self._asked = self._intake.arm()
        self._tell(Arm(self._asked, ticket, 0, 1_000_000))

    def _tell(self, frame: Frame) -> None:
        for data, whole in self._there.send(wire(frame)):
            self._now_us += STEP_US
            self._device_ear.hear(data, whole)
            answer = self._endpoint.receive(self._now_us, data)
            self.script.append((self._now_us, data, answer))
            for said in Splitter().feed(answer):
                self._hear(said)

    def _hear(self, said: Frame) -> None:
        if isinstance(said, SampleFrame):
            self._said.add(said)
        for data, whole in self._back.send(wire(said)):
            for frame in self._host_ear.hear(data, whole):
                if isinstance(frame, SampleFrame):
                    if self._intake.take(frame, 0.0) is not None:
                        self.tally.samples += 1
                        old = frame.number <= self._taken
                        self.tally.wrong_samples += old or frame not in self._said
                        self._taken = frame.number
                elif not isinstance(frame, Ack):
                    self.tally.wrong_samples += 1

    def commanded(self, number: int, front_uV: int, back_uV: int) -> None:
        """The device took a command."""
        self.tally.commands += 1
        after, *asked = self._sent.get(number, (-1, 0, 0))
        true = asked == [front_uV, back_uV] and after >= self._arming
        self.tally.wrong_commands += not true or number <= self._newest
        self._newest = number

    def armed(self, ticket: int, number: int) -> None:
        """The device took an ARM."""
        self.tally.armings += 1
        self.tally.wrong_armings += ticket not in self._tickets
        self._tickets.discard(ticket)
        self._arming = self._newest = number


def watch(endpoint: Endpoint, trial: Trial) -> None:
    """Tell the trial what the device's amplifier takes."""
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
