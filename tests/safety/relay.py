"""The firmware's program behind a cable that can be pulled, or lose one direction.

The flight opens a pseudo-terminal; a thread relays the bytes between it and the firmware's. Same
attributes and clock as `tests.safety.bench.Bench`.
"""

from __future__ import annotations

import os
import select
import threading
import time
import tty
from contextlib import suppress
from math import inf
from pathlib import Path

from tests.drivers.emulated_rigs import RigProcess
from tests.drivers.firmware.building import rig_program


class FirmwareBench:
    """A context manager; ``url`` opens the rig."""

    def __init__(self, folder: Path, watchdog_s: float, *switches: str) -> None:
        self.watchdog_s = watchdog_s
        self.deaf = self.mute = False
        """True: bytes from the host, or from the device, do not arrive"""
        self.opened_s: float | None = None
        """Time of the host's first byte"""
        self.carried_s: list[float] = []
        """Times at which bytes went on to the device"""
        self._volts, self._motion = folder / "volts", folder / "motion"
        self._process = RigProcess([
            rig_program(), "--with-parent", "--watchdog", f"{1e3 * watchdog_s:.0f}",
            "--log", str(self._volts), "--motion", str(self._motion), *switches,
        ])  # fmt: skip
        self._rig = os.open(self._process.path, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._rig)
        self._ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)
        os.set_blocking(self._ours, False)
        self.path = os.ttyname(self._theirs)
        self._over = self._pulled = False
        self._thread = threading.Thread(target=self._relay, daemon=True)

    @property
    def url(self) -> str:
        return f"serial://{self.path}?watchdog_s={self.watchdog_s}"

    def pull(self) -> float:
        """Remove the port, like a cable that is pulled out. Time of that."""
        self._pulled = True
        return time.monotonic()

    @property
    def outputs(self) -> list[tuple[float, float, float]]:
        """(t in s, front V, back V) at every change."""
        return [(t, front, back) for t, _, front, back in _table(self._volts)]

    @property
    def armed_s(self) -> float | None:
        """Time of the first arming."""
        return next((line[0] for line in _table(self._volts) if line[1]), None)

    @property
    def motion(self) -> list[tuple[float, float, float]]:
        """(t, roll in rad, its rate in rad/s) of the firmware's plant."""
        return [(t, roll, rate) for t, roll, rate in _table(self._motion)]

    def __enter__(self) -> FirmwareBench:
        self._thread.start()
        return self

    def __exit__(self, *problem: object) -> None:
        self._over = True
        self._thread.join(5)
        self._process.end()
        for end in {self._rig, self._ours, self._theirs} - {-1}:
            os.close(end)

    def _relay(self) -> None:
        while not self._over:
            if self._pulled and self._ours >= 0:
                os.close(self._theirs)
                os.close(self._ours)
                self._ours = self._theirs = -1
            ends = [self._rig] if self._ours < 0 else [self._rig, self._ours]
            ready, _, _ = select.select(ends, [], [], 0.02)
            for end in ready:
                data = os.read(end, 4096)
                # A stopped host does not read: bytes beyond the buffer are lost.
                if end == self._ours:
                    self.opened_s = self.opened_s or time.monotonic()
                    if not self.deaf:
                        os.write(self._rig, data)
                        self.carried_s.append(time.monotonic())
                elif self._ours >= 0 and not self.mute:
                    with suppress(BlockingIOError):
                        os.write(self._ours, data)


def zero_since(outputs: list[tuple[float, float, float]]) -> float | None:
    """Time from which the output stays zero; infinite while it is not, None if it was always."""
    since: float | None = None
    for i, (_, *volts) in enumerate(outputs):
        if volts != [0.0, 0.0]:
            since = outputs[i + 1][0] if i + 1 < len(outputs) else inf
    return since


def _table(path: Path) -> list[tuple[float, ...]]:
    """The file's complete lines; the last may still be written."""
    if not path.exists():
        return []
    whole = path.read_text().rpartition("\n")[0].splitlines()
    return [tuple(float(word) for word in line.split()) for line in whole]
