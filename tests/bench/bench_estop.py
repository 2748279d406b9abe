"""How soon a rig has stopped that another process flies: asked through its session, and past it."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from heli3dof.rig.attach import running, state
from heli3dof.rig.stop import stop_rigs
from tests.bench import Figure, at_most
from tests.rig.processes import suspend

TITLE = "Stopping from another terminal"
INTRO = (
    "`heli3dof run-step` flies the emulated rig behind a pseudo-terminal at 500 Hz, recorder on; "
    "another process stops it. Time from the question to the confirmation that the device has "
    'stopped; the command\'s own start is under "The command line".'
)
FLIGHTS = int(os.environ.get("ESTOP_FLIGHTS", "20"))
DOOR = [sys.executable, "-m", "heli3dof_drivers.emulator.door_pty", "--with-parent"]
RIG = "mock:?start=level"


def measure() -> list[Figure]:
    asked = [stopped_in(hung=False) for _ in range(FLIGHTS)]
    past = [stopped_in(hung=True) for _ in range(max(1, FLIGHTS // 4))]
    return [
        at_most(
            f"stopped by the session that flies, {what}", value * 1e3, 100, "ms",
            how=f"{FLIGHTS} flights",
        )
        for what, value in (("median", statistics.median(asked)), ("longest", max(asked)))
    ] + [
        at_most(
            "stopped past a session that hangs, longest", max(past) * 1e3, 500, "ms",
            how=f"{len(past)} flights suspended with SIGSTOP; 200 ms of it are patience",
        )
    ]  # fmt: skip


def stopped_in(*, hung: bool) -> float:
    """Seconds until the confirmation, of one flight."""
    with flying() as (device, process):
        if hung:
            suspend(process)
        (stopped,), _ = stop_rigs(device, "a bench")
        assert stopped.done, stopped.how
        assert ("did not answer" in stopped.how) == hung, stopped.how
        return stopped.seconds


@contextmanager
def flying() -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """A flight that has been in the air for a second."""
    quiet = subprocess.DEVNULL
    with (
        tempfile.TemporaryDirectory() as folder,
        subprocess.Popen([*DOOR, "--device", RIG], stdout=subprocess.PIPE, text=True) as door,
    ):
        assert door.stdout is not None
        device = f"serial://{door.stdout.readline().strip()}"
        words = ["run-step", "--roll", "5", "--device", device, "-o", str(Path(folder) / "f.mcap")]
        run = [sys.executable, "-m", "heli3dof", *words]
        with subprocess.Popen(run, stdout=quiet, stderr=quiet) as process:
            try:
                until = time.monotonic() + 60
                while not any((state(s) or {}).get("phase") == "flying" for s in running(device)):
                    assert time.monotonic() < until, "no flight began within a minute"
                    time.sleep(0.02)
                time.sleep(1.0)
                yield device, process
            finally:
                process.kill()
                door.kill()
