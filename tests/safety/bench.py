"""The emulated rig behind a pseudo-terminal, in a thread that logs every change of its output.

The flight is another process, which may be killed. The line may be cut, or lose one direction; the
device may restart. All times are the host's monotonic clock in s, which both processes share.
"""

from __future__ import annotations

import os
import threading
import time
import tty
from collections.abc import Callable
from math import inf
from typing import NamedTuple

from heli3dof_drivers.emulator.endpoint import Endpoint
from heli3dof_drivers.emulator.transport_pty import emulated, serve

from tests.profiles import START_S

IDLE_S = 5e-3
MOTION_S = 5e-3
Over = Callable[[], object]
"""Returns None until the flight has ended"""
CALLED_S = 0.03
"""s: longest interval between two calls if nothing holds the thread up: it sleeps for 20 ms"""


def never() -> None:
    """None."""


class Output(NamedTuple):
    """Output of the amplifier from ``t`` on."""

    t: float
    front_uV: int
    back_uV: int
    flags: int


class Bench:
    """A context manager; ``url`` opens the rig."""

    def __init__(self, watchdog_s: float = 0.3, *, start: str = "level", seed: int = 0) -> None:
        self.watchdog_s = watchdog_s
        self.log: list[Output] = []
        self.motion: list[tuple[float, float, float]] = []
        """(t, roll in rad, its rate in rad/s) of the emulated arm itself, every `MOTION_S`"""
        self.opened_s: float | None = None
        """Time of the host's first byte"""
        self.deaf = self.mute = False
        """True: bytes from the host, or from the device, do not arrive"""
        self.last_command_s = 0.0
        """Time of the last command that changed the volts"""
        self._called_s = time.monotonic()
        self._away: list[tuple[float, float]] = []
        """(start, end) of intervals in which this thread did not run"""
        self._mock = f"mock:?start={start}&watchdog_s={watchdog_s}&seed={seed}"
        self._endpoint = emulated(self._mock)
        self._fresh: Endpoint | None = None
        self._start = time.monotonic()
        self._ahead_us = 0
        """of the device's clock over the server's"""
        self._ours, self._theirs, self.path = -1, -1, ""
        self._pulled = self._over = False
        self.plug()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    @property
    def url(self) -> str:
        return f"serial://{self.path}?watchdog_s={self.watchdog_s}"

    def plug(self) -> None:
        """Open a new terminal, like a cable that is plugged in again."""
        self._ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)
        self.path = os.ttyname(self._theirs)
        self._pulled = False

    def pull(self) -> float:
        """Remove the port, like a cable that is pulled out; the device goes on. Time of that."""
        self._pulled = True
        return time.monotonic()

    def reset(self) -> float:
        """Restart the device. Time of that."""
        self._fresh = emulated(self._mock)
        while self._fresh is not None:
            time.sleep(1e-4)
        return self._start

    def wait_until_flying(self, over: Over = never, seconds: float = 0.5) -> None:
        """Wait until it has been flown for so long. AssertionError if the flight is ``over``."""
        deadline = time.monotonic() + START_S
        since: float | None = None
        while time.monotonic() < deadline and over() is None:
            flying = bool(self.log) and self.log[-1].front_uV != 0
            since = (since or time.monotonic()) if flying else None
            if since is not None and time.monotonic() - since > seconds:
                return
            time.sleep(0.01)
        raise AssertionError("no flight began")

    def wait_until_zero(self, for_s: float = 0.1) -> None:
        """Wait until the output has been zero for so long; ten seconds at most."""
        deadline = time.monotonic() + 10
        while time.monotonic() < min(deadline, self.zero_s + for_s):
            time.sleep(0.01)

    @property
    def zero_s(self) -> float:
        """Time from which the output is zero; infinite while it is not."""
        since = inf
        for output in reversed(self.log):
            if (output.front_uV, output.back_uV) != (0, 0):
                break
            since = output.t
        return since

    def away_s(self, since_s: float) -> float:
        """s since then in which the machine did not run this thread."""
        return sum(b - max(a, since_s) for a, b in self._away if b > since_s)

    def receive(self, now_us: int, data: bytes) -> bytes:
        """See `Endpoint.receive`."""
        own_us = self._own(now_us)
        self.opened_s = self.opened_s or time.monotonic()
        before = self._endpoint.amplifier.last
        reply = self._endpoint.receive(own_us, b"" if self.deaf else data)
        if self._endpoint.amplifier.last != before:
            self.last_command_s = time.monotonic()
        return self._log(reply)

    def tick(self, now_us: int) -> bytes:
        """See `Endpoint.tick`."""
        return self._log(self._endpoint.tick(self._own(now_us)))

    def held_up(self, now_us: int) -> None:
        """Ignored: a busy machine holds up this thread, not the device that it emulates."""

    def next_us(self) -> int | None:
        """See `Endpoint.next_us`; on the server's clock."""
        due = self._endpoint.next_us()
        return None if due is None else due - self._ahead_us

    def __enter__(self) -> Bench:
        self._thread.start()
        return self

    def __exit__(self, *problem: object) -> None:
        self._over = True
        self._thread.join(5)
        os.close(self._theirs)
        os.close(self._ours)

    def _own(self, asked_us: int) -> int:
        if self._fresh is not None:
            self._endpoint, self._fresh = self._fresh, None
            self._start = time.monotonic()
        own_us = round((time.monotonic() - self._start) * 1e6)
        self._ahead_us = own_us - asked_us
        return own_us

    def _log(self, reply: bytes) -> bytes:
        now = time.monotonic()
        if now - self._called_s > CALLED_S:
            self._away.append((self._called_s, now))
        self._called_s = now
        amplifier = self._endpoint.amplifier
        front, back = amplifier.output_uV(round((now - self._start) * 1e6))
        last = self.log[-1] if self.log else None
        if last is None or last[1:] != (front, back, amplifier.flags):
            self.log.append(Output(now, front, back, amplifier.flags))
        if not self.motion or now - self.motion[-1][0] >= MOTION_S:
            truth = self._endpoint.truth
            self.motion.append((now, truth.angle[0], truth.rate[0]))
        return b"" if self.mute else reply

    def _serve(self) -> None:
        while not self._over:
            serve(self._line(), self._ours, lambda: not (self._over or self._pulled))
            if self._pulled:
                os.close(self._theirs)
                os.close(self._ours)
                while self._pulled and not self._over:
                    self.tick(0)
                    time.sleep(IDLE_S)
                if self._over:
                    self._ours, self._theirs = os.openpty()

    def _line(self) -> Endpoint:
        return self  # type: ignore[return-value]
