"""``heli3dof run-step`` as a process: with recorder, live view, and the rig that it is told of."""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

SETTLE_S = 5.0
LANDING_S = 3.0
"""The profile's: what a flight takes beyond its plan"""
GRANTED = "from heli3dof.cli.app import main; main()"
REFUSED = """
import os
def refuse(*ignored):
    raise PermissionError(1, "Operation not permitted")
os.sched_setscheduler = refuse
from heli3dof.experiment import realtime
realtime._may_lock_everything = lambda: False
"""
"""A system that grants nothing which needs a permission, whoever runs this."""
ASLEEP = """
from heli3dof.experiment import awake
awake.is_virtual = lambda: False
"""
"""A virtual machine's cores are let fall asleep."""


class FlightProcess:
    """A flight under way; leaving the block kills what is left of it."""

    def __init__(
        self,
        device: str,
        output: Path,
        seconds: float,
        *,
        profile: Path | None = None,
        realtime: bool = True,
        awake: bool = True,
    ) -> None:
        words = [
            "run-step", "--roll", "5", "--settle", f"{SETTLE_S:g}",
            "--duration", f"{max(1.0, seconds - SETTLE_S):g}",
            "--device", device, "-o", str(output), "--json", "--force",
        ]  # fmt: skip
        if profile is not None:
            words += ["--profile", str(profile)]
        program = REFUSED * (not realtime) + ASLEEP * (not awake) + GRANTED
        self.output = output
        self._screen, inner = pty.openpty()  # without a terminal there is no live view
        environment = {k: v for k, v in os.environ.items() if k != "NO_COLOR"}
        self.process = subprocess.Popen(
            [sys.executable, "-c", program, *words],
            stdout=subprocess.PIPE,
            stderr=inner,
            text=True,
            env={**environment, "TERM": "xterm", "OPENBLAS_NUM_THREADS": "1"},
        )
        os.close(inner)
        self.shown = bytearray()
        """What the terminal was sent, its last 64 KiB"""
        self._watcher = threading.Thread(target=self._watch, daemon=True)
        self._watcher.start()

    def _watch(self) -> None:
        while True:
            try:
                self.shown += os.read(self._screen, 4096)
            except OSError:  # the other end was closed
                return
            del self.shown[:-65536]

    def result(self, timeout_s: float) -> dict[str, Any]:
        """The flight's JSON document. AssertionError where it ended otherwise than well."""
        document = self.ended(timeout_s)
        assert self.process.returncode == 0, self.shown.decode(errors="replace")[-3000:]
        return document

    def ended(self, timeout_s: float) -> dict[str, Any]:
        """The flight's JSON document, however it ended. AssertionError where there is none."""
        said, _ = self.process.communicate(timeout=timeout_s)
        assert said, self.shown.decode(errors="replace")[-3000:]
        document: dict[str, Any] = json.loads(said)
        return document

    def __enter__(self) -> FlightProcess:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.process.kill()
        self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()
        self._watcher.join(5)
        os.close(self._screen)


@contextmanager
def firmware(program: str, *options: str, cores: Iterable[int] = ()) -> Iterator[str]:
    """The C firmware in a process of its own; the URL of its pseudo-terminal, or of its port.

    ``cores``: those that it may run on; all unless given.
    """
    with subprocess.Popen([program, *options], stdout=subprocess.PIPE, text=True) as process:
        if cores:
            os.sched_setaffinity(process.pid, cores)
        assert process.stdout is not None
        said = process.stdout.readline().strip()
        try:
            yield f"serial+{said}" if "://" in said else f"serial://{said}"
        finally:
            process.kill()
