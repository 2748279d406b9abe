"""``heli3dof run-step`` in a process of its own, with its recorder and its live view."""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys
import termios
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

SETTLE_S = 5.0
RAMP_DOWN_S = 3.0
"""s that the ramp to zero takes after the plan: the profile's ``landing_s``"""
START = "from heli3dof.cli.app import main; main()"
WITHOUT = {
    "permissions": """
import os
def refuse(*ignored):
    raise PermissionError(1, "Operation not permitted")
os.sched_setscheduler = refuse
from heli3dof.experiment.control_loop import realtime_priority
realtime_priority._may_lock_everything = lambda: False
""",
    "scheduling": """
from heli3dof.experiment.control_loop import realtime_priority
from heli3dof.rig.interface import Check
off = Check("real-time scheduling", "switched off by a benchmark", None)
realtime_priority._scheduling = lambda *ignored: off
""",
    "memory": """
from heli3dof.experiment.control_loop import realtime_priority
from heli3dof.rig.interface import Check
off = Check("locked memory", "switched off by a benchmark", None)
realtime_priority._memory = lambda *ignored: off
""",
    "workers": """
from heli3dof.experiment.control_loop import realtime_priority
realtime_priority.raise_workers = lambda *ignored: ()
""",
    "live view": """
from heli3dof.cli import progress
progress.live_allowed = lambda: False
""",
}
"""Name of a measure for real time -> program text that switches it off in the flight's process.
"permissions": the system grants nothing that needs a permission, whichever user runs the flight."""


class FlightProcess:
    """A running flight; leaving the block kills the process if it still runs.

    ``without``: names in `WITHOUT` of the measures to switch off.
    """

    def __init__(
        self,
        device: str,
        output: Path,
        seconds: float,
        *,
        profile: Path | None = None,
        without: Iterable[str] = (),
    ) -> None:
        words = [
            "run-step", "--roll", "5", "--settle", f"{SETTLE_S:g}",
            "--duration", f"{max(1.0, seconds - SETTLE_S):g}",
            "--device", device, "-o", str(output), "--json", "--force",
        ]  # fmt: skip
        if profile is not None:
            words += ["--profile", str(profile)]
        program = "".join(WITHOUT[name] for name in without) + START
        self.output = output
        self._screen, inner = pty.openpty()  # without a terminal there is no live view
        termios.tcsetwinsize(inner, (24, 80))
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
        """The last MiB that the flight wrote to its terminal"""
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        while True:
            try:
                self.shown += os.read(self._screen, 4096)
            except OSError:  # the other end was closed
                return
            del self.shown[: -(1 << 20)]

    def result(self, timeout_s: float) -> dict[str, Any]:
        """The JSON document of a completed flight. AssertionError for any other ending."""
        document = self.ended(timeout_s)
        assert self.process.returncode == 0, self.shown.decode(errors="replace")[-3000:]
        return document

    def ended(self, timeout_s: float) -> dict[str, Any]:
        """The flight's JSON document, whatever its ending. AssertionError if there is none."""
        out, _ = self.process.communicate(timeout=timeout_s)
        assert out, self.shown.decode(errors="replace")[-3000:]
        document: dict[str, Any] = json.loads(out)
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
        self._reader.join(5)
        os.close(self._screen)


@contextmanager
def firmware(program: str, *options: str, cores: Iterable[int] = ()) -> Iterator[str]:
    """Run the C firmware in a process of its own; the URL of its pseudo-terminal or TCP port.

    ``cores``: processors that it may run on; all by default.
    """
    with subprocess.Popen([program, *options], stdout=subprocess.PIPE, text=True) as process:
        if cores:
            os.sched_setaffinity(process.pid, cores)
        assert process.stdout is not None
        line = process.stdout.readline().strip()
        try:
            yield f"serial+{line}" if "://" in line else f"serial://{line}"
        finally:
            process.kill()
