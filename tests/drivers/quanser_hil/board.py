"""An emulated board with the emulated helicopter: outputs, watchdog, tasks, in real time.

Where the vendor's documentation leaves a board's behaviour open, this one shows the worst: writing
after the watchdog expired has no effect and no error, and clearing restores the outputs of before.
"""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, field
from functools import cache

from heli3dof_drivers.mock import device_of
from heli3dof_drivers.options import MockOptions

from heli3dof.rig.profile import default_profile

PROFILE = default_profile()
LOW, HIGH, TRISTATE = 0, 1, 2
FULL_CURRENT_A = 4.0
"""A per motor at the amplifier's limit"""


@cache
def _compiled() -> None:
    """Compile the plant, which takes seconds, before a watchdog runs."""
    device_of(PROFILE, MockOptions(watchdog_s=0.5)).plant.step(0.0, 0.0)


@dataclass
class Bench:
    """The true wiring of the helicopter; the URL should state the same."""

    motors: tuple[int, int] = (0, 1)
    encoders: tuple[int, int, int] = (2, 1, 0)
    enable: tuple[int, ...] = (0, 1)
    enabled_by: int = HIGH
    gain: float = 3.0
    currents: tuple[int, int] = (0, 1)
    amps_per_V: float = 1.0


@dataclass
class Task:
    """A running encoder task: one tuple of counts per tick."""

    channels: list[int]
    capacity: int
    period_s: float = 0.0
    next_s: float = float("inf")
    buffer: deque[list[int]] = field(default_factory=deque)
    overflowed: bool = False


class Board:
    """One board. ``q8``: its digital outputs can only go to tristate when the watchdog expires."""

    def __init__(self, bench: Bench | None = None, *, q8: bool = True, shared: bool = False):
        self.bench = bench or Bench()
        self.q8, self.shared = q8, shared
        _compiled()
        self.plant = device_of(PROFILE, MockOptions(watchdog_s=0.5)).plant
        self.holders = 0
        self.plugged = True
        self.ppm = 0.0
        """By how much its clock is slow"""
        self.analog: dict[int, float] = {}
        """As another program may have left them"""
        self.digital: dict[int, int] = {}
        self.written: list[tuple[float, float]] = []
        """V at the motors after every change"""
        self.expiry: dict[str, dict[int, float]] = {}
        self.timeout_s: float | None = None
        self.fed_s = 0.0
        self.expired = False
        self._before: tuple[dict[int, float], dict[int, int]] = ({}, {})
        self.tasks: list[Task] = []
        self._step_s = time.monotonic() + PROFILE.dt

    def motor_volts(self) -> tuple[float, float]:
        """V at the motors now. A line in tristate is pulled up."""
        b = self.bench
        for line in b.enable:
            level = self.digital.get(line, TRISTATE)
            if (HIGH if level == TRISTATE else level) != b.enabled_by:
                return (0.0, 0.0)
        front, back = (b.gain * self.analog.get(c, 0.0) for c in b.motors)
        return (front, back)

    def counts(self, channels: list[int]) -> list[int]:
        at = dict(zip(self.bench.encoders, self.plant.counts, strict=True))
        return [at.get(c, 0) for c in channels]

    def sensed(self, channel: int) -> float:
        """V at an analog input."""
        b = self.bench
        if channel not in b.currents:
            return 0.0
        v = self.motor_volts()[b.currents.index(channel)]
        return FULL_CURRENT_A * v * abs(v) / PROFILE.motor.v_max**2 / b.amps_per_V

    def write(self, analog: dict[int, float], digital: dict[int, int]) -> None:
        self.advance()
        if not self.expired:
            self.analog |= analog
            self.digital |= digital
            self.written.append(self.motor_volts())

    def watch(self, timeout_s: float) -> None:
        self.advance()
        self.timeout_s, self.fed_s = timeout_s, time.monotonic()

    def feed(self) -> bool:
        self.advance()
        self.fed_s = time.monotonic()
        return not self.expired

    def clear(self) -> None:
        self.advance()
        if self.expired:
            self.expired, self.timeout_s = False, None
            self.analog, self.digital = self._before
            self.written.append(self.motor_volts())

    def start(self, task: Task, rate_hz: float) -> None:
        self.advance()
        task.period_s = (1 + self.ppm * 1e-6) / rate_hz
        task.next_s = time.monotonic() + task.period_s
        self.tasks.append(task)

    def stop(self, task: Task) -> None:
        if task in self.tasks:
            self.tasks.remove(task)

    def advance(self) -> float:
        """Advance the board to the present time and return it."""
        now = time.monotonic()
        while (at := min([self._step_s, *(t.next_s for t in self.tasks)])) <= now:
            self._see_to_the_watchdog(at)
            for task in self.tasks:
                if task.next_s == at:
                    self._tick(task)
            if self._step_s == at:
                self.plant.step(*self.motor_volts())
                self._step_s += PROFILE.dt
        self._see_to_the_watchdog(now)
        return now

    def _tick(self, task: Task) -> None:
        if len(task.buffer) == task.capacity:
            task.overflowed, task.next_s = True, float("inf")
            return
        task.buffer.append(self.counts(task.channels))
        task.next_s += task.period_s

    def _see_to_the_watchdog(self, at_s: float) -> None:
        if self.timeout_s is None or self.expired or at_s <= self.fed_s + self.timeout_s:
            return
        self.expired = True
        self._before = (dict(self.analog), dict(self.digital))
        # Outputs without an expiration state keep their value.
        self.analog |= self.expiry.get("analog", {})
        self.digital |= {c: int(s) for c, s in self.expiry.get("digital", {}).items()}
        self.written.append(self.motor_volts())
